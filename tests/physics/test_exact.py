"""Closed forms: the single pendulum against high precision and a numerical solution, normal modes against Laguerre."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk, jn_zeros, roots_laguerre

from pendbench.base.errors import InputError
from pendbench.physics import dense
from pendbench.physics.energy import energy, energy_scale
from pendbench.physics.exact import normal_modes, single_pendulum
from pendbench.scene.scene import Effects, Scene

GRAVITY = 9.81
EPS = np.finfo(float).eps
TOP_RATE = 2.0 * np.sqrt(GRAVITY)  # from the lowest point of a pendulum of 1 m, this just reaches the top

SWINGING = [(1.5, 0.0), (-2.0, 3.0), (2.0, -3.0), (3.1, 0.0), (1e-9, 0.0), (0.0, 0.01), (20.0, 1.0)]
TURNING = [(0.3, 7.0), (0.3, -7.0), (3.0, 0.5), (-3.0, -1.0), (0.5, 100.0), (-20.0, 9.0)]
NEAR_THE_TOP = [(np.pi - 1e-3, 0.0), (np.pi - 1e-6, 0.0), (np.pi - 1e-9, 0.0), (1e-9 - np.pi, 0.0), (np.pi, 0.0)]


def pendulum(angle, rate, length=1.0, gravity=GRAVITY):
    return Scene("test", "", 1.0, [1.3], [length], [angle], [rate], Effects(gravity=gravity))


def chain(masses, lengths, gravity=GRAVITY):
    n = len(masses)
    return Scene("test", "", 1.0, masses, lengths, np.zeros(n), np.zeros(n), Effects(gravity=gravity))


def fifty_digits(angle, rate, length, time):
    """theta and omega from mpmath's elliptic functions, and the bound (E27) on their error in double precision."""  # noqa: D403
    with mpmath.workdps(50):
        a, v, t = (mpmath.mpf(float(x)) for x in (angle, rate, time))
        w = mpmath.sqrt(mpmath.mpf(GRAVITY) / mpmath.mpf(length))
        turns = mpmath.nint(a / (2 * mpmath.pi))
        a -= 2 * mpmath.pi * turns
        direction = -1 if v < 0 else 1
        a, v = direction * a, direction * v
        m = mpmath.sin(a / 2) ** 2 + (v / (2 * w)) ** 2
        swings, k = m < 1, mpmath.sqrt(m)
        parameter = m if swings else 1 / m
        pace, phase = (w, mpmath.atan2(mpmath.sin(a / 2), v / (2 * w))) if swings else (k * w, a / 2)
        half_period = 2 * mpmath.ellipk(parameter)
        argument = mpmath.ellipf(phase, parameter) + pace * t
        j = mpmath.nint(argument / half_period)
        sn, cn, dn = (mpmath.ellipfun(f, argument - j * half_period, m=parameter) for f in ("sn", "cn", "dn"))
        sign = (-1) ** int(j)
        theta = 2 * mpmath.atan2(k * sign * sn, dn) if swings else 2 * (mpmath.atan2(sn, cn) + j * mpmath.pi)
        omega = 2 * w * k * (sign * cn if swings else dn)
        # Only a start with a rate has an uncertain 1 - m.
        stretch = max(1, 1 / ((1 - parameter) * half_period)) if v else 1
        phase_error = 4 * EPS * (1 + w * t) * stretch
        return float(direction * theta + 2 * mpmath.pi * turns), float(direction * omega), float(phase_error)


