"""The exponent of a growth, and its standard error."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendbench.measures.orders import growth_exponent


def test_a_power_law_has_its_exponent_and_no_error():
    n = np.array([5.0, 10.0, 50.0])
    exponent, error = growth_exponent(n, 3.0 * n**-1.25)
    assert exponent == pytest.approx(-1.25)
    assert error == pytest.approx(0.0, abs=1e-12)


def test_the_standard_error_by_hand():
    """Through (0, 0), (1, 1), (2, 3): slope 3/2, residuals 1/6, -1/3, 1/6; (1/6 over one degree) over 2, its root."""
    exponent, error = growth_exponent(np.exp([0.0, 1.0, 2.0]), np.exp([0.0, 1.0, 3.0]))
    assert exponent == pytest.approx(1.5)
    assert error == pytest.approx(math.sqrt(1.0 / 12.0))


def test_the_standard_error_of_four_points_by_hand():
    """Through (0, 0), (1, 1), (2, 3), (3, 4): slope 7/5, residuals 0.1, -0.3, 0.3, -0.1; 0.2 over two, over 5."""
    exponent, error = growth_exponent(np.exp(np.arange(4.0)), np.exp([0.0, 1.0, 3.0, 4.0]))
    assert exponent == pytest.approx(1.4)
    assert error == pytest.approx(math.sqrt(0.2 / 2 / 5))


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fewer_than_three_points_have_neither(count):
    n = np.array([5.0, 10.0])[:count]
    assert all(map(math.isnan, growth_exponent(n, n)))
