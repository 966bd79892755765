"""What an accuracy costs, against points whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendbench.measures.prices import Price, price_of, price_of_digit

STEPS = np.array([0.1, 0.05, 0.02, 0.01])
FLOOR, CEILING = 1e-12, 0.03


def method(order: float, steps=STEPS):
    """Step, error and cost of a method that is what it claims to be: e = h^p, and a cost of 1/h."""
    return steps, steps**order, 1 / steps


# The price of an accuracy.


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("share", [0.999, 0.5, 0.1001])
def test_a_price_between_two_steps_is_that_of_the_step_between_them(order, share):
    step = 0.1 * share
    price = price_of(step**order, *method(order))
    assert price.step == pytest.approx(step, rel=1e-12)  # a power law is a straight line of logarithms
    assert price.run_s == pytest.approx(1 / step, rel=1e-12)
    assert not price.bound
    assert price.best == pytest.approx(0.01**order)


def test_the_coarsest_step_that_is_good_enough_is_an_upper_bound():
    assert price_of(0.5, *method(1)) == Price(10.0, 0.1, 0.01, bound=True)
    assert price_of(0.1, *method(1)) == Price(10.0, 0.1, 0.01, bound=True)  # just so


def test_what_no_step_reaches_has_no_price_but_a_best_error():
    price = price_of(1e-5, *method(2))
    assert math.isnan(price.run_s)
    assert math.isnan(price.step)
    assert price.best == pytest.approx(1e-4)  # the finest step promises more; nothing is made of that
    assert not price.bound


def test_what_was_not_measured_has_neither():
    for points in (np.zeros((3, 0)), np.array([[0.1], [np.nan], [1.0]])):
        assert np.isnan(price_of(1e-3, *points)[:3]).all()


def test_a_failed_step_is_no_point_to_start_from():
    steps, errors, costs = method(2)
    errors[0] = np.nan
    assert price_of(2.6e-3, steps, errors, costs) == Price(20.0, 0.05, 1e-4, bound=False)


def test_an_error_of_nothing_cannot_be_interpolated_to():
    assert price_of(1e-3, STEPS, np.array([0.1, 0.0, 0.0, 0.0]), 1 / STEPS) == Price(20.0, 0.05, 0.0, bound=False)


POINTS = st.lists(
    st.tuples(st.floats(1e-6, 1.0), st.floats(1e-14, 10.0) | st.just(math.nan), st.floats(1e-6, 1e3)),
    min_size=1,
    max_size=8,
    unique_by=lambda point: point[0],
)


@given(POINTS, st.floats(1e-12, 1.0), st.randoms())
def test_prices_are_never_beyond_what_was_measured_and_do_not_depend_on_the_order(points, accuracy, random):
    steps, errors, costs = np.array(sorted(points, reverse=True)).T
    price = price_of(accuracy, steps, errors, costs)
    shuffled = random.sample(points, len(points))
    assert repr(price_of(accuracy, *np.array(shuffled).T)) == repr(price)
    good = np.flatnonzero(errors <= accuracy)
    assert np.isfinite(price.run_s) == bool(len(good))
    if len(good):
        pair = slice(max(good[0] - 1, 0), good[0] + 1)
        assert costs[pair].min() * (1 - 1e-9) <= price.run_s <= costs[pair].max() * (1 + 1e-9)
        assert steps[good[0]] * (1 - 1e-9) <= price.step <= steps[pair].max() * (1 + 1e-9)


# The price of one more digit.


@pytest.mark.parametrize(("order", "price"), [(1, 10.0), (2, math.sqrt(10)), (4, 10**0.25)])
def test_a_digit_costs_what_the_order_says(order, price):
    _, errors, costs = method(order, np.array([1e-2, 5e-3, 2e-3, 1e-3]))
    assert price_of_digit(errors, costs, FLOOR, CEILING) == pytest.approx(price)


def test_rounding_and_large_errors_do_not_count():
    errors = np.array([0.9, 1e-2, 1e-4, 1e-6, 1e-13, np.nan])
    costs = np.array([100.0, 1.0, 10.0, 100.0, 1e6, 1e9])
    assert price_of_digit(errors, costs, FLOOR, CEILING) == pytest.approx(math.sqrt(10))


@pytest.mark.parametrize(
    ("errors", "costs"),
    [
        ([], []),
        ([1e-3], [1.0]),
        ([1e-3, 0.5, 1e-14], [1.0, 2.0, 3.0]),  # one usable point
        ([1e-3, 1e-4], [1.0, 2.0]),  # a line through two points: how sure it is, nobody knows
        ([1e-3, 0.9e-3, 0.7e-3], [1.0, 2.0, 3.0]),  # not even halved
        ([1e-5, 1e-4, 1e-3], [1.0, 2.0, 4.0]),  # more cost, more error
        ([np.nan, np.nan], [1.0, 2.0]),
    ],
)
def test_without_a_falling_error_a_digit_has_no_price(errors, costs):
    assert math.isnan(price_of_digit(np.array(errors), np.array(costs), FLOOR, CEILING))


@pytest.mark.parametrize(("noise", "told"), [(0.0275, True), (0.0285, False)])
def test_three_points_leave_one_degree_of_freedom(noise, told):
    """A decade apart and off the line by a, -2a, a: the slope is off by a sqrt(3), a quarter at a = 0.028."""
    errors = 10.0 ** -np.arange(2.0, 5.0)
    costs = 10.0 ** (np.arange(3.0) + noise * np.array([1.0, -2.0, 1.0]))
    price = price_of_digit(errors, costs, FLOOR, CEILING)
    assert price == pytest.approx(10.0 if told else math.nan, nan_ok=True)


@pytest.mark.parametrize(("share", "price"), [(0.501, math.nan), (0.499, 10.0)])
def test_an_error_that_is_not_halved_tells_no_price_however_neatly_it_falls(share, price):
    errors = np.array([1e-3, 0.8e-3, share * 1e-3])
    assert price_of_digit(errors, 1.0 / errors, FLOOR, CEILING) == pytest.approx(price, nan_ok=True)


@pytest.mark.parametrize(("noise", "told"), [(0.075, True), (0.078, False)])
def test_a_digit_has_a_price_where_that_is_known_to_a_quarter(noise, told):
    """Four points, a decade apart, off the line by +a, -a, -a, +a: its slope stays, with an error of a sqrt(2/5).

    Two of these are log10(1.25) at a = 0.0766.
    """
    errors = 10.0 ** -np.arange(2.0, 6.0)
    costs = 10.0 ** (np.arange(4.0) + noise * np.array([1.0, -1.0, -1.0, 1.0]))
    price = price_of_digit(errors, costs, FLOOR, CEILING)
    assert price == pytest.approx(10.0 if told else math.nan, nan_ok=True)
