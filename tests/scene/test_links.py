"""Rigid links: what a file and Python may say of them, and what both refuse in one line."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendbench.base.errors import InputError
from pendbench.engines.protocol import refusal
from pendbench.engines.recording import simulate
from pendbench.engines.registry import engine
from pendbench.scene.links import EXAMPLE, Links
from pendbench.scene.scene import Effects, Scene, load_scene

FILE = """
duration = 5
[chain]
lengths = [0.5, 1]
[links]
mass = [1.2, 0.8]
centre = [0.25, 0.4]
inertia = [0.02, 0.006]
[start]
angles = [0.1, 0.2]
[effects]
gravity = 9.81
"""


def arm(**changes: Any) -> Scene:
    content: dict[str, Any] = {
        "name": "arm",
        "title": "arm",
        "duration": 5.0,
        "masses": None,
        "lengths": [0.5, 1.0],
        "angles": [0.1, 0.2],
        "rates": [0.0, 0.0],
        "effects": Effects(gravity=9.81),
        "links": {"mass": [1.2, 0.8], "centre": [0.25, 0.4], "inertia": [0.02, 0.006]},
    }
    return Scene(**{**content, **changes})


@pytest.fixture
def loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.chdir(tmp_path)

    def load(*changes: tuple[str, str]) -> Scene:
        text = FILE
        for before, after in changes:
            assert before in text
            text = text.replace(before, after)
        Path("arm.toml").write_text(text)
        return load_scene("arm.toml")

    return load


def test_a_file_says_what_the_links_are(loaded: Any) -> None:
    found = loaded()
    assert found.digest == arm().digest
    assert found.n == 2
    np.testing.assert_array_equal(found.masses, [0.0, 0.0])
    assert found.links is not None
    np.testing.assert_array_equal(found.links.mass, [1.2, 0.8])
    np.testing.assert_array_equal(found.links.centre, [0.25, 0.4])
    np.testing.assert_array_equal(found.links.inertia, [0.02, 0.006])


def test_a_number_is_meant_for_every_link(loaded: Any) -> None:
    found = loaded(("mass = [1.2, 0.8]", "mass = 2"), ("inertia = [0.02, 0.006]", "inertia = 0"))
    np.testing.assert_array_equal(found.links.mass, [2.0, 2.0])
    assert found.digest == arm(links=Links(2.0, [0.25, 0.4], 0)).digest  # type: ignore[arg-type]


def test_lists_of_links_say_how_many_there_are(loaded: Any) -> None:
    assert loaded(("lengths = [0.5, 1]", "length = 0.5")).n == 2


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("mass = [1.2, 0.8]", "", " [links]: missing key 'mass'"),
        (
            "mass = [1.2, 0.8]",
            "mass = [1.2, 0]",
            " [links]: mass, entry 2, is 0; allowed: a number from 1e-50 to 1e+50",
        ),
        ("mass = [1.2, 0.8]", "mass = 'x'", " [links]: mass is 'x'; allowed: a number from 1e-50 to 1e+50 kg"),
        ("mass = [1.2, 0.8]", "mass = [1, 2, 3]", " [chain]: lengths has 2 entries but links.mass has 3 entries"),
        ("centre = [0.25, 0.4]", "center = 1", " [links]: unknown key 'center'; did you mean 'centre'?"),
        (
            "inertia = [0.02, 0.006]",
            "inertia = -1",
            " [links]: inertia is -1; allowed: a number from 0 to 1e+150 kg m^2",
        ),
        (
            "centre = [0.25, 0.4]",
            "centre = [0.25, 1e7]",
            " [links]: centre, entry 2, is 10000000.0; allowed: no mass beyond",
        ),
        ("inertia = [0.02, 0.006]", "inertia = 1e20", " [links]: inertia, entry 1, is 1e+20; allowed: no mass beyond"),
        ("[0.5, 1]", "[0.5, 1]\nmass = 1", " [chain]: both mass and the table [links] are given; allowed: one of them"),
        ("[0.5, 1]", "[0.5, 1]\nmasses = [1, 2]", " [chain]: both masses and the table [links] are given"),
        (
            "gravity = 9.81",
            "rod_mass = 1",
            " [links]: both [links] and the effect rod_mass are given; allowed: one of them",
        ),
        ("lengths = [0.5, 1]", "", ": missing key 'lengths'"),
    ],
)
def test_a_wrong_file_is_one_line(loaded: Any, before: str, after: str, words: str) -> None:
    if after == "" and "lengths" in before:
        words = " [chain]: missing 'lengths', one for each link, or 'length', one number for all"
    with pytest.raises(InputError) as caught:
        loaded((before, after))
    assert str(caught.value).startswith(f"arm.toml{words}")


def test_a_link_whose_mass_is_in_its_joint_is_refused(loaded: Any) -> None:
    changes = ("centre = [0.25, 0.4]", "centre = [0.25, 0]"), ("[0.02, 0.006]", "[0.02, 0]")
    with pytest.raises(
        InputError, match=r"^arm.toml \[links\]: link 2 has its mass in its joint; allowed: a centre or"
    ):
        loaded(*changes)
    assert loaded(changes[0]).links is not None  # a flywheel is a link


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"masses": [1.0, 2.0]}, "both masses and links are given; allowed: one of them"),
        ({"effects": {"rod_mass": 1.0}}, "both links and the effect rod_mass are given; allowed: one of them"),
        ({"links": {"mass": 1.0}}, "links has no centre; allowed: mass, centre and inertia"),
        ({"links": {**EXAMPLE, "center": 1.0}}, "links: unknown key 'center'; did you mean 'centre'?"),
        ({"links": 3}, "links is 3; allowed: Links, or a mapping with mass, centre and inertia"),
        ({"links": {**EXAMPLE, "mass": [1.0]}}, "lengths has 2 entries but links.mass has 1 entry; allowed: one entry"),
        ({"links": {**EXAMPLE, "mass": [1.0, -1.0]}}, "links.mass, entry 2, is -1.0; allowed: a number from 1e-50 to"),
        ({"links": {**EXAMPLE, "mass": "heavy"}}, "links.mass is not a list of numbers"),
        ({"links": {**EXAMPLE, "centre": [0.0, 1.0], "inertia": 0.0}}, "link 1 has its mass in its joint; allowed: a"),
        ({"links": {**EXAMPLE, "centre": float("nan")}}, "links.centre, entry 1, is nan; allowed: a number from"),
    ],
)
def test_python_is_told_the_same(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as caught:
        arm(**changes)
    assert str(caught.value).startswith(f"scene 'arm': {words}")


def test_whatever_decides_the_motion_decides_the_digest() -> None:
    scenes = [arm(), arm(links=EXAMPLE), arm(masses=[1.2, 0.8], links=None)]
    scenes += [arm(links={**EXAMPLE, name: 0.1}) for name in EXAMPLE]
    assert len({scene.digest for scene in scenes}) == len(scenes)


def test_links_are_kept_by_copies_and_by_pickling() -> None:
    for other in (
        arm().with_start([1.0, 2.0], [0.0, 0.0]),
        pickle.loads(pickle.dumps(arm())),
        arm().without("gravity"),
    ):
        assert other.links is not None
        np.testing.assert_array_equal(other.links.centre, [0.25, 0.4])
        with pytest.raises(ValueError, match="read-only"):
            other.links.centre[0] = 1.0


def test_who_knows_point_masses_alone_refuses_them() -> None:
    assert tuple(arm().terms) == ("gravity", "links")
    for method in ("taylor", "rattle", "frame"):
        assert refusal(engine("analytic"), method, arm()) == f"method {method!r} has no links"
        run = simulate(arm(), "analytic", method, None if method == "taylor" else 1e-3, times=[0.1])
        assert (run.status, run.reason) == ("refused", f"method {method!r} has no links")
