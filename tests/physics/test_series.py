"""The chain's Taylor series: against the dense form, order by order, and against exact motions."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import polynomial

from pendbench.physics.exact import single_pendulum
from pendbench.physics.kernels.recursion import accelerations
from pendbench.physics.kernels.single import HIGHEST
from pendbench.physics.kernels.table import series_system_of
from pendbench.solvers import problem
from support.hard_chains import HARD, exact_accelerations, hard_chains, relative_error
from support.kernels import called
from support.scenes import chain, random_chain


def rate_series(scene, order, system=None):
    """The Taylor coefficients (order + 1, n) of the rates at the scene's start."""
    omega = np.full((order + 1, scene.n), np.nan)
    omega[0] = scene.rates
    called(problem.rate_series)(system or series_system_of(scene, order), 0.0, scene.angles, omega)
    return omega


def times(a, b, order):
    """The product of two series (order + 1,), cut off."""
    return polynomial.polymul(a, b)[: order + 1]


def cosine_and_sine(angle):
    """Of a series: c' = -s angle', s' = c angle'."""
    c, s = np.zeros_like(angle), np.zeros_like(angle)
    c[0], s[0] = np.cos(angle[0]), np.sin(angle[0])
    for k in range(1, len(angle)):
        share = np.arange(1, k + 1) * angle[1 : k + 1] / k
        c[k], s[k] = -share @ s[k - 1 :: -1][:k], share @ c[k - 1 :: -1][:k]
    return c, s


def dense_series(scene, order):
    """The same coefficients from (E6): C theta'' = S omega^2 - h, solved anew for each order."""
    n, hanging = scene.n, np.cumsum(scene.masses[::-1])[::-1]
    theta, omega = np.zeros((n, order + 2)), np.zeros((n, order + 1))
    theta[:, 0], omega[:, 0] = scene.angles, scene.rates
    for k in range(order):
        theta[:, k + 1] = omega[:, k] / (k + 1)
        left, right = np.zeros((n, n, k + 1)), np.zeros((n, k + 1))
        for i in range(n):
            moment = hanging[i] * (scene.effects.gravity or 0.0) * scene.lengths[i]
            right[i] -= moment * cosine_and_sine(theta[i, : k + 1])[1]
            for j in range(n):
                c, s = cosine_and_sine((theta[j] - theta[i])[: k + 1])
                weight = hanging[max(i, j)] * scene.lengths[i] * scene.lengths[j]
                left[i, j] = weight * c
                right[i] += times(weight * s, times(omega[j, : k + 1], omega[j, : k + 1], k), k)
        known = sum((left[:, :, k - j] @ (omega[:, j + 1] * (j + 1)) for j in range(k)), np.zeros(n))
        omega[:, k + 1] = np.linalg.solve(left[:, :, 0], right[:, k] - known) / (k + 1)
    return omega.T


@pytest.mark.parametrize("n", [1, 2, 3, 7])
@pytest.mark.parametrize("gravity", [9.81, None])
def test_every_order_agrees_with_the_dense_form(n, gravity):
    for seed in range(5):
        scene = random_chain(n, seed, spread=2.0, gravity=gravity)
        found, expected = rate_series(scene, 12), dense_series(scene, 12)
        size = np.abs(expected).max(axis=1, keepdims=True)
        size[size == 0.0] = 1.0
        np.testing.assert_allclose(found / size, expected / size, rtol=0, atol=1e-11)


@pytest.mark.parametrize("order", range(1, HIGHEST + 1))
def test_a_pendulum_has_the_orders_that_are_asked_for_and_no_others(order):
    scene = random_chain(1, 6, spread=2.0)
    room = np.full((HIGHEST + 2, 1), np.nan)
    room[0] = scene.rates
    called(problem.rate_series)(series_system_of(scene, order), 0.0, scene.angles, room[: order + 1])
    expected = dense_series(scene, order)
    size = np.abs(expected).max()
    np.testing.assert_allclose(room[: order + 1] / size, expected / size, rtol=0, atol=1e-12)
    assert np.isnan(room[order + 1 :]).all()


def test_a_pendulum_of_a_higher_order_is_refused():
    with pytest.raises(ValueError, match=f"a series of order {HIGHEST + 1}; allowed: up to {HIGHEST}"):
        series_system_of(chain(1, angle=1.0), HIGHEST + 1)


@pytest.mark.parametrize("kind", HARD)
def test_first_order_is_the_acceleration_in_hard_chains(kind):
    worst = max(relative_error(rate_series(s, 1)[1], exact_accelerations(s)) for s in hard_chains(kind, range(5)))
    assert worst < 1e-13


def test_first_order_is_that_of_the_recursion_at_any_angle():
    scene = chain(4, angle=[0.3, 1e6, -2e5, 3e8], rate=[1.0, -2.0, 0.5, 3.0])
    expected = accelerations(scene, scene.angles, scene.rates)
    np.testing.assert_allclose(rate_series(scene, 1)[1], expected, rtol=1e-13)


def test_sum_is_the_exact_pendulum():
    scene = chain(1, angle=2.0, rate=1.0)
    h = 0.05
    _, omega = single_pendulum(scene, np.array([h]))
    series = rate_series(scene, 20)[:, 0]
    assert polynomial.polyval(h, series) == pytest.approx(omega[0, 0], rel=1e-14)


def test_free_rod_turns_evenly():
    np.testing.assert_array_equal(rate_series(chain(1, rate=3.0, gravity=None), 8)[1:], 0.0)


def test_mirror_image_has_the_same_series():
    scene = random_chain(5, 3, spread=2.0)
    mirrored = chain(5, angle=-scene.angles, rate=-scene.rates, length=scene.lengths, mass=scene.masses)
    np.testing.assert_array_equal(rate_series(mirrored, 10), -rate_series(scene, 10))


def test_backwards_in_time_odd_orders_of_the_rates_stay():
    scene = random_chain(5, 4, spread=2.0)
    reversed_ = chain(5, angle=scene.angles, rate=-scene.rates, length=scene.lengths, mass=scene.masses)
    signs = -((-1.0) ** np.arange(11))[:, None]
    np.testing.assert_array_equal(rate_series(reversed_, 10), signs * rate_series(scene, 10))


def test_room_that_has_been_used_before_leaves_no_trace():
    scene, other = (random_chain(4, seed, spread=3.0) for seed in (1, 2))
    system = series_system_of(scene, 9)
    first = rate_series(scene, 9, system)
    called(problem.rate_series)(system, 0.0, other.angles, np.vstack([other.rates, np.zeros((9, 4))]))
    np.testing.assert_array_equal(rate_series(scene, 9, system), first)
