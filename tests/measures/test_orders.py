"""The order of a method and where it stops, against errors whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendbench.measures.orders import observed_order

FLOOR, CEILING = 1e-13, 0.03


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


def falling(*orders: float, start: float = 1e-2) -> list[float]:
    """Errors that fall with these orders, from step to halved step."""
    return [start, *(start * 0.5 ** float(sum(orders[: i + 1])) for i in range(len(orders)))]


@pytest.mark.parametrize(("last", "shown"), [(3.81, 3.81), (3.79, 8.0), (4.19, 4.19), (4.21, 8.0)])
def test_orders_of_neighbours_confirm_each_other_up_to_a_fifth(last, shown):
    """Neither 4 nor the last is three quarters of 8, so only each other can confirm them."""
    assert fit(HALVES[:4], falling(8.0, 4.0, last)).order == pytest.approx(shown)


@pytest.mark.parametrize(("floor", "shown"), [(1.3e-7, 4.0), (1.6e-7, 8.0)])
def test_a_pair_that_confirms_reaches_a_tenth_of_the_floor_and_no_further(floor, shown):
    """The errors are 1e-3, 3.9e-6, 2.4e-7 and 1.5e-8: the pair of the last two shows nothing itself."""
    errors = np.array(falling(8.0, 4.0, 4.0, start=1e-3))
    assert observed_order(np.array(HALVES[:4]), errors, floor, CEILING).order == pytest.approx(shown)


def test_a_pair_whose_finer_error_is_below_the_floor_shows_no_order():
    """Orders 2, 2.1, 2.2: the last is confirmed, but ends below the floor."""
    errors = np.array(falling(2.0, 2.1, 2.2))
    found = observed_order(np.array(HALVES[:4]), errors, 1.01 * errors[-1], CEILING)
    assert found.order == pytest.approx(2.1)
    assert (found.coarse, found.fine) == (HALVES[1], HALVES[2])


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


def test_a_plateau_from_the_start_is_told_by_the_two_finest_steps():
    found = fit(TENTHS[:4], [4e-4, 4.2e-4, 4.1e-4, 4.3e-4])
    assert math.isnan(found.order)
    assert (found.coarse, found.fine) == (1e-3, 1e-4)
    assert found.plateau == 4e-4


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


def test_no_error_at_all_shows_no_order_and_does_not_hide_one():
    assert fit(TENTHS[:3], [0.0, 1e-4, 1e-6]).order == pytest.approx(2.0)


def test_errors_that_are_no_numbers_are_left_out():
    found = fit(TENTHS[:4], [math.inf, math.nan, 1e-4, 1e-6])
    assert found.order == pytest.approx(2.0)
    assert fit(TENTHS[:3], [1e-2, 1e-4, math.inf]).order == pytest.approx(2.0)
    assert fit(TENTHS[:2], [math.nan, 1e-3]) is None


@pytest.mark.parametrize(("last", "plateau"), [(1.1e-6, 1.1e-6), (0.9e-6, None)])
def test_a_plateau_is_where_finer_steps_bring_less_than_half_of_the_order(last, plateau):
    """Order 4 down to 1e-4; with a tenth of that step, half of the order promises a hundredth of the error."""
    found = fit([4e-1, 2e-1, 2e-2], [1.6e-3, 1e-4, last])
    assert found.order == pytest.approx(4.0)
    assert found.plateau == plateau


def test_half_an_order_is_an_order_and_less_is_none():
    assert fit([4e-2, 1e-2], [2e-3, 1e-3]).order == pytest.approx(0.5)
    assert math.isnan(fit([4e-2, 1e-2], [1.99e-3, 1e-3]).order)
