"""Lyapunov exponents against motions whose exponent is known: Benettin's method, of one start and of many."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.linalg import expm

from pendbench.measures import exponents, lyapunov
from pendbench.measures.exponents import energy_shares, largest_exponents, regular_below, starts_between
from pendbench.measures.lyapunov import lyapunov_exponent, partings, time_unit
from pendbench.physics.energy import energy
from pendbench.scene.scene import load_scene
from support.scenes import chain

DOUBLE = load_scene("double")
UPRIGHT = chain(2, angle=math.pi, length=0.5, duration=1.0)


def saddle(y, other):
    """The linear flow whose neighbours part by a factor of 3 along (1, 1), and are halved along (1, -1)."""
    matrix = 0.5 * np.array([[3.5, 2.5], [2.5, 3.5]])
    return y @ matrix, other @ matrix


def test_neighbours_part_by_the_factor_of_the_flow():
    """From (1, 1) on: the neighbours begin along the direction that grows, so each interval has the whole factor."""
    logs = list(itertools.islice(partings(saddle, np.zeros((4, 2)), 1.0, 1e-6), 5))
    np.testing.assert_allclose(logs, np.full((5, 4), math.log(3.0)), rtol=1e-12)


def test_neighbours_turn_towards_what_grows():
    """With rates in another unit they begin askew: the first intervals have less, and all together det and product."""
    logs = np.array(list(itertools.islice(partings(saddle, np.zeros((1, 2)), 0.1, 1e-6), 30)))[:, 0]
    matrix, weight = 0.5 * np.array([[3.5, 2.5], [2.5, 3.5]]), np.diag([1.0, 0.1])
    start = np.linalg.inv(weight) @ np.full(2, math.sqrt(0.5))
    whole = np.linalg.norm(weight @ np.linalg.matrix_power(matrix, 30) @ start)
    assert logs.sum() == pytest.approx(math.log(whole), rel=1e-12)
    assert abs(logs[0] - math.log(3.0)) > 0.1
    assert logs[-1] == pytest.approx(math.log(3.0), rel=1e-12)


def test_neighbours_begin_as_far_apart_as_is_said():
    """Of three links and rates in a unit of 0.1: what stays where it is has parted by no factor at all."""
    logs = next(partings(lambda y, other: (y, other), np.zeros((2, 6)), 0.1, 1e-6))
    np.testing.assert_allclose(logs, 0.0, atol=1e-12)


def linear_rate(scene, settling, seconds):
    """How fast neighbours part about the upright chain of two equal links, from `settling` s on for `seconds`, 1/s.

    Its small motions: theta'' = (g / l) [[2, -1], [-2, 2]] theta, whose angles are those from the vertical above.
    """
    ratio = scene.effects.gravity / scene.lengths[0]
    block = ratio * np.array([[2.0, -1.0], [-2.0, 2.0]])
    flow = np.block([[np.zeros((2, 2)), np.eye(2)], [block, np.zeros((2, 2))]])
    unit = math.sqrt(scene.lengths.sum() / scene.effects.gravity)
    weight = np.diag([1.0, 1.0, unit, unit])
    start = np.linalg.inv(weight) @ np.full(4, 0.5)
    sizes = [np.linalg.norm(weight @ expm(flow * t) @ start) for t in (settling, settling + seconds)]
    return math.log(sizes[1] / sizes[0]) / seconds


@pytest.mark.parametrize("swings", [3.0, 4.6, 7.4])
def test_exponents_of_many_are_those_of_the_linear_flow(swings):
    """Intervals are 1.5 swings at most; a tenth of them, one at least, is left out, and counts for the rate if not."""
    unit = math.sqrt(UPRIGHT.lengths.sum() / UPRIGHT.effects.gravity)
    seconds = swings * unit
    intervals = math.ceil(swings / 1.5)
    found = largest_exponents(UPRIGHT, np.full((2, 2), math.pi), seconds)
    expected = linear_rate(UPRIGHT, seconds / intervals, seconds)
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert abs(linear_rate(UPRIGHT, 0.0, seconds) - expected) > 1e-3 * expected  # what not settling would give


def test_exponent_of_one_is_that_of_the_linear_flow():
    """Intervals are half a swing, ten at least, and a tenth of them is left out."""
    unit = math.sqrt(UPRIGHT.lengths.sum() / UPRIGHT.effects.gravity)
    found = lyapunov_exponent(UPRIGHT, 5.0 * unit)
    assert found.rate == pytest.approx(linear_rate(UPRIGHT, 0.5 * unit, 5.0 * unit), rel=1e-6)
    assert abs(linear_rate(UPRIGHT, 0.0, 5.0 * unit) - found.rate) > 1e-3 * found.rate


def test_error_is_that_of_the_mean_of_ten_blocks(monkeypatch):
    """Blocks that part by 1, 2, ... 10 per interval: mean 5.5, and a standard error of sqrt(55 / 6 / 10)."""
    logs = itertools.chain([9e9] * 2, np.repeat(np.arange(1.0, 11.0), 2))
    monkeypatch.setattr(lyapunov, "partings", lambda *_: (np.array([log]) for log in logs))
    interval = 0.5 * time_unit(UPRIGHT)
    found = lyapunov_exponent(UPRIGHT, 20.0 * interval)
    assert found.rate == pytest.approx(5.5 / interval)
    assert found.error == pytest.approx(math.sqrt(55.0 / 6.0 / 10.0) / interval)


def given_logs(monkeypatch, scene, logs):
    """The exponent over 20 intervals, 10 in units of sqrt(L / g), after two of them to settle."""
    every = iter([9e9, 9e9, *logs])
    monkeypatch.setattr(lyapunov, "partings", lambda *_: (np.array([log]) for log in every))
    return lyapunov_exponent(scene, 10.0 * time_unit(scene))


@pytest.mark.parametrize(("log", "chaotic"), [(0.344, False), (0.347, True)])
def test_chaotic_is_above_three_times_what_regular_motion_shows(monkeypatch, log, chaotic):
    """Each interval is half a unit, so the rate is twice the logarithm; 3 ln(10) / 10 is 0.6908."""
    assert given_logs(monkeypatch, UPRIGHT, [log] * 20).chaotic == chaotic


@pytest.mark.parametrize(("spread", "chaotic"), [(0.99, True), (1.01, False)])
def test_chaotic_is_above_three_times_its_standard_error(monkeypatch, spread, chaotic):
    """Ten blocks of two intervals, five of them 1 + s and five 1 - s: the mean is 1, its standard error s / 3."""
    logs = np.repeat([1.0 + spread, 1.0 - spread] * 5, 2)
    assert given_logs(monkeypatch, UPRIGHT, logs).chaotic == chaotic


def test_one_pendulum_is_never_chaotic(monkeypatch):
    assert not given_logs(monkeypatch, chain(1), [1.0] * 20).chaotic


def test_two_neighbours_lose_the_same_whole_turns():
    """Of pendulums that hang after three turns and before one, and neighbours a little or a whole turn further on."""
    turn, still = 2.0 * math.pi, np.zeros((3, 2))
    y = np.array([[3.0 * turn, 0.0], [-turn, 0.0], [3.0 * turn, 0.0]])
    further = np.array([[1e-3, 0.0], [1e-3, 0.0], [turn, 0.0]])
    first, second = exponents._advanced(chain(1), 0.3, y, y + further)
    np.testing.assert_allclose(first, still, atol=1e-12)
    swung = 1e-3 * np.array([math.cos(0.3 * math.sqrt(9.81)), -math.sqrt(9.81) * math.sin(0.3 * math.sqrt(9.81))])
    np.testing.assert_allclose(second, [swung, swung, [turn, 0.0]], atol=1e-9)


def test_states_are_advanced_to_each_interval(monkeypatch):
    asked = []

    def advanced(scene, interval, y, other):
        del scene
        asked.append(interval)
        return y, other

    monkeypatch.setattr(exponents, "_advanced", advanced)
    unit = math.sqrt(DOUBLE.lengths.sum() / DOUBLE.effects.gravity)
    assert (largest_exponents(DOUBLE, np.zeros((1, 2)), 30.0 * unit) == 0.0).all()
    np.testing.assert_allclose(asked, np.full(22, 1.5 * unit))  # 20 that count, and a tenth of them before
    asked.clear()
    largest_exponents(DOUBLE, np.zeros((1, 2)), 1.4 * unit)
    np.testing.assert_allclose(asked, np.full(2, 1.4 * unit))  # one that counts, and one before


def test_exponents_are_the_sum_of_what_counts_over_its_time(monkeypatch):
    """Two intervals of 1.5 units that count, after one to settle."""
    logs = iter([np.full(2, 9e9), np.array([0.3, 0.1]), np.array([0.5, -0.2])])
    monkeypatch.setattr(exponents, "partings", lambda *_: logs)
    seconds = 3.0 * time_unit(DOUBLE)
    np.testing.assert_allclose(largest_exponents(DOUBLE, np.zeros((2, 2)), seconds), [0.8 / seconds, -0.1 / seconds])


def test_without_gravity_a_swing_is_one_of_1_m_per_s2():
    assert time_unit(chain(2, length=2.0, gravity=None)) == pytest.approx(2.0)


def test_regular_is_told_by_the_logarithm_of_time():
    """Neighbours of regular motion part as T does: three times ln(T) / T, T in units of sqrt(L / g)."""
    unit = math.sqrt(2.0 / 9.81)
    scene = chain(2, angle=0.1, length=1.0, duration=1.0, gravity=9.81)
    assert regular_below(scene, 100.0) == pytest.approx(3.0 * math.log(100.0 / unit) / 100.0)
    assert time_unit(scene) == pytest.approx(unit)


def test_energy_shares_run_from_hanging_to_upright():
    angles = np.array([[0.0, 0.0], [math.pi, math.pi], [math.pi / 2, math.pi / 2], [0.0, math.pi]])
    np.testing.assert_allclose(energy_shares(DOUBLE, angles), [0.0, 1.0, 0.5, 1 / 3], atol=1e-15)


@pytest.mark.parametrize(("least", "most"), [(0.9, 1.0), (0.4, 0.5)])
def test_starts_have_the_energies_asked_for(least, most):
    angles = starts_between(DOUBLE, least, most, 50, 4)
    assert angles.shape == (50, 2)
    low, high = (energy(DOUBLE, np.full((1, 2), angle), np.zeros((1, 2)))[0] for angle in (0.0, math.pi))
    shares = (energy(DOUBLE, angles, np.zeros_like(angles)) - low) / (high - low)
    assert ((shares >= least) & (shares < most)).all()
    np.testing.assert_array_equal(angles, starts_between(DOUBLE, least, most, 50, 4))


@pytest.mark.parametrize("count", [4096, 4097])
def test_starts_are_as_many_as_asked_for(count):
    """All of the 4096 that are drawn at a time have an energy between none and more than the upright chain's."""
    assert starts_between(DOUBLE, 0.0, 1.1, count, 1).shape == (count, 2)


def test_exponents_are_those_of_one_scene_at_a_time():
    """Both are means over the same time of motions that part: they agree to a few of their standard errors."""
    angles = np.array([[2.0, 2.0], [0.2, 0.1]])
    chaotic, regular = largest_exponents(DOUBLE, angles, 100.0)
    one = lyapunov_exponent(DOUBLE.with_start(angles[0], np.zeros(2)), 100.0)
    assert abs(chaotic - one.rate) < 5 * one.error
    assert regular < regular_below(DOUBLE, 100.0) < 0.2 < chaotic


def test_exponent_of_one_pendulum_falls_with_time():
    """Regular neighbours part linearly: the exponent over T is of the order of ln(T) / T."""
    single = chain(1, angle=0.0, length=1.0, duration=10.0)
    short, long = (largest_exponents(single, np.array([[1.5]]), seconds)[0] for seconds in (50.0, 500.0))
    assert 0.0 < long < 0.3 * short < 0.3 * regular_below(single, 50.0)
