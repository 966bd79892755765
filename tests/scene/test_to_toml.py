"""A scene as text reads back as the same scene, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pendbench import load_scene
from pendbench.base.bundled import bundled_names
from pendbench.effects import examples
from pendbench.scene.scene import Effects, Links, Scene

NUMBERS = st.floats(-1e9, 1e9, allow_nan=False)
POSITIVE = st.floats(1e-50, 1e50, allow_nan=False)


def read_back(scene, folder):
    path = folder / f"{scene.name}.toml"
    path.write_text(scene.to_toml(), "utf-8")
    return load_scene(path)


def check_same(again, scene):
    assert again.digest == scene.digest
    assert (again.name, again.title, again.duration, again.effects) == (
        scene.name,
        scene.title,
        scene.duration,
        scene.effects,
    )
    for array in ("masses", "lengths", "angles", "rates"):
        assert getattr(again, array).tobytes() == getattr(scene, array).tobytes()


@pytest.mark.parametrize("name", bundled_names("models"))
def test_every_bundled_scene(name, tmp_path):
    scene = load_scene(name)
    check_same(read_back(scene, tmp_path), scene)


@settings(max_examples=60, deadline=None)
@given(data=st.data(), rigid=st.booleans())
def test_any_numbers_and_any_effects(data, rigid, tmp_path_factory):
    def two(numbers):
        return data.draw(st.tuples(numbers, numbers))

    usual = examples()
    chosen = data.draw(st.sets(st.sampled_from([name for name in usual if not (rigid and name == "rod_mass")])))
    if "joint_rest" in chosen:
        chosen = chosen | {"joint_stiffness"}
    effects = {name: usual[name] for name in chosen}
    if "joint_damping" in chosen:
        effects["joint_damping"] = two(POSITIVE)
    scene = Scene(
        name="any",
        title=data.draw(st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=20)),
        duration=data.draw(st.floats(1e-50, 1e9)),
        masses=np.zeros(2) if rigid else np.array(two(POSITIVE)),
        lengths=np.array(two(st.floats(0.1, 10.0))),
        angles=np.array(two(NUMBERS)),
        rates=np.array(two(NUMBERS)),
        effects=Effects(**effects),
        links=Links(*(np.array(two(st.floats(0.01, 10.0))) for _ in range(3))) if rigid else None,
    )
    check_same(read_back(scene, tmp_path_factory.mktemp("any")), scene)


@pytest.mark.parametrize("title", ['He said "so"', "back\\slash", "naïve ∞", "\\u0041"])
def test_titles_with_signs_that_mean_something_in_toml(title, tmp_path):
    scene = Scene("t", title, 1.0, np.ones(2), np.ones(2), np.zeros(2), np.array([0.0, -0.0]), Effects(gravity=1.0))
    check_same(read_back(scene, tmp_path), scene)


def test_numbers_that_are_the_same_for_all_links_are_written_once():
    text = load_scene("everything").to_toml()
    assert "mass = 0.1\n" in text
    assert "angles = 1.0\n" in text
    assert 'driven_pivot = { axis = "x", amplitude = 0.02, angular_frequency = 20.0' in text
