"""What is measured, against signals whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendbench.measures.divergence import Crossing, growth_rate, time_to
from pendbench.measures.drift import Drift, drift

T = np.linspace(0.0, 10.0, 1001)


# When an error passes a threshold.


def test_a_crossing_of_an_exponential_is_found_between_two_samples():
    crossing = time_to(T, 1e-9 * np.exp(2.0 * T), 1e-3)
    assert crossing.time == pytest.approx(math.log(1e6) / 2.0, abs=1e-12)  # interpolation in the logarithm is exact
    assert crossing.low <= crossing.time <= crossing.high
    assert crossing.high - crossing.low == pytest.approx(0.01)
    assert {crossing.low, crossing.high} <= set(T)


def test_only_the_first_crossing_counts():
    error = np.where((T >= 1.0) & (T < 2.0), 1.0, 1e-6)
    error[T >= 5.0] = 1.0
    assert time_to(T, error, 0.1).high == pytest.approx(1.0)


def test_an_error_that_only_reaches_the_threshold_has_not_passed_it():
    assert time_to(T, np.full(1001, 1e-3), 1e-3) is None
    assert time_to(T, np.zeros(1001), 1e-3) is None
    assert time_to(T[:0], T[:0], 1e-3) is None


def test_an_error_that_is_large_at_once_passes_at_the_first_time():
    assert time_to(T, np.ones(1001), 1e-3) == Crossing(0.0, 0.0, 0.0)


@pytest.mark.parametrize("end", [np.inf, np.nan])
def test_a_run_that_broke_off_passes_when_it_broke_off(end):
    assert time_to(T[:4], np.array([0.0, 1e-9, 1e-8, end]), 1e-1) == Crossing(T[3], T[2], T[3])


def test_an_error_that_comes_out_of_nothing_passes_at_its_sample():
    assert time_to(T[:3], np.array([0.0, 0.0, 1.0]), 1e-3) == Crossing(T[2], T[1], T[2])


# How an energy strays.


def test_an_energy_in_a_band_has_a_band_and_no_slope():
    t = np.linspace(0.0, 20.0, 2001)[:-1]  # ten whole periods
    found = drift(t, 5.0 - 3.0 * np.cos(np.pi * t), 2.0)
    assert found.largest == pytest.approx(3.0)
    assert found.band == pytest.approx(3.0)
    assert abs(found.slope) < 2e-3  # a whole number of periods has no trend; the samples are not symmetric to a step
    assert found.final == pytest.approx(0.0, abs=1e-3)


def test_an_energy_that_leaks_has_the_slope_that_it_has():
    found = drift(T, 4.0 - 0.5 * T, 2.0)
    assert found == pytest.approx(Drift(largest=2.5, final=-2.5, band=2.5, slope=-0.25))


def test_the_first_value_is_what_an_energy_strays_from():
    assert drift(T[:3], np.array([1.0, 3.0, 0.0]), 1.0)[:3] == pytest.approx((2.0, -1.0, 3.0))


def test_where_there_is_no_scale_or_no_sample_there_is_no_drift():
    assert all(math.isnan(value) for value in drift(T, T, 0.0))
    assert all(math.isnan(value) for value in drift(T, T, math.nan))
    assert all(math.isnan(value) for value in drift(T[:0], T[:0], 1.0))


def test_one_sample_has_no_slope():
    found = drift(T[:1], np.array([3.0]), 1.0)
    assert found[:3] == (0.0, 0.0, 0.0)
    assert math.isnan(found.slope)


def test_two_samples_have_the_slope_between_them():
    assert drift(np.array([1.0, 3.0]), np.array([1.0, 5.0]), 2.0).slope == pytest.approx(1.0)


@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_an_energy_that_blew_up_is_a_number_and_no_exception(value):
    found = drift(T[:3], np.array([1.0, value, 2.0]), 1.0)
    assert found[:3] == (math.inf, 1.0, math.inf)
    assert math.isnan(found.slope)


# Exponential growth.


def test_the_rate_of_an_exponential():
    assert growth_rate(T, 1e-14 * np.exp(3.0 * T), 1e-12, 1e-2) == pytest.approx(3.0, rel=1e-12)


def test_what_lies_outside_the_window_does_not_count():
    error = 1e-14 * np.exp(3.0 * T)
    outside = np.where((error < 1e-12) | (error > 1e-2), np.sqrt(error), error)
    outside[error < 1e-12] = 1e-13
    assert growth_rate(T, outside, 1e-12, 1e-2) == pytest.approx(3.0, rel=1e-9)


def test_the_window_begins_after_the_error_was_last_below_it():
    error = 1e-10 * np.exp(2.0 * T)
    error[300] = 0.0  # a zero on the way: what was before it is another stretch
    assert growth_rate(T, error, 1e-12, 1e-2) == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize(
    "error",
    [
        np.full(1001, 1e-6),  # does not grow
        1e-6 * np.exp(0.2 * T),  # by less than a factor of 10
        1e-6 * np.exp(-T),
        np.zeros(1001),
        np.ones(1001),  # above the window from the start
        np.where(T < 9.99, 1e-14, 1e-4),  # too few samples in the window
        np.full(1001, np.nan),
    ],
)
def test_what_does_not_grow_has_no_rate(error):
    assert math.isnan(growth_rate(T, error, 1e-12, 1e-2))
    assert math.isnan(growth_rate(T[:0], error[:0], 1e-12, 1e-2))


def test_fewer_than_eight_samples_are_too_few():
    error = 1e-10 * np.exp(100.0 * T[:8])
    assert math.isnan(growth_rate(T[:7], error[:7], 1e-12, 1.0))
    assert growth_rate(T[:8], error, 1e-12, 1.0) == pytest.approx(100.0)


@pytest.mark.parametrize("inside", [7, 8])
def test_the_sample_after_the_last_one_below_the_window_is_the_first_that_counts(inside):
    error = np.append([1e-10, 1e-13], 1e-11 * np.exp(100.0 * T[:inside]))
    found = growth_rate(T[: len(error)], error, 1e-12, 1.0)
    assert found == pytest.approx(100.0 if inside == 8 else math.nan, nan_ok=True)


@pytest.mark.parametrize(("factor", "grows"), [(9.9, False), (10.1, True)])
def test_growth_is_by_a_factor_of_ten(factor, grows):
    error = 1e-6 * factor ** (T / 10.0)
    assert math.isfinite(growth_rate(T, error, 1e-12, 1e-2)) == grows
