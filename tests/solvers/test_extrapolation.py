"""Extrapolation in double-double arithmetic: its order, the digits that it reaches, and how it gives up."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from pendbench.solvers.extended.extrapolation import (
    extrapolated_step,
    integrate_extended,
    neville_weights,
)
from pendbench.solvers.outcome import DONE, NOT_FINITE, TOO_MANY, TOO_SMALL
from support.systems import Oscillator, order

OSCILLATOR = Oscillator(frequency=1.5)
START = (0.8, -0.6)
FIRST_STEP = 1e-3
NO_ERROR = 1e-300


class Run:
    """A state and what `integrate_extended` is told beside it."""

    def __init__(self, columns, tolerance=1e-27, *, smallest=1e-12, most_steps=10_000, start=START):
        self.weights, self.tolerance = neville_weights(columns), tolerance
        self.smallest, self.most_steps = smallest, most_steps
        self.y = np.array([[x, 0.0] for x in start])

    def to(self, end, t=0.0, h=FIRST_STEP):
        return integrate_extended(
            OSCILLATOR,
            self.weights,
            t,
            end,
            h,
            self.y,
            self.tolerance,
            np.zeros(2),
            self.smallest,
            self.most_steps,
        )

    def one_step(self, h, fewest):
        """Take one step; how many columns it took."""
        table, room = np.empty((len(self.weights), 2, 2)), np.empty((4, 2, 2))
        _, used = extrapolated_step(
            OSCILLATOR, self.weights, (h, 0.0), self.y, self.tolerance, np.zeros(2), fewest, table, room
        )
        self.y = table[0]
        return used

    def error(self, t):
        """How far the state is from the oscillator's at time t, with 50 digits."""
        with mpmath.workdps(50):
            (q, v), w = map(mpmath.mpf, START), mpmath.mpf(OSCILLATOR.frequency)
            c, s = mpmath.cos_sin(w * mpmath.mpf(t))
            exact = (q * c + v / w * s, v * c - q * w * s)
            found = (mpmath.mpf(float(high)) + mpmath.mpf(float(low)) for high, low in self.y)
            return float(max(abs(f - e) for f, e in zip(found, exact, strict=True)))


def test_neville_weights():
    weights = neville_weights(14)
    for j in range(14):
        for k in range(1, j + 1):
            exact = 1 / (Fraction(2 * (j + 1), 2 * (j + 1 - k)) ** 2 - 1)
            assert abs(sum(map(Fraction, weights[j, k])) / exact - 1) < Fraction(1, 10**31)


@pytest.mark.parametrize(
    ("columns", "steps"),
    [(2, (0.2, 0.3, 0.4)), (3, (0.2, 0.3, 0.4)), (4, (0.2, 0.3, 0.4)), (8, (0.5, 0.7, 1.0)), (12, (0.7, 1.0, 1.4))],
)
def test_order_is_twice_the_number_of_columns(columns, steps):
    """One step: its error is of one order more than what steps add up to."""
    errors = []
    for h in steps:
        run = Run(columns, NO_ERROR)
        run.one_step(h, fewest=columns)
        errors.append(run.error(h))
    assert abs(order(np.array(steps), np.array(errors)) - (2 * columns + 1)) < 0.2


def test_short_step_takes_the_columns_that_it_needs():
    """Each one adds two orders, and costs two calls of the derivative more than the one before it."""
    needed = []
    for h in (0.5, 0.1, 1e-2, 1e-3):
        run = Run(14)
        needed.append(run.one_step(h, fewest=2))
        assert run.error(h) < 1e-27
    assert needed == sorted(needed, reverse=True)
    assert needed[0] > 2 * needed[-1]


@pytest.mark.parametrize("columns", [12, 14])
def test_reaches_25_digits(columns):
    run = Run(columns)
    done = run.to(10.0)
    assert (done.outcome, done.t) == (DONE, 10.0)
    assert run.error(10.0) < 5e-27
    assert done.accepted < 60


@pytest.mark.parametrize("tolerance", [1e-18, 1e-22, 1e-26])
def test_error_follows_the_tolerance(tolerance):
    run = Run(12, tolerance)
    done = run.to(10.0)
    assert 1e-3 * tolerance < run.error(10.0) < done.accepted * tolerance


def test_lands_on_times_that_fit_no_step():
    """Between two doubles lies a step that is none: rounded, it would show in the 17th digit."""
    run, t, h = Run(14), 0.0, FIRST_STEP
    for end in (1e-9, 0.1, 0.1 + 1e-12, 0.7, math.pi, 10.0):
        done = run.to(end, t, h)
        assert (done.outcome, done.t) == (DONE, end)
        t, h = end, done.h
        assert run.error(end) < 5e-27


def test_forward_and_back_is_the_start():
    run = Run(14)
    run.to(10.0)
    run.y[1] *= -1.0
    run.to(10.0)
    run.y[1] *= -1.0
    assert run.error(0.0) < 1e-26


def test_work_limit_stops_in_a_valid_state():
    run = Run(12, most_steps=7)
    done = run.to(100.0)
    assert done.outcome == TOO_MANY
    assert done.accepted + done.rejected == 7
    assert 0.0 < done.t < 100.0
    assert run.error(done.t) < 1e-26


def test_tolerance_below_rounding_ends_at_the_smallest_step():
    done = Run(12, 1e-36, smallest=1e-5).to(1.0)
    assert done.outcome == TOO_SMALL
    assert done.accepted == 0
    assert 0 < done.h < 1e-5


def test_step_that_no_longer_moves_the_time_is_too_small():
    run = Run(12, 1e-36, smallest=0.0)
    done = run.to(2.0, t=1.0)
    assert done.outcome == TOO_SMALL
    assert done.h < 10 * np.spacing(1.0)


def test_state_that_is_not_finite_stops_at_once():
    run = Run(12, start=(math.nan, 0.0))
    assert run.to(1.0) == (NOT_FINITE, 0.0, FIRST_STEP, 0, 0)
