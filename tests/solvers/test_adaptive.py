"""The loop with error control: its order, that it lands, and how it gives up."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from pendbench.base.faults import STATUSES
from pendbench.physics.exact import single_pendulum
from pendbench.physics.kernels.table import system_of
from pendbench.scene.scene import load_scene
from pendbench.solvers.adaptive import _Room, _scaled_error, integrate
from pendbench.solvers.compensated import sum_from
from pendbench.solvers.control import FIRST_STEP, Limits
from pendbench.solvers.dop853 import DOP853
from pendbench.solvers.outcome import DONE, NOT_FINITE, REASONS, TOO_MANY, TOO_SMALL
from support.kernels import called
from support.scenes import chain
from support.systems import Growth, Oscillator, order

OSCILLATOR = Oscillator(frequency=1.5)
START = np.array([0.8, -0.6])
PENDULUM = chain(1, angle=2.0, rate=1.0)
EXPLOSION = Growth(rate=1.0, power=2.0, drive=0.0)  # from y = 1: 1 / (1 - t)
EPS = np.finfo(float).eps
ANY_ERROR = 1e300


class Run:
    """A state and what `integrate` keeps beside it."""

    def __init__(self, system, start, tolerance=1e-13, relative=0.0, *, smallest=0.0, most_steps=100_000):
        self.system, self.sum = system, sum_from(np.array(start, dtype=float))
        self.y, self.carry = self.sum
        self.limits = Limits(tolerance, np.full_like(self.y, relative), smallest, most_steps)

    def to(self, end, t=0.0, h=FIRST_STEP):
        return integrate(self.system, DOP853, self.limits, t, h, end, self.sum)


def equal_steps(system, start, until, steps):
    """The state after that many steps of one length: a call for each, and no error too large."""
    run = Run(system, start, tolerance=ANY_ERROR)
    times = until * np.arange(steps + 1) / steps
    for t, end in pairwise(times):
        assert run.to(end, t, h=1.0).accepted == 1
    return run.y


def observed_order(system, start, exact, until, counts):
    errors = [np.abs(equal_steps(system, start, until, steps) - exact).max() for steps in counts]
    return order(until / np.array(counts), np.array(errors))


def test_order_on_the_oscillator():
    exact = OSCILLATOR.exact(START, 8.0)
    assert abs(observed_order(OSCILLATOR, START, exact, 8.0, (30, 40, 50, 60)) - 8) < 0.2


def test_order_on_the_pendulum():
    theta, omega = single_pendulum(PENDULUM, np.array([1.0]))
    start, exact = np.append(PENDULUM.angles, PENDULUM.rates), np.array([theta[0, 0], omega[0, 0]])
    assert abs(observed_order(system_of(PENDULUM), start, exact, 1.0, (14, 17, 20, 24)) - 8) < 0.2


def test_stages_are_evaluated_at_their_nodes():
    drive = Growth(rate=0.0, power=0.0, drive=1.0)
    assert abs(observed_order(drive, [0.0], [math.sin(8.0)], 8.0, (9, 10, 12, 14)) - 8) < 0.2


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_error_follows_the_tolerance(tolerance):
    run = Run(OSCILLATOR, START, tolerance)
    done = run.to(20.0)
    error = np.abs(run.y - OSCILLATOR.exact(START, 20.0)).max()
    # The error allowed for a step adds up over the steps at worst, and is mostly not used up.
    assert 1e-3 * tolerance < error < done.accepted * tolerance


def test_steps_grow_as_the_tolerance_to_the_power_of_an_eighth():
    counts = [Run(OSCILLATOR, START, tolerance).to(200.0).accepted for tolerance in (1e-12, 1e-8)]
    assert math.log(counts[0] / counts[1]) / math.log(1e4) == pytest.approx(1 / 8, abs=0.01)


def test_few_steps_are_in_vain():
    """One in eight, where the motion quickens; a wrong exponent in the step control makes it one in two."""
    scene = load_scene("double")
    done = Run(system_of(scene), np.append(scene.angles, scene.rates), 1e-14, relative=1.0).to(10.0)
    assert done.rejected < 0.2 * done.accepted


def test_lands_on_times_that_fit_no_step():
    run, t, h = Run(OSCILLATOR, START, 1e-14), 0.0, FIRST_STEP
    for end in (1e-9, 0.1, 0.1 + 1e-12, 0.7, math.pi, 10.0):
        done = run.to(end, t, h)
        assert (done.outcome, done.t) == (DONE, end)
        t, h = end, done.h
        np.testing.assert_allclose(run.y, OSCILLATOR.exact(START, end), rtol=0, atol=1e-13)


def test_landing_does_not_shorten_the_steps_that_follow():
    t, h, run, steps = 0.0, FIRST_STEP, Run(OSCILLATOR, START), 0
    for end in (9.0, 9.0 + 1e-9, 18.0):
        done = run.to(end, t, h)
        t, h, steps = end, done.h, steps + done.accepted
    assert steps <= Run(OSCILLATOR, START).to(18.0).accepted + 4


def test_at_the_end_already_nothing_happens():
    run = Run(OSCILLATOR, START)
    assert run.to(2.0, t=2.0) == (DONE, 2.0, FIRST_STEP, 0, 0)
    np.testing.assert_array_equal(run.y, START)


def test_first_step_much_too_long_is_rejected():
    run = Run(OSCILLATOR, START, 1e-12)
    done = run.to(200.0, h=100.0)
    assert done.rejected > 0
    np.testing.assert_allclose(run.y, OSCILLATOR.exact(START, 200.0), rtol=0, atol=1e-9)


def test_at_rest_steps_grow():
    run = Run(OSCILLATOR, [0.0, 0.0])
    done = run.to(1e6)
    assert done.accepted < 20
    np.testing.assert_array_equal(run.y, 0.0)


def test_relative_tolerance_follows_the_size_of_the_state():
    start = 1e6 * START
    absolute, relative = (Run(OSCILLATOR, start, 1e-8, relative=r) for r in (0.0, 1.0))
    assert absolute.to(20.0).accepted > 3 * relative.to(20.0).accepted
    np.testing.assert_allclose(absolute.y, OSCILLATOR.exact(start, 20.0), rtol=0, atol=1e-6)
    np.testing.assert_allclose(relative.y, OSCILLATOR.exact(start, 20.0), rtol=0, atol=1.0)


def test_work_limit_stops_in_a_valid_state():
    run = Run(OSCILLATOR, START, most_steps=17)
    done = run.to(100.0)
    assert done.outcome == TOO_MANY
    assert done.accepted + done.rejected == 17
    assert 0.0 < done.t < 100.0
    np.testing.assert_allclose(run.y, OSCILLATOR.exact(START, done.t), rtol=0, atol=1e-12)


def test_smallest_step_stops_before_the_explosion():
    run = Run(EXPLOSION, [1.0], relative=1.0, smallest=1e-6)
    done = run.to(2.0)
    assert done.outcome == TOO_SMALL
    assert 1e-7 < done.h < 1e-6
    assert 1.0 - 1e-4 < done.t < 1.0
    np.testing.assert_allclose(run.y, 1.0 / (1.0 - done.t), rtol=1e-6)  # the explosion magnifies errors


def test_first_step_is_not_below_the_smallest():
    assert Run(OSCILLATOR, START, 1e-6, smallest=0.1).to(20.0, h=FIRST_STEP).outcome == DONE


def test_step_that_no_longer_moves_the_time_is_too_small():
    done = Run(EXPLOSION, [1.0], relative=1.0, smallest=0.0, most_steps=5000).to(2.0)
    assert done.outcome == TOO_SMALL
    assert done.t == pytest.approx(1.0)


@pytest.mark.parametrize("start", [math.nan, math.inf, 0.0])
def test_derivative_that_is_not_finite_stops_at_once(start):
    run = Run(Growth(rate=1.0, power=-1.0 if start == 0.0 else 1.0, drive=0.0), [start])
    assert run.to(1.0) == (NOT_FINITE, 0.0, FIRST_STEP, 0, 0)
    np.testing.assert_array_equal(run.y, start)


def test_every_way_to_give_up_has_a_status():
    assert set(REASONS) == {TOO_SMALL, TOO_MANY, NOT_FINITE}
    assert {status for status, _ in REASONS.values()} <= set(STATUSES) - {"ok"}


def test_compensated_summation_keeps_what_one_step_cannot_show():
    """10^4 steps of a tenth of the last digit each: without the carry y would not move at all."""
    constant, steps = Growth(rate=1.0, power=0.0, drive=0.0), 10_000
    digit = np.spacing(1000.0)
    run, times = Run(constant, [1000.0], tolerance=ANY_ERROR), 0.1 * digit * np.arange(steps + 1)
    for t, end in pairwise(times):
        run.to(end, t, h=1.0)
    np.testing.assert_allclose(run.y - 1000.0, steps * 0.1 * digit, rtol=0, atol=digit)
    assert abs((run.y[0] - 1000.0) + run.carry[0] - times[-1]) < 1e-3 * digit


@pytest.mark.parametrize("lost", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("d", [1, 4, 7])
def test_no_component_whose_error_is_unknown_is_passed_over(d, lost):
    """Or a step would be taken that should be tried again with a shorter one."""
    for i in range(d):
        room = _Room(np.zeros((len(DOP853.b), d)), np.ones(d), np.empty(d), np.empty(d))
        assert called(_scaled_error)(DOP853, 1.0, room) == 0.0
        room.k[7, i] = lost
        assert called(_scaled_error)(DOP853, 1.0, room) == np.inf
