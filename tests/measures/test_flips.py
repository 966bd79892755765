"""Maps of flip times: their pixels, their edge, where two of them differ, and when a run first flips."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendbench.measures.flips import (
    agreement,
    coarse_pixels,
    difference,
    edge_of,
    first_flip,
    grid_angles,
    mirrored,
    pixel_angles,
)

INF, NAN = math.inf, math.nan


def test_difference():
    one = np.array([1.0, 1.0, INF, INF, 1.0, NAN, INF])
    other = np.array([1.0, 1.5, INF, 2.0, INF, 1.0, NAN])
    np.testing.assert_array_equal(difference(one, other), [0.0, 0.5, 0.0, INF, INF, NAN, NAN])


def test_edge_is_a_pixel_and_its_eight_neighbours():
    flips = np.full((6, 7), 2.0)
    flips[2, 3] = 2.2
    expected = np.zeros((6, 7), bool)
    expected[1:4, 2:5] = True
    np.testing.assert_array_equal(edge_of(flips, 0.1), expected)
    assert not edge_of(flips, 0.3).any()


def test_edge_where_one_flips_and_its_neighbour_does_not():
    flips = np.array([[INF, INF, INF, 9.0], [INF, INF, INF, INF]])
    np.testing.assert_array_equal(edge_of(flips, 100.0), [[False, False, True, True]] * 2)


def test_edge_does_not_go_round_the_border():
    flips = np.tile([1.0, 2.0, 3.0, 4.0], (4, 1))
    assert not edge_of(flips, 1.5).any()
    assert edge_of(flips, 0.5).all()


def test_what_is_not_known_makes_no_edge():
    flips = np.full((3, 3), 1.0)
    flips[1, 1] = NAN
    assert not edge_of(flips, 0.1).any()


def test_agreement_counts():
    expected = np.array([1.0, 1.0, 1.0, INF, 2.0, NAN, 3.0])
    flips = np.array([1.0, 1.3, 1.05, 4.0, INF, 1.0, NAN])
    edge = np.array([True, True, False, True, False, True, False])
    found = agreement(flips, expected, edge, 0.1)
    assert found == (5, 2, 3, 3, 1, INF)
    assert agreement(flips[:4], expected[:4], edge[:4], 0.1).largest_away == pytest.approx(0.05)
    assert math.isnan(agreement(flips[:2], expected[:2], edge[:2], 0.1).largest_away)


@pytest.mark.parametrize("count", [1, 2, 7, 1000])
def test_grid_has_its_mirror_image(count):
    grid = grid_angles(count)
    np.testing.assert_array_equal(grid, -grid[::-1])
    np.testing.assert_allclose(np.diff(grid), 2 * math.pi / count)
    assert len(grid) == count
    assert grid[-1] == pytest.approx(math.pi - math.pi / count)


def test_pixels_are_numbered_row_by_row():
    grid = grid_angles(5)
    np.testing.assert_array_equal(pixel_angles(5, np.array([0, 7])), [[grid[0], grid[0]], [grid[1], grid[2]]])


def test_coarse_pixels_are_spread_evenly():
    np.testing.assert_array_equal(coarse_pixels(4, 4), np.arange(16))
    np.testing.assert_array_equal(coarse_pixels(10, 2), [22, 27, 72, 77])
    rows = np.unique(coarse_pixels(1000, 40) // 1000)
    np.testing.assert_array_equal(np.diff(rows), 25)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_first_flip_is_that_of_the_cubic(side):
    """The angle 3 + (t - 1)^3 is a cubic itself: when it is pi is known."""
    t = np.linspace(0.0, 3.0, 7)
    theta = np.stack([0.0 * t, side * (3.0 + (t - 1.0) ** 3)], axis=1)
    omega = np.stack([0.0 * t, side * 3.0 * (t - 1.0) ** 2], axis=1)
    assert first_flip(t, theta, omega) == pytest.approx(1.0 + (math.pi - 3.0) ** (1 / 3), abs=1e-9)
    assert first_flip(t[:4], theta[:4], omega[:4]) == INF
    assert first_flip(t[:0], theta[:0], omega[:0]) == INF


def test_a_rod_that_begins_beyond_the_top_has_passed_it_at_once():
    assert first_flip(np.array([1.0, 2.0]), np.array([[0.0, -3.2], [0.0, -3.3]]), np.zeros((2, 2))) == 1.0


def test_earlier_of_two_rods_is_the_first():
    t = np.array([0.0, 1.0])
    theta, omega = np.array([[3.0, 3.1], [4.0, 4.1]]), np.ones((2, 2))
    assert first_flip(t, theta, omega) == pytest.approx(math.pi - 3.1)


def test_mirror_is_the_map_turned_upside_down_and_round():
    np.testing.assert_array_equal(mirrored(np.array([[1.0, 2.0], [3.0, 4.0]])), [[4.0, 3.0], [2.0, 1.0]])
