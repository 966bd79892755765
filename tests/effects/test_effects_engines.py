"""Effects in each engine: orders as claimed, drives that keep their time, and what MuJoCo's models hold."""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
import pytest

import pendbench as pb
from pendbench.base.errors import InputError, MissingEngineError
from pendbench.engines.mujoco import mjcf
from pendbench.engines.mujoco.adapter import MujocoEngine
from pendbench.engines.protocol import Engine, refusal
from pendbench.engines.registry import engine
from pendbench.scene.scene import Effects, Scene
from support.effect_sets import EFFECTS, GRAVITY, IN_GAUSS, SETS, USUAL, given, under
from support.scenes import chain

MUJOCO = MujocoEngine()
END = 0.5
TIMES = END / 5 * np.arange(1, 6)
#: How many steps show a method of that order in its limit, and above the rounding.
STEPS = {1: (250, 500, 1000), 2: (125, 250, 500), 4: (100, 200, 400)}
# Of the analytic engine: the others have their orders from the same tableaux, and longer to compile.
METHODS = {
    "analytic": ("rk4", "euler", "gauss4"),
    "mujoco": tuple(MUJOCO.methods),
    "pymunk": ("default", "tuned"),
    "pinocchio": ("rk4", "euler"),
}
FIXED = [(name, method) for name, methods in METHODS.items() for method in methods]


def swinging() -> Scene:
    """Two links on their way through the bottom: no mass comes to rest, where quadratic drag would not be smooth."""
    return chain(2, angle=[-0.5, -0.6], rate=2.0, length=[0.6, 0.5], mass=[1.0, 0.7])


def loaded(name: str) -> Engine:
    try:
        return engine(name)
    except MissingEngineError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize(
    ("name", "method", "which"),
    [(*fixed, which) for fixed in FIXED for which in (IN_GAUSS if "gauss4" in fixed else SETS)],
)
def test_order_with_effects_is_the_one_claimed(name: str, method: str, which: str) -> None:
    its, scene = loaded(name), under(SETS[which], swinging())
    if refusal(its, method, scene):
        pytest.skip("refused")
    exact = pb.simulate(scene, times=TIMES)
    claimed = min(its.effects[effect].orders.get(method, its.methods[method].order) for effect in scene.terms)
    errors = {"theta": [], "omega": []}
    for count in STEPS[claimed]:
        run = pb.simulate(scene, engine=its, method=method, dt=END / count, times=TIMES)
        assert run.status == "ok"
        for quantity, found in errors.items():
            found.append(np.abs(getattr(run, quantity) - getattr(exact, quantity)).max())
    for found in errors.values():
        assert abs(-np.polyfit(np.log(STEPS[claimed]), np.log(found), 1)[0] - claimed) < 0.2
        assert found[-1] < 0.02


@pytest.mark.parametrize(("name", "method"), FIXED)
def test_a_drive_keeps_its_time_between_calls(name: str, method: str) -> None:
    its, scene = loaded(name), under(SETS["all"], swinging())
    if refusal(its, method, scene):
        pytest.skip("refused")
    dt = 0.0073  # whose multiples are rounded
    once, often = (
        pb.simulate(scene, engine=its, method=method, dt=dt, times=t) for t in ([50 * dt], np.arange(1, 51) * dt)
    )
    np.testing.assert_array_equal(once.theta[-1], often.theta[-1])
    np.testing.assert_array_equal(once.omega[-1], often.omega[-1])


@pytest.mark.parametrize(("name", "method"), FIXED)
def test_a_run_that_drag_blows_up_is_a_fault_and_no_warning(name: str, method: str) -> None:
    its = loaded(name)
    scene = given(chain(3, rate=[30.0, -50.0, 20.0]), gravity=GRAVITY, air_drag={"quadratic": 500.0})
    run = pb.simulate(scene, engine=its, method=method, dt=0.1, times=0.1 * np.arange(1, 100))
    assert run.status in ("not finite", "not converged", "warned", "torn")


@pytest.mark.parametrize(("name", "method"), FIXED)
@pytest.mark.parametrize("rods", [[0.5, 0.4, 0.3], [0.0, 0.4, 0.3]], ids=["all rods", "one without"])
def test_masses_of_0_are_simulated_or_refused(name: str, method: str, rods: list[float]) -> None:
    """A rod alone, one with a point at its end, and one that has neither or is heavy; under all effects."""
    effects = Effects(**{**USUAL, "rod_mass": rods}).only(*SETS["all"])
    scene = Scene("rods", "", 1.0, [0.2, 0.0, 0.0], [0.5, 0.4, 0.3], [0.8, 0.6, 0.9], [0.5, 1.0, 0.0], effects)
    its = loaded(name)
    if refused := refusal(its, method, scene):
        assert (name, refused) == ("pymunk", "rods of which some have no mass")
        return
    exact = pb.simulate(scene, times=TIMES)
    run = pb.simulate(scene, engine=its, method=method, dt=END / 1000, times=TIMES)
    assert (exact.status, run.status) == ("ok", "ok")
    assert np.abs(run.theta - exact.theta).max() < {1: 0.01, 2: 1e-4, 4: 1e-9}[its.methods[method].order]


# MuJoCo's callback for passive forces, one for the whole process


