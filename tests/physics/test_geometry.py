"""Positions, velocities, distances and wrapped angles."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from pendbench.physics.geometry import distance, positions, velocities, wrapped

LENGTHS = np.array([1.0, 0.5, 2.0])
EPS = np.finfo(float).eps


def test_hanging_chain_is_below_the_pivot():
    np.testing.assert_array_equal(positions(LENGTHS, np.zeros(3)), [[0, -1.0], [0, -1.5], [0, -3.5]])


def test_counter_clockwise_is_positive_and_angles_are_absolute():
    found = positions(LENGTHS, np.array([np.pi / 2, np.pi / 2, np.pi]))
    np.testing.assert_allclose(found, [[1.0, 0.0], [1.5, 0.0], [1.5, 2.0]], atol=4 * EPS)


def test_rods_keep_their_lengths():
    theta = np.random.default_rng(1).uniform(-9, 9, (7, 3))
    ends = np.concatenate([np.zeros((7, 1, 2)), positions(LENGTHS, theta)], axis=1)
    rods = np.linalg.norm(np.diff(ends, axis=1), axis=-1)
    np.testing.assert_allclose(rods, np.broadcast_to(LENGTHS, (7, 3)), rtol=16 * EPS)


def test_velocities_are_the_slopes_of_positions():
    rng = np.random.default_rng(2)
    theta, omega, step = rng.uniform(-3, 3, 3), rng.uniform(-3, 3, 3), 1e-5
    ahead, behind = (positions(LENGTHS, theta + sign * step * omega) for sign in (1, -1))
    # Central differences: the third derivative is below L max(omega)^3 = 95, so the error is below 95 step^2 / 6.
    np.testing.assert_allclose(velocities(LENGTHS, theta, omega), (ahead - behind) / (2 * step), rtol=0, atol=2e-9)


def test_many_states_are_the_same_as_one_by_one():
    rng = np.random.default_rng(3)
    theta, omega = rng.uniform(-3, 3, (2, 5, 3))
    for k in range(5):
        np.testing.assert_array_equal(positions(LENGTHS, theta)[k], positions(LENGTHS, theta[k]))
        np.testing.assert_array_equal(velocities(LENGTHS, theta, omega)[k], velocities(LENGTHS, theta[k], omega[k]))
        np.testing.assert_array_equal(distance(LENGTHS, theta, omega)[k], distance(LENGTHS, theta[k], omega[k]))


def test_distance_is_that_of_the_farthest_mass():
    theta, other = np.random.default_rng(4).uniform(-3, 3, (2, 6, 3))
    apart = np.linalg.norm(positions(LENGTHS, other) - positions(LENGTHS, theta), axis=-1)
    np.testing.assert_allclose(distance(LENGTHS, theta, other - theta), apart.max(axis=-1) / 3.5, rtol=64 * EPS)


def test_distance_takes_an_inner_mass_where_that_is_farthest():
    theta, other = np.array([0.0, 0.0, 0.0]), np.array([0.5, -0.1, -0.24])
    apart = np.linalg.norm(positions(LENGTHS, other) - positions(LENGTHS, theta), axis=-1)
    assert apart.argmax() == 0
    np.testing.assert_allclose(distance(LENGTHS, theta, other - theta), apart[0] / 3.5, rtol=64 * EPS)


def test_straight_chain_turned_over_is_two_lengths_away():
    np.testing.assert_allclose(distance(LENGTHS, np.zeros(3), np.full(3, np.pi)), 2.0, rtol=4 * EPS)


@pytest.mark.parametrize("size", [1e-3, 1e-12, 1e-20, 1e-200])
def test_tiny_differences_keep_their_digits(size):
    theta = np.array([0.3, -1.1, 2.2])
    delta = size * np.array([1.0, -0.4, 0.7])
    with mpmath.workdps(450):
        x = y = mpmath.mpf(0)
        apart = []
        for length, angle, turn in zip(LENGTHS, theta, delta, strict=True):
            before, after = mpmath.mpf(float(angle)), mpmath.mpf(float(angle)) + mpmath.mpf(float(turn))
            x += float(length) * (mpmath.sin(after) - mpmath.sin(before))
            y += float(length) * (mpmath.cos(before) - mpmath.cos(after))
            apart.append(mpmath.hypot(x, y) / mpmath.mpf(3.5))
        expected = float(max(apart))
    np.testing.assert_allclose(distance(LENGTHS, theta, delta), expected, rtol=16 * EPS)


def test_no_difference_is_no_distance():
    assert distance(LENGTHS, np.array([0.3, 4.0, -2.0]), np.zeros(3)) == 0.0


def test_a_full_turn_is_no_distance():
    assert distance(LENGTHS, np.array([0.3, 4.0, -2.0]), np.array([2 * np.pi, -2 * np.pi, 0.0])) < 4 * EPS


@pytest.mark.parametrize("angle", [0.0, 1e-300, -1e-17, 3.0, -3.0, np.pi, np.nextafter(-np.pi, 0.0)])
def test_wrapping_leaves_angles_in_range_alone(angle):
    assert wrapped(np.array(angle)) == angle


def test_wrapping_is_open_below_and_closed_above():
    assert wrapped(np.array(-np.pi)) == np.pi
    assert wrapped(np.array(np.nextafter(np.pi, 4.0))) < 0.0


def test_wrapping_keeps_the_direction():
    angle = np.linspace(-1000.0, 1000.0, 999)
    found = wrapped(angle)
    assert np.all((found > -np.pi) & (found <= np.pi))
    np.testing.assert_allclose(np.sin(found), np.sin(angle), rtol=0, atol=1000 * EPS)
    np.testing.assert_allclose(np.cos(found), np.cos(angle), rtol=0, atol=1000 * EPS)
