"""The analytic engine: what its methods promise, on chains whose motion is known."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

import pendbench as pb
from pendbench.engines.analytic.adapter import AnalyticEngine
from pendbench.engines.analytic.runs import _unforced
from pendbench.physics.energy import energy, energy_scale
from pendbench.physics.geometry import distance
from pendbench.physics.kernels.table import system_of
from pendbench.scene.scene import Effects, Scene
from support.effect_sets import SETS, under
from support.scenes import chain, random_chain
from support.systems import order

ENGINE = AnalyticEngine()
ACCURATE = [name for name, method in ENGINE.methods.items() if method.adaptive]
FIXED = [name for name, method in ENGINE.methods.items() if not method.adaptive]
#: Reversible, but for a part of its speeds, of that order, which rates do not say.
NEARLY_REVERSIBLE = {"energy_momentum": 4}
REVERSIBLE = {"gauss4": 1e-12, "gauss6": 1e-12, "rattle": 1e-10, "frame": 1e-10}


def after(scene, method, dt, steps):
    """The state after that many steps."""
    run = ENGINE.build(scene, method, dt)
    run.advance(steps)
    assert run.health() is None
    return run.state()


def drift(scene, run):
    found = energy(scene, run.theta, run.omega)
    return np.abs(found - found[0]).max() / energy_scale(scene)


@pytest.mark.parametrize("method", ACCURATE)
@pytest.mark.parametrize("name", ["double", "triple", "chain5", "chain10"])
def test_adaptive_methods_keep_the_energy(name, method):
    scene = pb.load_scene(name)
    run = pb.simulate(scene, engine="analytic", method=method)
    assert (run.status, run.t[-1]) == ("ok", 10.0)
    assert drift(scene, run) < 1e-12


@pytest.mark.parametrize("method", ACCURATE)
@pytest.mark.parametrize("name", ["single", "double", "double_calm", "triple", "chain5", "chain10"])
def test_adaptive_methods_follow_the_truth_to_half_the_horizon(name, method):
    scene = pb.load_scene(name)
    horizon = {"chain10": 4.8}.get(name, 10.0)
    truth = pb.reference(scene, [0.5 * horizon])
    assert truth.horizon == 0.5 * horizon
    run = pb.simulate(scene, engine="analytic", method=method, times=truth.t)
    assert distance(scene.lengths, truth.theta, truth.offset(run.theta)).max() < 1e-10


def test_the_gap_of_rattle_is_that_of_the_worst_rod():
    """The second of four rods is stretched by a tenth, the third shortened by half as much: the others stay whole."""
    run = ENGINE.build(random_chain(4, seed=2), "rattle", 1e-3)
    run.advance(1)
    state = run._variables.state
    state.memory[:2, 2] *= 1.1
    state.memory[:2, 3] *= 0.95
    run.advance(0)
    assert run.state().gap == pytest.approx(0.1, rel=1e-9)


@pytest.mark.parametrize("method", FIXED)
def test_order_is_the_one_claimed(method):
    scene = chain(3, angle=[0.5, 0.8, -0.2], rate=[1.0, -1.0, 0.5], length=1.0)
    truth = pb.reference(scene, [0.5])
    claimed = ENGINE.methods[method].order
    counts = {1: (2000, 4000, 8000), 2: (400, 800, 1600), 4: (40, 80, 160), 6: (20, 28, 40)}[claimed]
    errors = [np.abs(truth.offset(after(scene, method, 0.5 / k, k).theta[None])).max() for k in counts]
    assert abs(order(0.5 / np.array(counts), np.array(errors)) - claimed) < 0.2


@pytest.mark.parametrize("method", FIXED)
def test_forward_and_back_misses_the_start_by_the_method_s_error(method):
    """Reversible methods return to rounding. Others miss by an error of their order, or of one more."""
    scene, errors, steps = random_chain(3, seed=1), [], np.array([0.01, 0.005, 0.0025])
    for dt in steps:
        there = after(scene, method, dt, round(0.5 / dt))
        back = after(scene.with_start(there.theta, -there.omega), method, dt, round(0.5 / dt))
        errors.append(np.abs(back.theta - scene.angles).max())
    if method in REVERSIBLE:
        assert max(errors) < REVERSIBLE[method]
    else:
        claimed = ENGINE.methods[method].order
        claimed = NEARLY_REVERSIBLE.get(method, claimed)
        assert claimed - 0.2 < order(steps, np.array(errors)) < claimed + 1.2


@pytest.mark.parametrize("method", FIXED)
def test_many_calls_are_one(method):
    scene = random_chain(4, seed=2)
    run = ENGINE.build(scene, method, 0.01)
    for steps in (1, 0, 7, 32):
        run.advance(steps)
    whole = after(scene, method, 0.01, 40)
    # Implicit methods begin their iteration from the step before, and compensate rounding: both are kept between calls.
    np.testing.assert_array_equal(run.state().theta, whole.theta)
    np.testing.assert_array_equal(run.state().omega, whole.omega)


def test_adaptive_in_many_calls_is_as_good_as_in_one():
    scene, times = pb.load_scene("double"), np.linspace(0.01, 2.0, 200)
    often, once = (pb.simulate(scene, engine="analytic", times=t) for t in (times, times[-1:]))
    np.testing.assert_allclose(often.theta[-1], once.theta[-1], rtol=0, atol=1e-12)


def test_looser_tolerance_takes_fewer_steps_and_is_worse():
    scene = pb.load_scene("double")
    truth = pb.reference(scene, [2.0])
    runs = [pb.simulate(scene, engine="analytic", times=[2.0], tolerance=tol) for tol in (1e-6, 1e-9, 1e-12)]
    errors = [np.abs(truth.offset(run.theta)).max() for run in runs]
    assert runs[0].steps < runs[1].steps < runs[2].steps
    assert errors[0] > 100 * errors[1] > 10_000 * errors[2]


@pytest.mark.parametrize(("setting", "value"), [("smallest_step", 0.1), ("most_steps", 20)])
def test_limits_end_the_run(setting, value):
    run = pb.simulate("double", engine="analytic", **{setting: value})
    assert run.status == "work limit"
    assert "at t = " in run.reason
    assert len(run.t) < 1001
    assert run.theta.shape == (len(run.t), 2)


def test_state_beyond_numbers_is_not_finite():
    scene = Scene("fast", "", 1.0, [1.0, 1.0], [1.0, 1.0], [1.0, 2.0], [1e9, -1e9], Effects(gravity=9.81))
    run = ENGINE.build(scene, "rk4", 1.0)
    run.advance(50)
    status, _ = run.health()
    assert status == "not finite"


def test_states_are_copies():
    for method, dt in (("rk4", 0.01), ("adaptive", None)):
        run = ENGINE.build(random_chain(2, seed=3), method, dt)
        before = run.state()
        kept = before.theta.copy()
        run.advance(5) if dt else run.advance_to(0.05)
        np.testing.assert_array_equal(before.theta, kept)
        assert np.abs(run.state().theta - kept).max() > 0


def test_momenta_and_rates_share_kernels_whatever_acts():
    """Those of a chain of masses, of one with links, and of one with rotors."""
    made = [_unforced(system_of(under(names, random_chain(3, seed=3)))) for names in SETS.values()]
    assert len({numba.typeof(system) for system in made}) == 3
    assert len(SETS) > 6


def test_fixed_step_without_a_step_is_an_error():
    with pytest.raises(ValueError, match="'rk4' needs a step"):
        ENGINE.build(chain(1), "rk4", None)


def test_small_swings_have_the_period_of_the_textbook():
    period = 2 * math.pi / math.sqrt(9.81)
    run = pb.simulate(chain(1, angle=1e-5), engine="analytic", times=[period / 4, period / 2, period])
    np.testing.assert_allclose(run.theta[:, 0], [0.0, -1e-5, 1e-5], rtol=0, atol=1e-14)
