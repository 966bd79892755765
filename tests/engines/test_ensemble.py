"""Many trajectories at once: those of one at a time, whatever runs beside them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import pendbench as pb
from pendbench.base.errors import InputError
from pendbench.physics.exact import single_pendulum
from pendbench.physics.kernels.ensemble import ensemble_system_of, write_ensemble_accelerations
from pendbench.physics.kernels.recursion import accelerations
from pendbench.scene.scene import load_scene
from support.kernels import called
from support.scenes import chain, random_chain

DOUBLE = load_scene("double")


def starts(count, n=2, seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(-3.0, 3.0, (count, n)), rng.uniform(-2.0, 2.0, (count, n))


@pytest.mark.parametrize("n", [1, 2, 3, 20])
@pytest.mark.parametrize("lanes", [1, 7, 64])
def test_accelerations_are_those_of_one_chain(n, lanes):
    scene = random_chain(n, 5)
    theta, omega = (part.T.copy() for part in starts(lanes, n))
    theta[0, 0] = 3e7  # where sines are left to libm
    found = np.empty_like(theta)
    called(write_ensemble_accelerations)(ensemble_system_of(scene, lanes), theta, omega, found)
    for b in range(lanes):
        expected = accelerations(scene, theta[:, b], omega[:, b])
        np.testing.assert_allclose(found[:, b], expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(("method", "dt"), [("adaptive", None), ("rk4", 0.01)])
@pytest.mark.parametrize("n", [1, 3])
def test_trajectories_are_those_of_one_at_a_time(method, dt, n):
    scene = random_chain(n, 2)
    theta, omega = starts(150, n)
    times = [0.0, 0.3, 1.0]
    settings = {"tolerance": 1e-10} if dt is None else {}
    found = pb.simulate_ensemble(scene, theta, omega, method=method, dt=dt, times=times, **settings)
    assert found.theta.shape == found.omega.shape == (3, 150, n)
    assert set(found.status) == {"ok"}
    for each in (0, 63, 64, 149):
        one = pb.simulate(scene.with_start(theta[each], omega[each]), method=method, dt=dt, times=times, **settings)
        np.testing.assert_allclose(found.theta[:, each], one.theta, rtol=0, atol=1e-11)
        np.testing.assert_allclose(found.omega[:, each], one.omega, rtol=0, atol=1e-10)


def test_company_and_threads_change_no_bit():
    theta, omega = starts(9000)
    whole = pb.simulate_ensemble(DOUBLE, theta, omega, times=[1.0], threads=2)
    alone = pb.simulate_ensemble(DOUBLE, theta[:9000:1000], omega[:9000:1000], times=[1.0], threads=1)
    np.testing.assert_array_equal(whole.theta[:, ::1000], alone.theta)


def test_default_is_accurate_to_a_millionth():
    scene = chain(1, angle=0.0, length=1.0, duration=20.0)
    angles = np.linspace(0.1, 3.0, 40)[:, None]
    found = pb.simulate_ensemble(scene, angles)
    assert list(found.t) == [20.0]
    for each, angle in enumerate(angles):
        exact, _ = single_pendulum(scene.with_start(angle, np.zeros(1)), np.array([20.0]))
        assert abs(found.theta[0, each, 0] - exact[0, 0]) < 1e-6


def test_lighter_tolerance_is_less_accurate():
    theta, _ = starts(50)
    fine, coarse = (pb.simulate_ensemble(DOUBLE, theta, times=[1.0], tolerance=tol).theta for tol in (1e-12, 1e-4))
    assert 1e-7 < np.abs(fine - coarse).max() < 1e-2


def test_start_that_cannot_be_followed_leaves_the_others_alone():
    theta, omega = starts(100)
    omega[17] = 1e9
    found = pb.simulate_ensemble(DOUBLE, theta, omega, method="rk4", dt=0.1, times=[0.5, 1.0])
    others = np.arange(100) != 17
    without = pb.simulate_ensemble(DOUBLE, theta[others], omega[others], method="rk4", dt=0.1, times=[0.5, 1.0])
    np.testing.assert_array_equal(found.theta[:, others], without.theta)
    assert set(found.status[others]) == {"ok"}


@pytest.mark.parametrize("rate", [1e4, 1e6, 1e9])
def test_fast_spin_is_followed_or_given_up_and_never_endless(rate):
    """A first step of any length overflows the stages here: what is not finite must shrink the step."""
    found = pb.simulate_ensemble(DOUBLE, [[0.1, 0.2]] * 3, [[0.0, rate], [1.0, 1.0], [rate, rate]], most_steps=20_000)
    assert list(found.status) == ["work limit", "ok", "work limit"]
    short = pb.simulate_ensemble(DOUBLE, [[0.1, 0.2]], [[0.0, rate]], times=[10.0 / rate])
    one = pb.simulate(DOUBLE.with_start([0.1, 0.2], [0.0, rate]), times=[10.0 / rate])
    assert list(short.status) == ["ok"]
    np.testing.assert_allclose(short.theta[0], one.theta, rtol=0, atol=1e-8)


def test_fixed_steps_are_taken_as_simulate_takes_them():
    for dt, times in ((1, [1.0]), (0.1, [0.30000000000000004, 0.7]), (0.1, [0.0])):
        many = pb.simulate_ensemble(DOUBLE, [[0.1, 0.2]], method="rk4", dt=dt, times=times)
        one = pb.simulate(DOUBLE.with_start([0.1, 0.2], [0.0, 0.0]), method="rk4", dt=dt, times=times)
        np.testing.assert_array_equal(many.t, one.t)
        np.testing.assert_allclose(many.theta[:, 0], one.theta, rtol=0, atol=1e-12)


def test_progress_is_told_and_can_cancel():
    theta, _ = starts(10_000)
    told = []
    pb.simulate_ensemble(DOUBLE, theta, times=[0.01], progress=lambda done, total: told.append((done, total)))
    assert told == [(4096, 10_000), (8192, 10_000), (10_000, 10_000)]

    def stop(_done, _total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pb.simulate_ensemble(DOUBLE, theta, times=[0.01], progress=stop)


def test_flip_of_a_single_pendulum_is_when_theory_says():
    """Over the top from the bottom: t = sqrt(l/g) K(1/m) / k with m > 1."""
    scene = chain(1, angle=0.0, length=1.0, duration=5.0)
    rates = np.array([[7.0], [-9.0], [6.0]])
    found = pb.first_flips(scene, np.zeros((3, 1)), rates)
    for each, rate in enumerate([7.0, 9.0]):
        fine = np.linspace(0.0, 2.0, 200_001)
        theta, _ = single_pendulum(scene.with_start(np.zeros(1), np.array([rate])), fine)
        assert found[each] == pytest.approx(float(np.interp(math.pi, theta[:, 0], fine)), abs=1e-6)
    assert math.isinf(found[2])


def test_flips_are_those_that_trajectories_show():
    theta, _ = starts(300)
    found = pb.first_flips(DOUBLE, theta)
    times = np.linspace(0.0, 10.0, 2001)
    seen = pb.simulate_ensemble(DOUBLE, theta, times=times)
    over = np.abs(seen.theta).max(axis=2) > math.pi
    for each in range(300):
        first = times[over[:, each].argmax()] if over[:, each].any() else math.inf
        assert math.isinf(first) == math.isinf(found[each])
        assert math.isinf(first) or first - 0.005 - 1e-6 <= found[each] <= first + 1e-6


def test_flip_that_turns_back_within_a_step_is_seen():
    """Steps of a light tolerance are long: their ends alone miss 11 of these flips, the cubic between them 1."""
    theta, omega = starts(20_000)
    scene = replace(DOUBLE, duration=2.0)
    seen, fine = (pb.first_flips(scene, theta, omega, tolerance=tolerance) for tolerance in (1e-6, 1e-12))
    assert 0 < np.isfinite(fine).sum() < 20_000
    assert np.count_nonzero(np.isinf(seen) != np.isinf(fine)) <= 3


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"angles": [0.1, 0.2]}, "angles has shape (2,); allowed: (K, 2)"),
        ({"angles": [[0.1]]}, "angles has shape (1, 1); allowed: (K, 2)"),
        ({"angles": np.zeros((0, 2))}, "angles has shape (0, 2)"),
        ({"angles": [[0.1, "x"]]}, "angles is no table of numbers"),
        ({"angles": [[0.1, math.nan]]}, "angles holds a number out of range"),
        ({"angles": [[0.1, 0.2]], "rates": [[1.0, 2.0]] * 2}, "rates has shape (2, 2); allowed: that of angles"),
        ({"angles": [[0.1, 0.2]], "method": "gauss4"}, "unknown method 'gauss4'"),
        ({"angles": [[0.1, 0.2]], "dt": 0.1}, "dt is 0.1; allowed: none"),
        ({"angles": [[0.1, 0.2]], "method": "rk4", "dt": 10**400}, "allowed: a number from 1e-50 to 1e"),
        ({"angles": [[0.1, 0.2]], "method": "rk4", "dt": 1e-320}, "allowed: a number from 1e-50 to 1e"),
        ({"angles": [[0.1, 0.2]], "method": "rk4", "dt": True}, "dt is true; allowed: a number from 1e-50 to 1e"),
        ({"angles": [[0.1, 0.2]], "method": "rk4"}, "dt is missing; allowed: a number from 1e-50"),
        ({"angles": [[0.1, 0.2]], "method": "rk4", "dt": 0.3, "times": [1.0]}, "whole multiples of dt = 0.3 s"),
        ({"angles": [[0.1, 0.2]], "times": [1.0, 0.5]}, "times is not in order"),
        ({"angles": [[0.1, 0.2]], "tolerance": 0.1}, "tolerance is 0.1; allowed"),
        ({"angles": [[0.1, 0.2]], "method": "rk4", "dt": 1e-30}, "dt is 1e-30; allowed: 1e-08 or more, for 1e+09"),
        ({"angles": [[0.1, 0.2]], "method": "rk4", "dt": 1e-49}, "allowed: 1e-08 or more"),
        (
            {"angles": [[0.1, 0.2]], "method": "rk4", "dt": 0.01, "times": [0.01, 0.010000005]},
            "closer together than dt",
        ),
        (
            {"angles": [[0.1, 0.2]], "method": "rk4", "dt": 0.01, "times": [1e-3]},
            "times has 0.001 s; allowed: whole multiples",
        ),
        ({"angles": [[0.1, 0.2]], "times": ["x"]}, "times is not a list of numbers"),
        ({"angles": [[0.1, 10**400]]}, "angles is no table of numbers"),
        ({"angles": [[0.1, 0.2]], "progress": 5}, "progress is 5; allowed: a function"),
        ({"angles": [[0.1, 0.2]], "most_steps": 0}, "most_steps is 0; allowed: a whole number from 1"),
        ({"angles": [[0.1, 0.2]], "threads": 0}, "threads is 0; allowed: 1 to 1024"),
    ],
)
def test_bad_input_is_one_line(arguments, says):
    with pytest.raises(InputError) as error:
        pb.simulate_ensemble(DOUBLE, **arguments)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_flip_that_has_happened_already_is_refused():
    with pytest.raises(InputError, match="one begins beyond pi"):
        pb.first_flips(DOUBLE, [[3.2, 0.0]])
