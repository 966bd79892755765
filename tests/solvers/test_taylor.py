"""Taylor's method: its order, that its states lie on one motion, and how it gives up."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pendbench as pb
from pendbench.engines.analytic.adapter import AnalyticEngine
from pendbench.physics.exact import single_pendulum
from pendbench.physics.geometry import distance
from pendbench.physics.kernels.table import series_system_of
from pendbench.scene.scene import load_scene
from pendbench.solvers.control import Limits
from pendbench.solvers.outcome import DONE, NOT_FINITE, TOO_MANY, TOO_SMALL
from pendbench.solvers.taylor import NO_STEP, integrate, order_for, series_from, state_at
from support.scenes import chain, random_chain
from support.systems import Oscillator, order

OSCILLATOR = Oscillator(frequency=1.5)
START = np.array([0.8, -0.6])
ENGINE = AnalyticEngine()


class Run:
    """A state and what `integrate` keeps beside it."""

    def __init__(self, system, q, v, orders, tolerance=1e-13, *, smallest=0.0, most_steps=100_000):
        self.system, self.series = system, series_from(np.array(q, dtype=float), v, orders)
        self.q, self.v, self.carry = self.series
        self.t, self.h = 0.0, NO_STEP
        self.limits = Limits(tolerance, 1.0, smallest, most_steps)

    def to(self, end):
        done = integrate(self.system, self.limits, self.t, self.h, end, self.series)
        self.t, self.h = done.t, done.h
        return done

    def state(self, time):
        q, v = np.empty_like(self.q), np.empty_like(self.q)
        state_at(time - self.t, self.series, q, v)
        return np.concatenate([q, v])


def oscillator(orders, tolerance=1e-13, **limits):
    return Run(OSCILLATOR, START[:1], START[1:], orders, tolerance, **limits)


def pendulum(scene, orders, tolerance=1e-13, **limits):
    return Run(series_system_of(scene, orders), scene.angles, scene.rates, orders, tolerance, **limits)


def equal_steps(make, start, until, steps):
    """The state after that many steps of one length, each from the state that the one before gave."""
    d = len(start) // 2
    for _ in range(steps):
        run = make(start[:d], start[d:])
        run.to(0.0)
        start = run.state(until / steps)
    return start


@pytest.mark.parametrize("orders", [2, 3, 6, 8])
def test_order_on_the_oscillator(orders):
    counts = np.array([30, 40, 50])
    exact = OSCILLATOR.exact(START, 8.0)
    make = lambda q, v: Run(OSCILLATOR, q, v, orders)  # noqa: E731
    errors = [np.abs(equal_steps(make, START, 8.0, steps) - exact).max() for steps in counts]
    assert abs(order(8.0 / counts, np.array(errors)) - orders) < 0.2


@pytest.mark.parametrize("orders", [3, 5, 7])
def test_order_on_a_chain(orders):
    scene = chain(3, angle=[0.5, 0.8, -0.2], rate=[1.0, -1.0, 0.5], length=1.0)
    truth = pb.reference(scene, [0.5])
    counts = {3: np.array([80, 160, 320]), 5: np.array([40, 80, 160]), 7: np.array([28, 40, 56])}[orders]
    make = lambda q, v: Run(series_system_of(scene, orders), q, v, orders)  # noqa: E731
    start = np.concatenate([scene.angles, scene.rates])
    errors = [np.abs(truth.offset(equal_steps(make, start, 0.5, k)[None, :3])).max() for k in counts]
    assert abs(order(0.5 / counts, np.array(errors)) - orders) < 0.2


@pytest.mark.parametrize("tolerance", [1e-5, 1e-9, 1e-13])
def test_error_follows_the_tolerance(tolerance):
    run = oscillator(order_for(tolerance), tolerance)
    done = run.to(20.0)
    error = np.abs(run.state(20.0) - OSCILLATOR.exact(START, 20.0)).max()
    assert 1e-4 * tolerance < error < done.accepted * tolerance


@pytest.mark.parametrize("orders", range(4, 25))
def test_released_from_the_horizontal_no_order_is_blind(orders):
    """At rest there, two of four orders are zero in angles and rates: a series that looks endless."""
    scene = load_scene("double")
    tolerance = 10.0 ** (-0.8 * orders)
    run = pendulum(scene, orders, max(tolerance, 1e-14))
    run.to(0.0)
    truth = pb.reference(scene, [run.h])
    error = distance(scene.lengths, truth.theta, truth.offset(run.state(run.h)[None, :2])).max()
    assert error < 10.0 * max(tolerance, 1e-14)


def test_order_for_rises_with_the_digits():
    orders = [order_for(10.0**-digits) for digits in range(2, 16)]
    assert orders == sorted(orders)
    assert (orders[0], order_for(1e-14)) == (6, ENGINE.methods["taylor"].order)


def test_states_asked_for_do_not_change_the_run():
    scene = load_scene("triple")
    few, many = (
        pb.simulate(scene, engine="analytic", method="taylor", times=t) for t in ([2.0], np.arange(1, 201) / 100)
    )
    np.testing.assert_array_equal(many.theta[-1], few.theta[-1])
    np.testing.assert_array_equal(many.omega[-1], few.omega[-1])


def test_state_between_two_steps_is_as_good_as_at_their_ends():
    times = np.linspace(0.0, 10.0, 301)[1:]
    run = oscillator(17, 1e-14)
    for t in times:
        run.to(t)
        np.testing.assert_allclose(run.state(t), OSCILLATOR.exact(START, t), rtol=0, atol=1e-13)


def test_nothing_moves_at_rest_and_no_work_is_done():
    scene = chain(4, angle=[np.pi, 0.0, 0.0, np.pi], gravity=None)
    run = pendulum(scene, 12)
    done = run.to(1e6)
    assert (done.outcome, done.accepted) == (DONE, 1)
    np.testing.assert_array_equal(run.state(1e6), np.concatenate([scene.angles, scene.rates]))


def test_many_calls_take_no_more_steps_than_one():
    many, one = oscillator(12), oscillator(12)
    steps = sum(many.to(t).accepted for t in np.linspace(0.0, 50.0, 1001))
    assert steps == one.to(50.0).accepted


def test_work_limit_stops_in_a_valid_state():
    run = oscillator(12, most_steps=17)
    done = run.to(100.0)
    assert (done.outcome, done.accepted) == (TOO_MANY, 17)
    assert 0.0 < done.t < 100.0
    np.testing.assert_allclose(run.state(done.t), OSCILLATOR.exact(START, done.t), rtol=0, atol=1e-12)


def test_series_that_holds_for_less_than_the_smallest_step_stops():
    run = oscillator(12, smallest=2.0)
    done = run.to(100.0)
    assert (done.outcome, done.t) == (TOO_SMALL, 0.0)
    assert 0.0 < done.h < 2.0


def test_step_that_no_longer_moves_the_time_is_too_small():
    scene = chain(2, rate=1e9, gravity=None, length=[1.0, 2.0], angle=[0.0, 1.0])
    run = pendulum(scene, 8)
    run.t = 1e6
    assert run.to(2e6).outcome == TOO_SMALL


@pytest.mark.parametrize("start", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("link", [0, 1, 2])
def test_series_that_is_not_finite_stops_at_once(start, link):
    scene = random_chain(3, 1)
    run = pendulum(scene, 8)
    run.v[0, link] = start
    assert run.to(1.0).outcome == NOT_FINITE
    run = pendulum(scene, 8)
    run.q[link] = start
    assert run.to(1.0).outcome == NOT_FINITE


def test_run_that_gives_up_says_so():
    run = ENGINE.build(load_scene("double"), "taylor", None, most_steps=5)
    assert run.advance_to(10.0) == 5
    assert run.health().status == "work limit"
    assert run.health().reason.startswith("more steps than allowed at t = 0.")
    assert run.advance_to(20.0) == 0


def test_pendulum_for_two_thousand_seconds():
    """The multibody community's benchmark A01, with 20 times the accuracy of its strictest limit to spare."""
    scene = load_scene("a01")
    times = np.linspace(0.0, 2000.0, 401)
    run = pb.simulate(scene, engine="analytic", method="taylor", times=times)
    assert np.abs(run.theta - single_pendulum(scene, times)[0]).max() < 2e-9