@pytest.mark.parametrize("length", [1.0, 0.3])
@pytest.mark.parametrize(("angle", "rate"), SWINGING + TURNING + NEAR_THE_TOP)
def test_fifty_digits_agree_for_two_thousand_seconds(angle, rate, length):
    times = np.array([0.0, 0.1, 0.77, 5.3, 123.4, 2000.0])
    theta, omega = single_pendulum(pendulum(angle, rate, length), times)
    w = np.sqrt(GRAVITY / length)
    fastest = np.hypot(rate, 2 * w * np.sin(angle / 2))  # at the lowest point, by conservation of energy
    for k, time in enumerate(times):
        expected, expected_rate, phase_error = fifty_digits(angle, rate, length, time)
        # The phase w t runs off; theta changes by at most `fastest` and omega by at most w^2 in a second.
        assert abs(theta[k, 0] - expected) <= fastest / w * phase_error + 4 * EPS * abs(expected)
        assert abs(omega[k, 0] - expected_rate) <= w * phase_error + 4 * EPS * fastest


@pytest.mark.parametrize(("angle", "rate"), [(1.5, 0.0), (-2.0, 3.0), (0.3, 7.0), (-0.3, -12.0)])
def test_ten_seconds_solved_numerically_agree(angle, rate):
    scene, times = pendulum(angle, rate), np.linspace(0.0, 10.0, 41)
    solved = solve_ivp(
        lambda _, y: (y[1], -GRAVITY * np.sin(y[0])),
        (0.0, 10.0),
        [angle, rate],
        method="DOP853",
        t_eval=times,
        rtol=1e-13,
        atol=1e-13,
    )
    theta, omega = single_pendulum(scene, times)
    # A tolerance of 1e-13 for each step, some hundred steps, and errors that grow no faster than the time.
    np.testing.assert_allclose(theta[:, 0], solved.y[0], rtol=0, atol=1e-10)
    np.testing.assert_allclose(omega[:, 0], solved.y[1], rtol=0, atol=1e-10)


@pytest.mark.parametrize(("angle", "rate"), SWINGING + TURNING + NEAR_THE_TOP + [(0.0, TOP_RATE), (1.0, 0.0)])
def test_energy_stays(angle, rate):
    scene = pendulum(angle, rate)
    theta, omega = single_pendulum(scene, np.linspace(0.0, 50.0, 501))
    found = energy(scene, theta, omega)
    # An angle is rounded by half an EPS of itself, and full turns are counted in it.
    assert np.ptp(found) < EPS * (40 + np.abs(theta).max()) * energy_scale(scene)


@pytest.mark.parametrize(("angle", "rate"), TURNING)
def test_turning_is_continuous_and_one_way(angle, rate):
    theta, _ = single_pendulum(pendulum(angle, rate), np.linspace(0.0, 20.0, 20001))
    steps = np.sign(rate) * np.diff(theta[:, 0])
    assert np.all(steps > 0.0)
    assert steps.max() < 0.11  # at most 101 rad/s for 1 ms


def test_period_is_the_complete_integral():
    scene = pendulum(2.0, 0.0)
    period = 4.0 * ellipk(np.sin(1.0) ** 2) / np.sqrt(GRAVITY)
    theta, omega = single_pendulum(scene, period * np.array([0.25, 0.5, 1.0]))
    np.testing.assert_allclose(theta[:, 0], [0.0, -2.0, 2.0], atol=1e-14)
    np.testing.assert_allclose(omega[1:, 0], 0.0, atol=1e-13)


def test_small_swing_is_harmonic():
    size, times = 1e-6, np.linspace(0.0, 10.0, 101)
    theta, _ = single_pendulum(pendulum(size, 0.0), times)
    # The period grows by size^2 / 16 of itself: 2e-12 rad in phase after 10 s.
    np.testing.assert_allclose(theta[:, 0], size * np.cos(np.sqrt(GRAVITY) * times), rtol=0, atol=3e-12 * size)


