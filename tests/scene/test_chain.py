"""Chains made and changed in one line of Python, and what is wrong with such a line."""

from __future__ import annotations

import numpy as np
import pytest

import pendbench as pb
from pendbench.effects import examples

LINKS = {"mass": 1.0, "centre": 0.2, "inertia": 0.01}


def test_a_chain_is_what_its_scene_file_says():
    bundled = pb.load_scene("chain50")
    made = pb.Scene.chain(
        n=50, length=bundled.lengths[0], mass=bundled.masses[0], angles=bundled.angles[0], gravity=9.81,
        duration=bundled.duration,
    )  # fmt: skip
    assert made.digest == bundled.digest


@pytest.mark.parametrize("effect", examples())
def test_any_effect_by_its_name(effect):
    value = examples()[effect]
    others = {"joint_stiffness": 1.0} if effect == "joint_rest" else {}  # which does nothing alone
    made = pb.Scene.chain(length=[0.5, 0.4], mass=1.0, angles=0.5, **{effect: value}, **others)
    assert effect in made.effects.named()
    plain = pb.Scene.chain(n=2, length=[0.5, 0.4], mass=1.0, angles=0.5, **others)
    assert plain.with_(**{effect: value}).digest == made.digest
    assert made.with_(**{effect: None}).digest == plain.digest


def test_numbers_are_meant_for_every_link_and_lists_for_each():
    made = pb.Scene.chain(length=0.5, mass=np.array([1.0, 2.0, 3.0]), angles=(0.1, 0.2, 0.3), rates=2)
    assert (made.n, made.name, made.title) == (3, "chain", "chain")
    np.testing.assert_array_equal(made.lengths, [0.5] * 3)
    np.testing.assert_array_equal(made.rates, [2.0] * 3)


def test_rigid_links():
    made = pb.Scene.chain(2, length=0.5, links=LINKS, angles=0.5, gravity=9.81)
    np.testing.assert_array_equal(made.links.centre, [0.2, 0.2])
    points = made.with_(links=None, masses=[1.0, 2.0])
    assert points.links is None
    assert points.with_(links=LINKS).digest == made.digest
    for changes in ({}, {"masses": None}):
        with pytest.raises(
            pb.InputError, match=r"^scene 'chain': without links it has no masses; allowed: links=None with"
        ):
            made.with_(links=None, **changes)


def test_a_changed_scene_differs_in_that_alone():
    scene = pb.load_scene("damped_double")
    changed = scene.with_(angles=0.25, duration=3.0, title="Other")
    np.testing.assert_array_equal(changed.angles, [0.25, 0.25])
    assert (changed.duration, changed.title, changed.name) == (3.0, "Other", scene.name)
    assert changed.effects == scene.effects
    assert changed.with_(angles=scene.angles, duration=scene.duration).digest == scene.digest
    three = pb.load_scene("double").with_(masses=[1.0, 1.0, 1.0], lengths=0.5, angles=0.0, rates=0.0)
    assert three.n == 3
    assert scene.with_(effects={"gravity": 1.0}, joint_damping=0.5).effects.named() == ("gravity", "joint_damping")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"n": None}, "n is None; allowed: a whole number from 1 to 1000000, or a list for each link"),
        ({"n": 0}, "n is 0; allowed: a whole number from 1 to 1000000"),
        ({"n": 1.5}, "n is 1.5; allowed: a whole number"),
        ({"n": True}, "n is true; allowed: a whole number"),
        ({"n": 10**12}, "n is 1000000000000; allowed: a whole number"),
        ({"length": [1.0]}, "n is 2 but lengths has 1 entry; allowed: one entry for each link"),
        ({"n": None, "length": [1.0, 2.0], "mass": [1.0]}, "masses has 1 entry but lengths has 2 entries"),
        ({"mass": None}, "neither mass nor links is given; allowed: one of them"),
        ({"links": LINKS}, "both masses and links are given; allowed: one of them"),
        ({"mass": "heavy"}, "masses is not a list of numbers"),
        ({"mass": {}}, "masses is not a list of numbers"),
        ({"mass": [1.0, [2.0]]}, "masses is not a list of numbers"),
        ({"mass": -1.0}, "masses, entry 1, is -1.0; allowed: "),
        ({"angles": float("nan")}, "angles, entry 1, is nan; allowed: "),
        ({"gravty": 9.81}, "unknown field or effect 'gravty'; did you mean 'gravity'?"),
        ({"gravity": "g"}, "gravity is 'g'; allowed: a number"),
        ({"duration": 0}, "duration is 0; allowed: "),
    ],
)
def test_what_a_chain_cannot_be_is_one_line(given, said):
    with pytest.raises(pb.InputError) as caught:
        pb.Scene.chain(**{"n": 2, "length": 0.5, "mass": 1.0, "angles": 0.5, **given})
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"mases": 1.0}, "scene 'double': unknown field or effect 'mases'; did you mean 'masses'?"),
        ({"masses": [1.0]}, "scene 'double': masses has 1 entry but lengths has 2 entries"),
        ({"joint_damping": [1.0, 2.0, 3.0]}, "scene 'double': joint_damping has 3 entries"),
        ({"joint_damping": -1.0}, "scene 'double': joint_damping is -1.0; allowed: "),
        ({"effects": 5}, "scene 'double': effects is 5; allowed: Effects"),
        ({"effects": {"gravty": 1}}, "scene 'double': effects: unknown effect 'gravty'"),
        ({"effects": 5, "gravity": 1.0}, "scene 'double': effects is 5; allowed: Effects"),
    ],
)
def test_what_cannot_be_changed_is_one_line(changes, said):
    with pytest.raises(pb.InputError) as caught:
        pb.load_scene("double").with_(**changes)
    assert str(caught.value).startswith(said)
