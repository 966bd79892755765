"""Effects as values, what is refused in one line, and that an effect left out leaves nothing behind."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pendbench as pb
from pendbench.base.errors import InputError, MissingEngineError
from pendbench.effects import names
from pendbench.engines.analytic.adapter import AnalyticEngine
from pendbench.engines.protocol import refusal
from pendbench.engines.registry import engine
from pendbench.physics.kernels.system import LinkSystem, RotorSystem, System, system_of
from pendbench.scene.links import LINKS
from pendbench.scene.scene import Effects, Scene, load_scene
from pendbench.truth.reference import reference
from support.effect_sets import EFFECTS, GRAVITY, IN_GAUSS, SETS, USUAL, given, under
from support.scenes import chain

PER_JOINT = "or a list with one for each joint"
UP_TO = "allowed: a number from 0 to 1e+50"
PIVOT = {"axis": "x", "amplitude": 0.1, "angular_frequency": 3.0}
MOTOR = {"joint": 1, "amplitude": 0.1, "angular_frequency": 3.0}
NOTHING: dict[str, Any] = {
    "joint_damping": 0.0,
    "joint_stiffness": [0.0, 0.0, 0.0],
    "joint_rest": 1.0,
    "joint_torque": [0.0, 0.0, 0.0],
    "air_drag": {"linear": 0.0, "quadratic": 0.0},
    "rod_mass": 0,
    "driven_pivot": {**PIVOT, "amplitude": 0.0},
    "drive_torque": {**MOTOR, "amplitude": 0.0},
    "armature": [0.0, 0.0, 0.0],
}
TINY: dict[str, Any] = {
    "joint_damping": 1e-30,
    "joint_stiffness": 1e-30,
    "joint_rest": 1.0,
    "joint_torque": 1e-30,
    "air_drag": {"linear": 1e-30, "quadratic": 1e-30},
    "rod_mass": 1e-30,
    "driven_pivot": {**PIVOT, "amplitude": 1e-30},
    "drive_torque": {**MOTOR, "amplitude": 1e-30},
    "armature": 1e-30,
}

# Effect, value from Python, the same in TOML where it can be written there, and what is said of it.
WRONG: list[tuple[str, Any, str | None, str]] = [
    ("joint_damping", -1.0, "-1.0", f"joint_damping is -1.0; {UP_TO} N m s/rad, {PER_JOINT}"),
    ("joint_damping", math.nan, "nan", f"joint_damping is nan; {UP_TO} N m s/rad, {PER_JOINT}"),
    ("joint_damping", math.inf, "inf", f"joint_damping is inf; {UP_TO} N m s/rad, {PER_JOINT}"),
    ("joint_damping", True, "true", f"joint_damping is true; {UP_TO} N m s/rad, {PER_JOINT}"),
    ("joint_damping", "1", "'1'", f"joint_damping is '1'; {UP_TO} N m s/rad, {PER_JOINT}"),
    ("joint_damping", [], "[]", f"joint_damping is an empty list; {UP_TO} N m s/rad, {PER_JOINT}"),
    ("joint_damping", {"a": 1}, "{a = 1}", f"joint_damping is a table; {UP_TO} N m s/rad, {PER_JOINT}"),
    ("joint_damping", 1j, None, f"joint_damping is 1j; {UP_TO} N m s/rad, {PER_JOINT}"),
    ("joint_damping", [1.0, -1.0], "[1.0, -1.0]", f"entry 2 is -1.0; {UP_TO} N m s/rad"),
    ("joint_damping", [math.nan, 1.0], "[nan, 1.0]", f"entry 1 is nan; {UP_TO} N m s/rad"),
    ("joint_damping", [1.0, False], "[1.0, false]", f"entry 2 is false; {UP_TO} N m s/rad"),
    ("joint_damping", [[1.0, 2.0]], "[[1.0, 2.0]]", f"entry 1 is a list of 2; {UP_TO} N m s/rad"),
    ("joint_damping", np.ones((2, 2)), None, f"entry 1 is a list of 2; {UP_TO} N m s/rad"),
    (
        "joint_damping",
        [1.0],
        "[1.0]",
        "joint_damping has 1 entry; allowed: one number, or one for each of the 2 joints",
    ),
    (
        "joint_stiffness",
        [1, 2, 3],
        "[1, 2, 3]",
        "joint_stiffness has 3 entries; allowed: one number, or one for each of",
    ),
    ("joint_stiffness", -2, "-2", f"joint_stiffness is -2; {UP_TO} N m/rad, {PER_JOINT}"),
    (
        "joint_torque",
        math.inf,
        "inf",
        "joint_torque is inf; allowed: a number from -1e+50 to 1e+50 N m, or a list with",
    ),
    ("joint_torque", [1.0], "[1.0]", "joint_torque has 1 entry; allowed: one number, or one for each of the 2 joints"),
    ("joint_rest", "1", "'1'", "joint_rest is '1'; allowed: a number from -1e+09 to 1e+09 rad, or a list with one for"),
    (
        "joint_rest",
        0.5,
        "0.5",
        "joint_rest does nothing without joint_stiffness; allowed: joint_rest beside joint_stif",
    ),
    ("rod_mass", [1, 2, 3], "[1, 2, 3]", "rod_mass has 3 entries; allowed: one number, or one for each of the 2 rods"),
    ("rod_mass", -0.1, "-0.1", f"rod_mass is -0.1; {UP_TO} kg, or a list with one for each rod"),
    ("rod_mass", 1e51, "1e51", f"rod_mass is 1e+51; {UP_TO} kg, or a list with one for each rod"),
    ("armature", -1, "-1", f"armature is -1; {UP_TO} kg m^2, {PER_JOINT}"),
    (
        "armature",
        [1, 2, 3],
        "[1, 2, 3]",
        "armature has 3 entries; allowed: one number, or one for each of the 2 joints",
    ),
    ("air_drag", 0.1, "0.1", "air_drag is 0.1; allowed: a table of linear, quadratic"),
    ("air_drag", [0.1], "[0.1]", "air_drag is a list of 1; allowed: a table of linear, quadratic"),
    ("air_drag", {}, "{}", "an empty table; allowed: linear, quadratic"),
    ("air_drag", {"linear": -0.1}, "{linear = -0.1}", f"linear is -0.1; {UP_TO} kg/s, or a list with one for"),
    ("air_drag", {"quadratic": math.nan}, "{quadratic = nan}", f"quadratic is nan; {UP_TO} kg/m, or a list with one f"),
    ("air_drag", {"quadratic": True}, "{quadratic = true}", f"quadratic is true; {UP_TO} kg/m"),
    (
        "air_drag",
        {"linear": [1]},
        "{linear = [1]}",
        "air_drag: linear has 1 entry; allowed: one number, or one for each of",
    ),
    ("air_drag", {"linear": [1, -1]}, "{linear = [1, -1]}", f"linear: entry 2 is -1; {UP_TO} kg/s"),
    ("air_drag", {"lineer": 1}, "{lineer = 1}", "unknown key 'lineer'; did you mean 'linear'? allowed: linear, "),
    ("air_drag", {1: 2}, None, "unknown key '1'; allowed: linear, quadratic"),
    ("driven_pivot", "x", "'x'", "driven_pivot is 'x'; allowed: a table of axis, amplitude, angular_frequency"),
    ("driven_pivot", {}, "{}", "an empty table; allowed: axis, amplitude, angular_frequency"),
    (
        "driven_pivot",
        {**PIVOT, "axis": "z"},
        "{axis = 'z', amplitude = 1, angular_frequency = 1}",
        "axis is 'z'; allow",
    ),
    ("driven_pivot", {**PIVOT, "axis": 1}, "{axis = 1, amplitude = 1, angular_frequency = 1}", 'allowed: "x" or "y"'),
    ("driven_pivot", {"axis": "x", "amplitude": 1}, "{axis = 'x', amplitude = 1}", "missing key 'angular_frequency'"),
    (
        "driven_pivot",
        {**PIVOT, "angular_frequency": 0},
        "{axis = 'x', amplitude = 1, angular_frequency = 0}",
        "angular_frequency is 0; allowed: a number from 1e-50 to 1e+50 rad/s",
    ),
    (
        "driven_pivot",
        {**PIVOT, "amplitude": math.inf},
        "{axis = 'x', amplitude = inf, angular_frequency = 1}",
        "amplitude is inf; allowed: a number from -1e+50 to 1e+50 m",
    ),
    (
        "driven_pivot",
        {**PIVOT, "phase": "pi"},
        "{axis = 'x', amplitude = 1, angular_frequency = 1, phase = 'pi'}",
        "phase is 'pi'; allowed: a number from -1e+09 to 1e+09 rad",
    ),
    (
        "driven_pivot",
        {**PIVOT, "frequency": 1},
        "{axis = 'x', amplitude = 1, frequency = 1}",
        "unknown key 'frequency'; did you mean 'angular_frequency'? ",
    ),
    (
        "drive_torque",
        {**MOTOR, "joint": 3},
        "{joint = 3, amplitude = 1, angular_frequency = 1}",
        "drive_torque: joint is 3; allowed: 1 to 2, the joints of the chain",
    ),
    (
        "drive_torque",
        {**MOTOR, "joint": 0},
        "{joint = 0, amplitude = 1, angular_frequency = 1}",
        "joint is 0; allowed: a whole number from 1 on",
    ),
    (
        "drive_torque",
        {**MOTOR, "joint": 1.5},
        "{joint = 1.5, amplitude = 1, angular_frequency = 1}",
        "joint is 1.5; allowed: a whole number from 1 on",
    ),
    (
        "drive_torque",
        {**MOTOR, "joint": True},
        "{joint = true, amplitude = 1, angular_frequency = 1}",
        "joint is true; allowed: a whole number from 1 on",
    ),
    (
        "drive_torque",
        {**MOTOR, "amplitude": "1"},
        "{joint = 1, amplitude = '1', angular_frequency = 1}",
        "amplitude is '1'; allowed: a number from -1e+50 to 1e+50 N m",
    ),
    (
        "drive_torque",
        {**MOTOR, "angular_frequency": -1.0},
        "{joint = 1, amplitude = 1, angular_frequency = -1.0}",
        "angular_frequency is -1.0; allowed: a number from 1e-50 to 1e+50 rad/s",
    ),
    ("drive_torque", {"joint": 1, "amplitude": 1}, "{joint = 1, amplitude = 1}", "missing key 'angular_frequency'"),
]


def complaint(make: Any, *arguments: Any, **named: Any) -> str:
    with pytest.raises(InputError) as caught:
        make(*arguments, **named)
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 400
    return message


def two(**effects: Any) -> Scene:
    return Scene("two", "", 1.0, [1.0, 0.5], [1.0, 0.7], [0.3, 0.4], [0.0, 0.0], Effects(**effects))


def three() -> Scene:
    return chain(3, angle=[0.5, 1.2, -0.3], rate=[1.0, -0.5, 2.0], length=[0.5, 0.3, 0.4], mass=[1.0, 0.5, 0.8])


def load(text: str) -> Scene:
    top = "duration = 1\n[chain]\nmasses = [1.0, 0.5]\nlengths = [1.0, 0.7]\n[start]\nangles = [0.3, 0.4]\n"
    Path("two.toml").write_text(top + text)
    return load_scene("two.toml")


# Values


@pytest.mark.parametrize(("effect", "value", "words"), [(e, value, words) for e, value, _, words in WRONG])
def test_a_wrong_value_from_python_is_one_line(effect: str, value: Any, words: str) -> None:
    message = complaint(two, **{effect: value})
    assert words in message
    assert message.removeprefix("scene 'two': ").startswith(effect)


@pytest.mark.parametrize(("effect", "text", "words"), [(e, text, words) for e, _, text, words in WRONG if text])
def test_a_wrong_value_in_a_file_is_one_line_that_names_the_file(
    effect: str, text: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    message = complaint(load, f"[effects]\n{effect} = {text}")
    assert message.startswith("two.toml [effects")
    assert words in message
    assert effect in message


def test_an_unknown_effect_in_a_file_lists_those_there_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    message = complaint(load, "[effects]\njoint_dampng = 1")
    assert message == (
        "two.toml [effects]: unknown effect 'joint_dampng'; did you mean 'joint_damping'? "
        f"allowed: {', '.join(sorted(names()))}"
    )


def test_a_file_and_python_make_the_same_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = load(
        "[effects]\ngravity = 9.81\njoint_damping = 0.05\njoint_stiffness = [2, 0]\nrod_mass = [0.1, 0.2]\n"
        "joint_rest = [0.5, 0.1]\njoint_torque = 0.2\n"
        "armature = 0.1\n"
        "air_drag = {linear = 0.1}\ndriven_pivot = {axis = 'x', amplitude = 0.1, angular_frequency = 3}\n"
        "[effects.drive_torque]\njoint = 2\namplitude = 0.5\nangular_frequency = 3\n"
    )
    expected = two(
        gravity=9.81,
        joint_damping=0.05,
        joint_stiffness=np.array([2.0, 0.0]),
        joint_rest=[0.5, 0.1],
        joint_torque=0.2,
        rod_mass=(0.1, 0.2),
        armature=0.1,
        air_drag={"linear": 0.1},
        driven_pivot=PIVOT,
        drive_torque={"joint": 2, "amplitude": 0.5, "angular_frequency": 3},
    )
    assert found.effects == expected.effects
    assert found.effects.air_drag.quadratic == 0.0
    assert found.digest == expected.digest
    assert tuple(found.terms) == names() == found.effects.named()


def test_effects_compare_and_hash_by_their_values() -> None:
    for name, value in USUAL.items():
        first, same = Effects(**{name: value}), Effects(**{name: value})
        assert first == same
        assert hash(first) == hash(same)
        assert first != Effects()
    each, again = Effects(rod_mass=[1, 2]), Effects(rod_mass=np.array([1.0, 2.0]))
    assert (each, hash(each)) == (again, hash(again))
    assert each != Effects(rod_mass=[2, 1])


def test_each_effect_is_in_the_digest() -> None:
    scenes = [two(), *(under((name,), two()) for name in USUAL)]
    scenes += [two(rod_mass=[0.3, 0.4]), two(rod_mass=[0.4, 0.3])]
    scenes += [
        two(driven_pivot={**PIVOT, **change})
        for change in ({}, {"axis": "y"}, {"angular_frequency": 3.5}, {"phase": 1.0})
    ]
    scenes += [two(air_drag={"linear": 0.1}), two(air_drag={"quadratic": 0.1})]
    assert len({scene.digest for scene in scenes}) == len(scenes)
    assert two(joint_damping=1).digest == two(joint_damping=np.float64(1.0)).digest


def test_terms_hold_one_number_for_each_joint() -> None:
    terms = two(joint_damping=0.5, joint_stiffness=[1, 2], drive_torque={**MOTOR, "joint": 2}).terms
    np.testing.assert_array_equal(terms["joint_damping"].damping, [0.5, 0.5])
    np.testing.assert_array_equal(terms["joint_stiffness"].stiffness, [1.0, 2.0])
    np.testing.assert_array_equal(terms["drive_torque"].amplitudes, [0.0, 0.1])


def test_what_modifies_an_effect_comes_and_goes_with_it() -> None:
    scene = two(gravity=9.81, joint_stiffness=2.0, joint_rest=0.3)
    assert scene.without("joint_stiffness").effects == Effects(gravity=9.81)
    assert scene.without("joint_rest").effects == Effects(gravity=9.81, joint_stiffness=2.0)
    assert scene.effects.only("joint_rest") == Effects(joint_stiffness=2.0, joint_rest=0.3)


# Absence


def test_a_plain_chain_is_compiled_for_nothing_else() -> None:
    plain = system_of(three())
    assert isinstance(plain, System)
    assert plain.pivots == plain.joints == plain.drags == ()
    called = ("joint_damping", "rod_mass", "armature")
    forced, heavy, geared = (system_of(under(("gravity", name), three())) for name in called)
    assert isinstance(forced, System)
    assert isinstance(heavy, LinkSystem)
    assert isinstance(geared, RotorSystem)
    assert plain.scratch.shape[0] < forced.scratch.shape[0]


@pytest.mark.parametrize(
    ("effect", "held"),
    [
        ("joint_damping", ["joints"]),
        ("joint_stiffness", ["joints"]),
        ("joint_rest", ["joints"]),
        ("joint_torque", ["joints"]),
        ("air_drag", ["drags"]),
        ("rod_mass", []),
        ("driven_pivot", ["pivots"]),
        ("drive_torque", ["joints"]),
        ("armature", []),
    ],
)
def test_a_system_holds_what_its_scene_calls_for(effect: str, held: list[str]) -> None:
    system = system_of(under(SETS[effect], three()))
    system = system.chain if isinstance(system, RotorSystem) else system
    assert [name for name in ("pivots", "joints", "drags") if getattr(system, name)] == held
    assert all(len(getattr(system, name)) == 1 for name in held)


def test_all_numbers_zero_is_no_effect() -> None:
    assert set(NOTHING) == set(EFFECTS)
    nothing, plain = given(three(), gravity=GRAVITY, **NOTHING), three()
    assert nothing.effects.named() == names()
    assert tuple(nothing.terms) == ("gravity",)
    system = system_of(nothing)
    assert isinstance(system, System)
    assert system.pivots == system.joints == system.drags == ()
    for method, dt in (("adaptive", None), ("rk4", 0.01), ("gauss4", 0.01)):
        runs = [pb.simulate(scene, method=method, dt=dt, times=[0.5, 1.0]) for scene in (plain, nothing)]
        np.testing.assert_array_equal(runs[0].theta, runs[1].theta)
        np.testing.assert_array_equal(runs[0].omega, runs[1].omega)


@pytest.mark.parametrize("which", SETS)
def test_next_to_nothing_moves_as_nothing_does(which: str) -> None:
    """An effect's own kernel, with a coefficient that is lost in the first sum."""
    values = {name: GRAVITY if name == "gravity" else TINY[name] for name in SETS[which]}
    tiny, plain = given(three(), **values), three()
    assert len(tiny.terms) == len(values)
    for method in ("rk4", "gauss4") if which in IN_GAUSS else ("rk4",):
        found, expected = (pb.simulate(scene, method=method, dt=0.01, times=[1.0]) for scene in (tiny, plain))
        # Measured: the same bits, but 6e-15 for rods with mass and for rotors, whose recursions are others.
        np.testing.assert_allclose(found.theta, expected.theta, rtol=0, atol=1e-13)
        np.testing.assert_allclose(found.omega, expected.omega, rtol=0, atol=1e-13)


