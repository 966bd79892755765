"""What is special to the engines of the league. That they keep their promises is tested by the conformance kit."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys

import numpy as np
import pytest

import pendbench as pb
from pendbench.base.errors import MissingEngineError
from pendbench.engines import registry
from pendbench.engines.registry import engine, engine_names, only_by_name
from pendbench.engines.silence import silenced
from pendbench.physics.energy import energy, energy_scale
from pendbench.scene.scene import Effects, Scene, load_scene
from support.installed import installed_engines
from support.scenes import chain

#: The packages that the optional ones import.
PACKAGES = {
    "box2d": "pyb2d3",
    "dart": "dartpy",
    "drake": "pydrake",
    "exudyn": "exudyn",
    "mjx": "jax",
    "newton": "newton",
    "pybullet": "pybullet",
    "rapier": "rapier3d",
}
THERE = installed_engines()


def needs(name):
    return pytest.mark.skipif(name not in THERE, reason=f'needs pip install "pendbench[{name}]"')


def run(name, method, scene, dt, steps, **settings):
    made = engine(name).build(scene, method, dt, **settings)
    made.advance(steps)
    return made


@pytest.mark.parametrize("name", PACKAGES)
def test_without_its_package_the_message_is_the_command_that_brings_it(name, monkeypatch):
    inside = [module for module in sys.modules if module.startswith(f"{PACKAGES[name]}.")]
    for module in (PACKAGES[name], *inside):
        monkeypatch.setitem(sys.modules, module, None)  # importing it now fails as if it were not there
    for module in [module for module in sys.modules if module.startswith(f"pendbench.engines.{name}")]:
        monkeypatch.delitem(sys.modules, module)
    with pytest.raises(MissingEngineError) as caught:
        registry.engine(name)
    assert f'pip install --upgrade "pendbench[{name}]"' in str(caught.value)


def test_listing_engines_and_asking_which_run_unasked_loads_none():
    names = ", ".join(map(repr, PACKAGES.values()))
    code = f"""
        import sys
        from pendbench.engines.registry import engine_names, only_by_name
        assert [name for name in engine_names() if only_by_name(name)]
        assert not {{{names}}} & set(sys.modules)
    """
    subprocess.run([sys.executable, "-c", "\n".join(map(str.strip, code.splitlines()))], check=True)
    assert {name for name in engine_names() if only_by_name(name)} >= {*PACKAGES, "scipy", "xpbd"}


def test_what_is_silenced_writes_nothing_from_compiled_code_either(capfd):
    with silenced():
        print("from Python")
        subprocess.run(
            [sys.executable, "-c", "import os; os.write(1, b'outside'); os.write(2, b'outside')"], check=True
        )
    print("after")
    assert capfd.readouterr() == ("after\n", "")


# scipy


def test_the_default_tolerance_is_the_one_that_people_get_and_a_tight_one_is_another_thing():
    scene = chain(2, angle=[0.6, 0.9])
    ends = {}
    for method in ("rk45", "dop853", "lsoda", "radau", "tight"):
        made = engine("scipy").build(scene, method, None)
        made.advance_to(1.0)
        ends[method] = made.state().theta
    assert all(1e-6 < np.abs(ends[name] - ends["tight"]).max() < 0.1 for name in ("rk45", "dop853", "lsoda", "radau"))


@pytest.mark.parametrize("method", ["rk45", "dop853", "lsoda", "radau"])
def test_scipy_begins_where_nothing_moves_yet(method):
    """LSODA had made its first step a share of the time to go, and warned, and failed."""
    scene = load_scene("driven_triple")
    found = pb.simulate(scene, "scipy", method, None, [1.0], tolerance=1e-6)
    assert found.status == "ok"
    assert np.abs(found.theta - pb.reference(scene, [1.0]).theta).max() < 1e-3


def test_solve_ivp_gives_the_same():
    from scipy.integrate import solve_ivp

    from pendbench.physics.dense import accelerations

    scene = chain(2, angle=[0.6, 0.9])
    start = np.concatenate([scene.angles, scene.rates])
    found = solve_ivp(lambda _, y: [*y[2:], *accelerations(scene, y[:2], y[2:])], (0.0, 2.0), start, t_eval=[1.0])
    made = engine("scipy").build(scene, "rk45", None)
    made.advance_to(1.0)
    # The two equations differ in rounding alone.
    np.testing.assert_allclose(np.concatenate(made.state()[:2]), found.y[:, 0], rtol=0, atol=1e-12)


def test_the_polynomial_of_a_step_is_made_once_for_all_the_states_in_it(monkeypatch):
    from scipy.integrate import DOP853

    calls = []
    whole = DOP853._dense_output_impl
    monkeypatch.setattr(DOP853, "_dense_output_impl", lambda its: calls.append(its.t) or whole(its))
    times = np.linspace(0.0, 1.0, 201)
    run = pb.simulate(chain(2, angle=[0.6, 0.9]), "scipy", "dop853", None, times, tolerance=1e-6)
    assert 0 < len(calls) <= run.steps
    again = pb.simulate(chain(2, angle=[0.6, 0.9]), "scipy", "dop853", None, times[[0, 77]], tolerance=1e-6)
    np.testing.assert_array_equal(run.theta[77], again.theta[1])


def test_too_many_steps_are_a_status():
    made = engine("scipy").build(chain(1), "rk45", None, most_steps=5)
    assert made.advance_to(100.0) == 5
    assert made.health().status == "work limit"


# xpbd


def test_one_pass_over_the_rods_loses_energy_and_more_with_longer_steps():
    scene = chain(3, angle=0.9)
    lost = []
    for steps in (1000, 2000):
        end = run("xpbd", "small_steps", scene, 1.0 / steps, steps).state()
        lost.append(float(energy(scene, scene.angles, scene.rates) - energy(scene, end.theta, end.omega)))
    assert 0.0 < lost[1] < lost[0]
    assert lost[0] / lost[1] == pytest.approx(2.0, rel=0.1)  # of order 1


def test_rods_hold_where_they_are_iterated_and_give_where_they_are_not():
    scene = chain(5, angle=0.9)
    assert run("xpbd", "iterated", scene, 1e-3, 200).state().gap < 1e-13
    assert run("xpbd", "small_steps", scene, 1e-3, 200).state().gap > 1e-8


def test_too_few_iterations_are_a_status():
    assert run("xpbd", "iterated", chain(5, angle=0.9), 1e-2, 10, iterations=1).health().status == "not converged"


def test_turns_are_counted():
    spun = run("xpbd", "second_order", chain(1, rate=20.0, gravity=None), 1e-4, 10_000).state()
    assert spun.theta[0] == pytest.approx(chain(1).angles[0] + 20.0, abs=1e-2)


# Engines with packages of their own


@needs("box2d")
def test_rigid_joints_of_box2d_are_springs_of_60_hz_and_springs_are_stiffer():
    scene = chain(1, angle=0.0, length=1.0)
    stretched = 9.81 / (2.0 * math.pi * 60.0) ** 2
    assert run("box2d", "default", scene, 1e-3, 2000).state().gap == pytest.approx(stretched, rel=0.05)  # measured: 3 %
    assert run("box2d", "stiff", scene, 1e-3, 2000).state().gap < 0.02 * stretched


@needs("pybullet")
def test_pybullet_writes_nothing_to_the_terminal():
    code = "from pendbench.engines.registry import engine; engine('pybullet').version()"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
    assert (done.stdout, done.stderr) == (b"", b"")


@needs("dart")
def test_dart_writes_nothing_to_the_terminal_about_points(capfd):
    run("dart", "euler", chain(2), 1e-3, 1)
    assert capfd.readouterr() == ("", "")


@needs("rapier")
def test_a_free_link_of_rapier_keeps_turning():
    """The damping that it gives every joint of a multibody would leave 3 % of the rate."""
    scene = chain(1, rate=1.0, gravity=None)
    assert run("rapier", "multibody", scene, 1e-3, 1000).state().omega[0] == pytest.approx(1.0, abs=1e-4)


@needs("pybullet")
def test_a_free_link_of_pybullet_keeps_turning_unless_its_damping_stays_on():
    """Damping of 0.04 of the rate a second, of the body and of its turning: exp(-0.08) of it is left, 0.923."""
    scene = chain(1, rate=1.0, gravity=None)
    kept, damped = [
        run("pybullet", "multibody", scene, 1e-3, 1000, default_flags=flags).state().omega[0] for flags in (0, 1)
    ]
    assert kept == pytest.approx(1.0, abs=1e-9)
    assert damped == pytest.approx(math.exp(-0.08), abs=0.01)


@needs("drake")
def test_a_discrete_plant_takes_as_many_steps_as_are_asked_for():
    """Semi-implicit Euler from rest: after k steps the angle has fallen by k (k + 1) / 2 times the first fall."""
    scene = chain(1, angle=1e-6)
    for dt in (0.1e-3, 1.0 / 3000.0):
        fall = 1e-6 - run("drake", "discrete", scene, dt, 1).state().theta[0]
        gone = 1e-6 - run("drake", "discrete", scene, dt, 7).state().theta[0]
        assert gone / fall == pytest.approx(28.0, rel=1e-3)


@needs("newton")
def test_the_two_solvers_of_newton_are_the_same_method_and_no_damping_is_on():
    scene = chain(2, angle=[0.3, 0.4])
    ends = [run("newton", method, scene, 1 / 256, 256).state().theta for method in ("featherstone", "steel")]
    assert np.abs(ends[0] - ends[1]).max() < 1e-5  # single precision
    euler = run("mujoco", "euler", scene, 1 / 256, 256).state().theta
    assert np.abs(ends[0] - euler).max() < 5e-4  # the plateau


@needs("newton")
def test_kernels_of_others_keep_their_derivatives():
    import warp

    run("newton", "featherstone", chain(1), 1e-2, 1)
    assert warp.config.enable_backward


@needs("pybullet")
def test_pybullets_motors_hold_a_chain_as_it_comes_but_not_a_heavy_one():
    """A motor gives at most 1 N m s in a step: at 1/240 s it holds 240 N m, so 24 kg at 1 m under 10 m/s^2."""
    turned = []
    for mass in (23.0, 30.0):
        scene = Scene.chain(n=1, length=1.0, mass=mass, angles=math.pi / 2, gravity=10.0)
        moved = [run("pybullet", "multibody", scene, 1 / 240, 60, default_flags=flags).state() for flags in (1, 2)]
        turned.append([abs(each.theta[0] - math.pi / 2) for each in moved])
    free, held = np.transpose(turned)
    assert free == pytest.approx(free[0])  # the motors are off: it falls, whatever it weighs
    assert free[0] > 0.2
    assert held[0] < 1e-3
    assert held[1] > 1e-2


@needs("exudyn")
def test_exudyn_is_as_good_as_the_tolerance_and_goes_on_from_where_it_was():
    scene = load_scene("challenge")  # a first step of all of an advance would be lost
    times = np.linspace(0.0, 1.0, 21)
    truth = pb.reference(scene, times).theta
    errors = [
        np.abs(pb.simulate(scene, "exudyn", "dopri5", None, times, tolerance=tolerance).theta - truth).max()
        for tolerance in (1e-6, 1e-9)
    ]
    assert errors[0] < 1e-2
    assert errors[1] < errors[0] / 100.0  # a thousandth, of which rounding leaves some


@needs("exudyn")
def test_exudyn_evaluates_a_drive_at_its_time():
    """A torque of sin(2 pi t) on a link without weight turns it by t - sin(2 pi t) / 2 pi over 2 pi I, after t s."""
    drive = {"joint": 1, "amplitude": 1.0, "angular_frequency": 2.0 * math.pi, "phase": 0.0}
    driven = dataclasses.replace(chain(1, angle=0.0), effects=Effects(drive_torque=drive))
    found = run("exudyn", "rk4", driven, 1e-2, 100).state().theta[0]
    assert found == pytest.approx(1.0 / (2.0 * math.pi), rel=1e-6)
    found = pb.simulate(driven, "exudyn", "dopri5", None, [0.2, 0.3, 0.7, 1.0]).theta[-1, 0]  # in four calls of Exudyn
    assert found == pytest.approx(1.0 / (2.0 * math.pi), rel=1e-6)


@needs("exudyn")
@pytest.mark.parametrize("method", ["generalized_alpha", "trapezoidal"])
def test_exudyn_begins_a_step_again_where_it_began(method):
    """Near 0.08 s Newton's method needs a second start: from the step's beginning, and not from that of the run."""
    rope = pb.Scene.chain(n=100, length=0.01, mass=0.01, gravity=9.81, angles=np.pi / 2, duration=0.1)
    found = run("exudyn", method, rope, 1e-3, 100).state()
    truth = pb.simulate(rope, "analytic", "adaptive", None, [0.1])
    assert np.abs(found.theta - truth.theta[-1]).max() < 2e-3  # 1.2e-3 rad, and a quarter with half of the step


@needs("exudyn")
def test_exudyn_keeps_a_step_cut_from_call_to_call():
    """Cut anew in each step, this chain gained 1e8 times its scale of energy in 10 s; measured: 0.09 of it at most."""
    scene = load_scene("chain10")
    found = pb.simulate(scene, "exudyn", "generalized_alpha", 0.05, 0.05 * np.arange(201))
    assert found.status == "ok"
    values = energy(scene, found.theta, found.omega)
    assert np.abs(values - values[0]).max() < 0.2 * energy_scale(scene)


@needs("mjx")
def test_mjx_goes_on_where_xla_does_not_know_what_it_is_told(monkeypatch):
    from pendbench.engines import mjx

    assert mjx._options() == mjx._UNREPEATED
    monkeypatch.setattr(mjx, "_UNREPEATED", {"xla_no_such_option": True})
    assert mjx._options() == {}


@needs("exudyn")
@pytest.mark.parametrize("method", ["generalized_alpha", "rk4", "euler"])
def test_exudyn_counts_time_in_steps_whatever_is_asked_for_at_once(method):
    drive = {"joint": 1, "amplitude": 2.0, "angular_frequency": 6.0, "phase": 0.3}
    driven = dataclasses.replace(load_scene("chain10"), effects=Effects(gravity=9.81, drive_torque=drive))
    dt = 0.0013  # whose multiples are rounded
    once, often = (pb.simulate(driven, "exudyn", method, dt, times) for times in ([40 * dt], dt * np.arange(1, 41)))
    np.testing.assert_array_equal(once.theta[-1], often.theta[-1])
    np.testing.assert_array_equal(once.omega[-1], often.omega[-1])


@needs("exudyn")
def test_exudyn_takes_every_step_however_short():
    falling = run("exudyn", "rk4", chain(1, angle=math.pi / 2), 1e-13, 1000).state()
    assert falling.omega[0] == pytest.approx(-9.81e-10, rel=1e-3)


@needs("exudyn")
def test_exudyn_s_error_has_a_scale_where_a_coordinate_is_minus_one():
    """With equal tolerances it is 0 there: 3.9e-4 rad, against 4e-10 beside it."""
    rope = Scene.chain(n=60, length=0.005, mass=1.0, gravity=9.81, angles=0.5, rates=-1.0)
    found = pb.simulate(rope, "exudyn", "dopri5", None, [0.01])
    truth = pb.reference(rope, [0.01])
    assert np.abs(found.theta - truth.theta).max() < 1e-7


@needs("exudyn")
@pytest.mark.parametrize(("method", "dt"), [("rk4", 1e-3), ("generalized_alpha", 1e-3), ("dopri5", None)])
def test_a_run_of_exudyn_that_was_interrupted_is_not_well(method, dt, monkeypatch):
    from pendbench.engines.exudyn import tree

    def interrupted(*_):
        raise KeyboardInterrupt

    damped = dataclasses.replace(chain(2), effects=Effects(gravity=9.81, joint_damping=0.1))
    made = engine("exudyn").build(damped, method, dt)
    monkeypatch.setattr(tree, "torques_in_joints", interrupted)
    with pytest.raises(KeyboardInterrupt):
        made.advance(10) if dt else made.advance_to(0.1)
    assert made.health() is not None