def test_the_callback_is_there_only_while_a_run_advances() -> None:
    assert mujoco.get_mjcb_passive() is None
    for names in SETS.values():
        run = MUJOCO.build(under(names, swinging()), "rk4", 0.01)
        run.advance(2)
        assert mujoco.get_mjcb_passive() is None


@pytest.mark.parametrize("which", SETS)
def test_a_callback_of_the_user_is_kept_and_does_not_act(which: str) -> None:
    def push(model: mujoco.MjModel, data: mujoco.MjData) -> None:  # noqa: ARG001
        data.qfrc_passive[:] += 1.0

    scene = under(SETS[which], swinging())
    alone = pb.simulate(scene, engine=MUJOCO, method="rk4", dt=0.01, times=[END])
    mujoco.set_mjcb_passive(push)
    try:
        beside = pb.simulate(scene, engine=MUJOCO, method="rk4", dt=0.01, times=[END])
        assert mujoco.get_mjcb_passive() is push
    finally:
        mujoco.set_mjcb_passive(None)
    np.testing.assert_array_equal(alone.theta, beside.theta)


def test_runs_take_turns_without_taking_each_other_s_forces() -> None:
    scenes = [under(SETS[which], swinging()) for which in ("driven_pivot", "drive_torque", "air_drag")]
    runs = [MUJOCO.build(scene, "rk4", 0.01) for scene in scenes]
    for _ in range(10):
        for run in runs:
            run.advance(5)
    for run, scene in zip(runs, scenes, strict=True):
        alone = MUJOCO.build(scene, "rk4", 0.01)
        alone.advance(50)
        np.testing.assert_array_equal(run.state().theta, alone.state().theta)


# Files


def in_file() -> Scene:
    """All the effects that a file can hold."""
    each = {"joint_damping": [0.05, 0.1], "joint_stiffness": [0.0, 2.0], "rod_mass": [0.3, 0.0]}
    return given(swinging(), gravity=GRAVITY, **each, joint_rest=[0.0, 0.4], armature=[0.1, 0.2])


def test_a_file_with_effects_moves_as_the_built_model() -> None:
    scene = in_file()
    model, built = mujoco.MjModel.from_xml_string(mjcf.write_mjcf(scene)), mjcf.compile_chain(scene)
    # Whatever inertia a body has of its own comes on top of the least that MuJoCo accepts.
    np.testing.assert_allclose(model.body_inertia[1:], built.body_inertia[1:] + mjcf.INERTIA, rtol=1e-15)
    model.body_inertia[1:] = built.body_inertia[1:]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, nstep=500)
    run = MUJOCO.build(scene, "rk4", model.opt.timestep)
    run.advance(500)
    np.testing.assert_array_equal(np.cumsum(data.qpos), run.state().theta)
    exact = pb.simulate(scene, times=[500 * model.opt.timestep])
    np.testing.assert_allclose(np.cumsum(data.qpos), exact.theta[0], rtol=0, atol=1e-11)


def test_effects_in_a_file_matter() -> None:
    """The control of the test above: each of them moves the chain elsewhere."""
    scene = in_file()
    texts = {mjcf.write_mjcf(scene), *(mjcf.write_mjcf(scene.without(name)) for name in scene.terms)}
    assert len(texts) == 7
    for name in scene.terms:
        found, without = (
            pb.simulate(s, engine=MUJOCO, method="rk4", dt=0.01, times=[END]) for s in (scene, scene.without(name))
        )
        assert np.abs(found.theta - without.theta).max() > 1e-3


@pytest.mark.parametrize("effect", EFFECTS)
def test_what_a_file_cannot_hold_is_refused_in_one_line(effect: str) -> None:
    scene = dataclasses.replace(under(("gravity", effect), swinging()), name="two")
    if effect in ("joint_damping", "joint_stiffness", "joint_rest", "rod_mass", "armature"):
        assert mjcf.fits_file(scene)
        assert mjcf.write_mjcf(scene)
        return
    assert not mjcf.fits_file(scene)
    with pytest.raises(InputError) as caught:
        mjcf.write_mjcf(scene)
    assert str(caught.value) == f"scene 'two' calls for {effect}, which an MJCF file cannot hold"


def test_an_effect_of_nothing_but_zeros_fits_a_file() -> None:
    nothing = {"linear": 0.0}
    assert mjcf.fits_file(given(swinging(), gravity=GRAVITY, air_drag=nothing))
    still = {**USUAL["driven_pivot"], "amplitude": 0.0}
    plain = given(swinging(), gravity=GRAVITY)
    assert mjcf.write_mjcf(given(plain, gravity=GRAVITY, driven_pivot=still)) == mjcf.write_mjcf(plain)


def test_runs_in_threads_keep_their_forces_to_themselves() -> None:
    scenes = [under(SETS[which], swinging()) for which in ("driven_pivot", "drive_torque", "rod_mass", "air_drag")]

    def end(scene: Scene) -> np.ndarray:
        run = MUJOCO.build(scene, "rk4", 0.001)
        for _ in range(20):
            run.advance(50)
        return run.state().theta

    with ThreadPoolExecutor(len(scenes)) as threads:
        together = list(threads.map(end, scenes))
    for scene, theta in zip(scenes, together, strict=True):
        np.testing.assert_array_equal(theta, end(scene))
