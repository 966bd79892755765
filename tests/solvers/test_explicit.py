"""The loops with a fixed step: their orders against closed forms, and what they keep exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendbench.physics.exact import single_pendulum
from pendbench.physics.kernels.table import system_of
from pendbench.solvers.explicit import runge_kutta
from pendbench.solvers.methods import fixed_step_methods
from pendbench.solvers.rk4 import RK4
from support.scenes import chain
from support.systems import Growth, Oscillator, order

OSCILLATOR = Oscillator(frequency=1.5)
START = np.array([0.8, -0.6])
PENDULUM = chain(1, angle=2.0, rate=1.0)
EPS = np.finfo(float).eps


def rk4(system, start, until, steps, first=0):
    y = np.array(start, dtype=float)
    runge_kutta(system, RK4, y, first, until / steps, steps)
    return y


def euler(system, start, until, steps):
    method = fixed_step_methods()["euler"]
    state = method.begin(*np.split(np.array(start, dtype=float), 2))
    assert method.advance(system, state, 0, until / steps, steps) == steps
    return np.concatenate([state.q, state.v])


def observed_order(solve, system, start, exact, *, until, counts):
    errors = [np.abs(solve(system, start, until, steps) - exact).max() for steps in counts]
    return order(until / np.array(counts), np.array(errors))


@pytest.mark.parametrize(("solve", "expected", "counts"), [(rk4, 4, (50, 100, 200)), (euler, 1, (2000, 4000, 8000))])
def test_order_on_the_oscillator(solve, expected, counts):
    exact = OSCILLATOR.exact(START, 2.0)
    assert abs(observed_order(solve, OSCILLATOR, START, exact, until=2.0, counts=counts) - expected) < 0.2


@pytest.mark.parametrize(("solve", "expected", "counts"), [(rk4, 4, (100, 200, 400)), (euler, 1, (2000, 4000, 8000))])
def test_order_on_the_pendulum(solve, expected, counts):
    theta, omega = single_pendulum(PENDULUM, np.array([1.0]))
    exact = np.array([theta[0, 0], omega[0, 0]])
    start = np.concatenate([PENDULUM.angles, PENDULUM.rates])
    assert abs(observed_order(solve, system_of(PENDULUM), start, exact, until=1.0, counts=counts) - expected) < 0.2


def test_rk4_evaluates_at_its_nodes():
    """For y' = cos t from t = 1 it is of order 4 only with the times of the stages right."""
    drive = Growth(rate=0.0, power=0.0, drive=1.0)
    steps = np.array([10, 20, 40])
    errors = [abs(rk4(drive, [0.0], 2.0, k, first=k // 2)[0] - (math.sin(3.0) - math.sin(1.0))) for k in steps]
    assert abs(order(2.0 / steps, np.array(errors)) - 4) < 0.2


def test_rk4_step_is_the_taylor_polynomial_on_a_linear_system():
    h, w = 0.3, OSCILLATOR.frequency
    step = h * np.array([[0.0, 1.0], [-w * w, 0.0]])
    taylor = sum(np.linalg.matrix_power(step, k) / math.factorial(k) for k in range(5))
    np.testing.assert_allclose(rk4(OSCILLATOR, START, h, 1), taylor @ START, rtol=0, atol=4 * EPS)


@pytest.mark.parametrize("drive", [0.0, 1.0])
def test_rk4_goes_on_where_it_stopped(drive):
    system, dt = Growth(rate=-0.5, power=1.0, drive=drive), 0.125
    whole = rk4(system, [1.0], 40 * dt, 40)
    half = rk4(system, [1.0], 20 * dt, 20)
    np.testing.assert_array_equal(rk4(system, half, 20 * dt, 20, first=20), whole)


def test_euler_moves_the_rates_first():
    """With v <- v - h w^2 q, then q <- q + h v, this form is kept exactly; the other order keeps another."""
    h, w = 0.2, OSCILLATOR.frequency

    def kept(y):
        return w**2 * y[0] ** 2 + y[1] ** 2 - h * w**2 * y[0] * y[1]

    steps = 10_000
    found = kept(euler(OSCILLATOR, START, steps * h, steps))
    # Each step rounds a few times; in 10^4 steps roundings of random sign add up to some 10^2 of them.
    np.testing.assert_allclose(found, kept(START), rtol=1000 * EPS)


def test_no_steps_change_nothing():
    y = START.copy()
    runge_kutta(OSCILLATOR, RK4, y, 0, 0.1, 0)
    np.testing.assert_array_equal(y, START)
