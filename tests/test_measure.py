"""What is measured, against signals whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendbench.study.chaos import _median
from pendbench.study.measure import Crossing, Drift, drift, growth_rate, observed_order, time_to

T = np.linspace(0.0, 10.0, 1001)
FLOOR, CEILING = 1e-13, 0.03


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


# The order of a method, and where it stops.


def fit(steps: list[float], errors: list[float]):
    """The fit, which must not depend on the order in which the steps come."""
    found = observed_order(np.array(steps), np.array(errors), FLOOR, CEILING)
    turned = observed_order(np.array(steps[::-1]), np.array(errors[::-1]), FLOOR, CEILING)
    assert repr(found) == repr(turned)
    return found


TENTHS = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5]
HALVES = [0.1 / 2**k for k in range(8)]


@pytest.mark.parametrize("steps", [TENTHS[:2], TENTHS[:3], TENTHS, HALVES])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_power_law_shows_its_order_at_the_finest_steps_that_show_it(steps, order):
    errors = [0.2 * h**order for h in steps]
    found = fit(steps, errors)
    shown = [h for h, e in zip(steps, errors, strict=True) if e > FLOOR]
    assert found.order == pytest.approx(order, abs=1e-9)
    assert (found.coarse, found.fine) == (shown[-2], shown[-1])
    assert found.plateau is None


def test_rounding_ends_an_order_and_is_no_plateau():
    found = fit(TENTHS, [1e-3, 1e-7, 1e-11, 3e-15, 2e-14])
    assert found.order == pytest.approx(4.0)
    assert (found.coarse, found.fine) == (1e-2, 1e-3)
    assert found.plateau is None


def test_a_floor_ends_an_order_and_is_a_plateau_with_its_level():
    found = fit(TENTHS, [h**4 + 1e-10 for h in TENTHS])
    assert found.order == pytest.approx(4.0, abs=0.01)
    assert found.plateau == pytest.approx(1e-10)


def test_a_pair_that_a_floor_bends_down_does_not_show_the_order():
    steps = HALVES[:5]
    errors = [h**4 + 1e-6 for h in steps]  # the last pairs show 3.5, 2.3, 0.7
    found = fit(steps, errors)
    assert found.order == pytest.approx(4.0, abs=0.3)
    assert found.plateau == pytest.approx(1e-6, rel=0.1)


def test_a_coarse_pair_that_terms_of_higher_order_bend_up_does_not_show_the_order():
    steps = HALVES[:5]
    found = fit(steps, [0.01 * (h / 0.1) ** 2 * (1 + 30 * (h / 0.1) ** 4) / 31 for h in steps])  # 5.5, 2.9, 2.1, 2.0
    assert found.order == pytest.approx(2.0, abs=0.05)
    assert (found.coarse, found.fine) == (steps[3], steps[4])
    assert found.plateau is None


def test_a_pair_is_confirmed_by_the_finer_one_even_below_the_floor():
    steps, errors = [2e-3, 1e-3, 5e-4, 2e-4, 1e-4], [1.4e-4, 3.9e-7, 4.1e-9, 1.7e-11, 2.7e-13]
    found = observed_order(np.array(steps), np.array(errors), 1e-12, 0.03)  # 8.5, 6.6, 6.0, 6.0
    assert found.order == pytest.approx(6.0, abs=0.1)
    assert (found.coarse, found.fine) == (5e-4, 2e-4)


def test_saturated_coarse_steps_are_left_out():
    found = fit(TENTHS[:4], [0.9, 0.7, 2e-3, 2e-7])
    assert found.order == pytest.approx(4.0)
    assert (found.coarse, found.fine) == (1e-3, 1e-4)
    assert found.plateau is None


def test_steps_that_are_all_too_coarse_show_nothing():
    assert fit(TENTHS[:3], [0.9, 0.5, 0.1]) is None
    assert fit(TENTHS[:2], [0.4, 0.01]) is None  # falls, but from an error that is not small


@pytest.mark.parametrize("errors", [[4.9e-4, 4.9e-4], [4.9e-4, 4.9e-4 + 1e-8], [4.9e-4, 4.9e-4 - 1e-8]])
def test_two_steps_whose_error_does_not_fall_are_a_plateau(errors):
    found = fit([1e-2, 1e-3], errors)
    assert math.isnan(found.order)
    assert (found.coarse, found.fine) == (1e-2, 1e-3)
    assert found.plateau == min(errors)


def test_errors_that_are_no_longer_small_are_no_plateau():
    """They stopped growing because nothing is farther away, not because steps stopped helping."""
    assert fit(TENTHS[:3], [0.5, 0.6, 0.55]) is None


def test_an_error_that_rises_again_shows_its_order_and_a_plateau():
    found = fit(TENTHS[:3], [1e-4, 1e-8, 1e-6])
    assert found.order == pytest.approx(4.0)
    assert found.plateau == 1e-8


def test_one_odd_point_is_no_plateau_where_finer_steps_go_on():
    found = fit(HALVES[:6], [1e-2, 1e-2 / 4, 1e-2 / 16, 1e-2 / 20, 1e-2 / 256, 1e-2 / 1024])
    assert found.plateau is None


def test_an_error_at_the_level_of_rounding_from_the_start_shows_nothing():
    assert fit(TENTHS[:3], [3e-15, 5e-15, 4e-15]) is None
    assert fit(TENTHS[:2], [0.0, 0.0]) is None
    assert fit(TENTHS[:2], [3e-14, 5e-13]) is None


def test_fewer_than_two_steps_show_nothing():
    assert fit([], []) is None
    assert fit([1e-3], [1e-5]) is None


def test_errors_that_are_no_numbers_are_left_out():
    found = fit(TENTHS[:4], [math.inf, math.nan, 1e-4, 1e-6])
    assert found.order == pytest.approx(2.0)
    assert fit(TENTHS[:3], [1e-2, 1e-4, math.inf]).order == pytest.approx(2.0)
    assert fit(TENTHS[:2], [math.nan, 1e-3]) is None


# The median over starts, some of which never get there.


@pytest.mark.parametrize(
    ("reached", "total", "median"),
    [
        ([], 0, math.nan),
        ([], 3, math.nan),
        ([1.0], 1, 1.0),
        ([1.0, 2.0, 5.0], 3, 2.0),
        ([1.0, 2.0], 3, 2.0),  # the third is later than both
        ([1.0, 2.0, 3.0], 4, 2.5),
        ([1.0, 2.0], 4, math.nan),  # between the second and one that is not known
        ([1.0], 3, math.nan),
    ],
)
def test_the_median_counts_what_never_got_there_as_later(reached, total, median):
    assert _median(reached, total) == pytest.approx(median, nan_ok=True)