def test_mirror_image_and_time_backwards():
    times = np.linspace(0.0, 9.0, 10)
    for angle, rate in SWINGING + TURNING:
        theta, omega = single_pendulum(pendulum(angle, rate), times)
        mirrored, mirrored_rate = single_pendulum(pendulum(-angle, -rate), times)
        back, back_rate = single_pendulum(pendulum(angle, -rate), -times)
        np.testing.assert_allclose(mirrored, -theta, rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(mirrored_rate, -omega, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(back, theta, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(back_rate, -omega, rtol=1e-12, atol=1e-12)


def test_rest_at_the_bottom_stays():
    theta, omega = single_pendulum(pendulum(0.0, 0.0), np.linspace(0.0, 5.0, 6))
    assert not theta.any()
    assert not omega.any()


def test_border_climbs_to_the_top_and_stays():
    times = np.array([0.0, 1.0, 3.0, 8.0])
    theta, omega = single_pendulum(pendulum(0.0, TOP_RATE), times)
    expected = 4.0 * np.arctan(np.exp(np.sqrt(GRAVITY) * times)) - np.pi
    np.testing.assert_allclose(theta[:, 0], expected, rtol=4 * EPS)
    np.testing.assert_allclose(omega[:, 0], TOP_RATE / np.cosh(np.sqrt(GRAVITY) * times), rtol=0, atol=1e-14)
    far, rest = single_pendulum(pendulum(0.0, TOP_RATE), np.array([2000.0]))
    np.testing.assert_allclose(far, np.pi, rtol=4 * EPS)
    assert abs(rest[0, 0]) < 1e-14


@pytest.mark.parametrize("gravity", [None, 0.0])
def test_no_gravity_is_a_steady_turn(gravity):
    times = np.array([0.0, 1.0, 1000.0])
    theta, omega = single_pendulum(pendulum(0.5, -3.0, gravity=gravity), times)
    np.testing.assert_array_equal(theta[:, 0], 0.5 - 3.0 * times)
    np.testing.assert_array_equal(omega[:, 0], np.full(3, -3.0))


def test_two_links_are_refused():
    with pytest.raises(InputError, match="2 links"):
        single_pendulum(chain([1.0, 1.0], [1.0, 1.0]), np.zeros(1))


@pytest.mark.parametrize("n", [1, 2, 3, 10, 50])
def test_modes_of_equal_links_are_laguerre_roots(n):
    frequencies, _ = normal_modes(chain(np.full(n, 0.3), np.full(n, 0.2)))
    expected = np.sqrt(GRAVITY / 0.2 * roots_laguerre(n)[0])
    np.testing.assert_allclose(frequencies, expected, rtol=8 * n * EPS)


def test_modes_of_a_long_chain_are_those_of_a_rope():
    n = 100
    frequencies, _ = normal_modes(chain(np.full(n, 1.0 / n), np.full(n, 1.0 / n)))
    # The first mode of the continuous rope; n lumps miss it by about 1 / (4 n).
    np.testing.assert_allclose(frequencies[0], jn_zeros(0, 1)[0] / 2 * np.sqrt(GRAVITY), rtol=1 / n)
    assert 0.96 < frequencies[-1] / (2 * n * np.sqrt(GRAVITY)) < 1.0


def test_modes_solve_the_linear_equation_of_motion():
    scene = chain([1.0, 0.2, 3.0, 0.5], [0.4, 1.0, 0.7, 0.2])
    frequencies, shapes = normal_modes(scene)
    assert np.all(np.diff(frequencies) > 0)
    np.testing.assert_array_equal(shapes.max(axis=0), np.ones(4))
    small = 1e-7
    for frequency, shape in zip(frequencies, shapes.T, strict=True):
        found = dense.accelerations(scene, small * shape, np.zeros(4)) / small
        # What is left out is small^2 of the whole, magnified by the condition of the mass matrix (some hundreds).
        np.testing.assert_allclose(found, -(frequency**2) * shape, rtol=0, atol=1e-11 * frequencies[-1] ** 2)


@pytest.mark.parametrize("gravity", [None, 0.0])
def test_modes_need_gravity(gravity):
    with pytest.raises(InputError, match="no gravity"):
        normal_modes(chain([1.0, 1.0], [1.0, 1.0], gravity))