@pytest.mark.parametrize("which", SETS)
def test_every_effect_shows(which: str) -> None:
    """The control of the test above."""
    found, plain = (
        pb.simulate(scene, method="rk4", dt=0.01, times=[1.0]) for scene in (under(SETS[which], three()), three())
    )
    assert np.abs(found.theta - plain.theta).max() > 1e-3


# Refusals


PLAIN = ["taylor", "rattle", "adaptive_rattle", "frame", "bdf2", "energy_momentum", "implicit_euler"]


@pytest.mark.parametrize("method", PLAIN)
@pytest.mark.parametrize("effect", EFFECTS)
def test_methods_for_plain_chains_refuse_effects(method: str, effect: str) -> None:
    dt = None if method == "taylor" else 0.01
    refused = pb.simulate(under(("gravity", effect), three()), method=method, dt=dt, times=[0.1])
    first = "joint_stiffness" if effect == "joint_rest" else effect
    assert (refused.status, refused.reason) == ("refused", f"method {method!r} has no {first}")
    assert refusal(AnalyticEngine(), method, three()) is None


@pytest.mark.parametrize("name", ["analytic", "mujoco", "pymunk", "pinocchio", "heyoka"])
def test_an_engine_refuses_the_effects_that_its_adapter_says_it_refuses(name: str) -> None:
    try:
        its = engine(name)
    except MissingEngineError as error:
        pytest.skip(str(error))
    assert set(its.effects) <= {*names(), LINKS}
    method = next(iter(its.methods))
    for effect in EFFECTS:
        scene = under(("gravity", effect), three())
        if effect in its.effects and not its.effects[effect].refused:
            assert refusal(its, method, scene) is None
            continue
        dt = None if its.methods[method].adaptive else 0.01
        refused = pb.simulate(scene, engine=its, method=method, dt=dt, times=[0.1])
        assert refused.status == "refused"
        assert any(f"no {name}" in refused.reason for name in scene.terms)


def test_heyoka_knows_gravity_alone() -> None:
    its = pytest.importorskip("pendbench.engines.heyoka").HeyokaEngine()
    assert all(refusal(its, "taylor", under(("gravity", effect), three())) for effect in EFFECTS)
    assert refusal(its, "taylor", three()) is None


def test_what_acts_on_a_scene_cannot_be_changed_behind_its_back() -> None:
    scene = two(joint_damping=0.3, drive_torque=MOTOR)
    with pytest.raises(TypeError):
        scene.terms["joint_damping"] = None  # type: ignore[index]
    for name, field in (("joint_damping", "damping"), ("drive_torque", "amplitudes")):
        with pytest.raises(ValueError, match="read-only"):
            getattr(scene.terms[name], field)[0] = 5.0


def test_the_reference_takes_long_chains_with_effects() -> None:
    scene = dataclasses.replace(chain(300, duration=1.0), effects=Effects(gravity=9.81, joint_damping=1e-3))
    found = reference(scene, [1e-6, 1e-3])
    assert (found.status, found.reason, found.horizon) == ("ok", "", 1e-3)