def error_of(scene, until, tolerance):
    """The worst angle of `taylor` at a time, rad, over DOP853's at the same tolerance, or over that tolerance."""
    truth = pb.reference(scene, [until])
    found = {}
    for method in ("taylor", "adaptive"):
        run = pb.simulate(scene, engine="analytic", method=method, times=[until], tolerance=tolerance)
        found[method] = np.abs(truth.offset(run.theta)).max()
    return found["taylor"] / max(found["adaptive"], tolerance)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8])
def test_motion_in_slow_units_is_no_less_accurate(tolerance):
    """Rates far below 1 rad/s: what a step adds to the angles limits it, not what it adds to the rates."""
    free = chain(2, angle=[0.0, 1.5], rate=[1e-3, -1e-3], gravity=None, duration=1e4)
    assert error_of(free, 3000.0, tolerance) < 100.0
    long = chain(1, angle=1.0, length=1e4, duration=1e4)
    assert error_of(long, 1000.0, tolerance) < 100.0


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4, 1e-6])
def test_series_whose_terms_still_grow_is_cut(tolerance):
    """A nanoradian from the top the last terms are tiny, and those left out are not."""
    scene = chain(1, angle=np.pi - 1e-9, length=1.0, duration=10.0)
    run = pendulum(scene, order_for(tolerance), tolerance)
    run.to(0.0)
    truth = pb.reference(scene, [run.h])
    assert np.abs(truth.offset(run.state(run.h)[None, :1])).max() < tolerance
