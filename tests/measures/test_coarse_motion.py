"""What of a long chain can be seen from afar, against motions whose errors are known."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from pendbench.measures.coarse_motion import (
    Coarse,
    CoarseErrors,
    coarse_errors,
    coarse_motion,
    first_turn,
    largest_rise,
    why_it_moves_badly,
)
from pendbench.scene.scene import Effects
from support.scenes import chain

RIGHT, UP = 0.5 * np.pi, np.pi


def test_places_are_those_of_the_drawing():
    """Rods of 1 m and 2 m, masses of 3 kg and 1 kg: right then down; down then up, past the pivot."""
    scene = chain(2, length=[1.0, 2.0], mass=[3.0, 1.0])
    found = coarse_motion(scene, np.array([[RIGHT, 0.0], [0.0, UP]]))
    assert found.tip == pytest.approx(np.array([[1.0, -2.0], [0.0, 1.0]]))
    assert found.centre == pytest.approx(np.array([[1.0, -0.5], [0.0, -0.5]]))
    assert found.lowest == pytest.approx([-2.0, -1.0])


def test_a_heavy_rod_counts_half_at_its_outer_end():
    scene = dataclasses.replace(chain(2, length=1.0), effects=Effects(gravity=9.81, rod_mass=2.0))
    found = coarse_motion(scene, np.array([0.0, 0.0]))
    assert found.centre == pytest.approx([0.0, -(3 * 1 + 2 * 2) / 5])  # 1 + 1 + 1 kg and 1 + 1 kg


def swung(angles):
    """The coarse motion of one rod of a metre at angles (k,)."""
    return coarse_motion(chain(1), np.asarray(angles, dtype=float)[:, np.newaxis])


@pytest.mark.parametrize(
    ("angles", "at"),
    [
        ([1.5, 1.0, 0.0, -1.0, -1.2, -1.1, 0.0], 4),
        ([-1.5, -1.0, 0.0, 1.0, 1.2, 1.1, 0.0], 4),  # mirrored
        ([1.5, 1.5, 1.0, 0.5, 0.7], 3),  # at rest for a sample
        ([1.5, 2.5, 3.5, 4.5, 4.4], 3),  # over the top
        ([1.5, 1.0, 0.5], 2),  # never
        ([0.0, 0.0, 0.0], 2),
    ],
)
def test_first_turn_is_where_the_centre_comes_back(angles, at):
    assert first_turn(swung(angles)) == at


def test_a_pendulum_turns_after_half_its_period():
    """Released horizontally: sin(theta/2) = k sn(K - w t, k), k = sin(pi/4), so it turns at 2 K / w."""
    times, rate = 0.001 * np.arange(1500), math.sqrt(9.81)
    quarter = ellipk(0.5)
    motion = swung(2.0 * np.arcsin(math.sqrt(0.5) * ellipj(quarter - rate * times, 0.5)[0]))
    assert times[first_turn(motion)] == pytest.approx(2.0 * quarter / rate, abs=0.001)


def test_errors_are_taken_apart():
    truth = swung(np.linspace(1.5, -1.0, 9))
    off = Coarse(truth.centre, truth.tip.copy(), truth.lowest)
    off.tip[3] += [0.03, 0.04]
    assert coarse_errors(off, truth, 2.0) == pytest.approx((0.0, 0.025, 0.0))
    off = Coarse(truth.centre + np.array([0.0, 0.06]), truth.tip, truth.lowest - 0.02)
    assert coarse_errors(off, truth, 2.0) == pytest.approx((0.03, 0.0, 0.01))


def test_rises_are_measured_from_the_lowest_before():
    assert largest_rise(np.array([5.0, 4.0, 4.5, 2.0, 3.0, 1.0])) == 1.0
    assert largest_rise(np.array([5.0, 4.0, 4.0])) == 0.0
    assert math.isnan(largest_rise(np.array([5.0, np.inf, 4.0])))
    assert math.isnan(largest_rise(np.array([5.0, np.nan, 4.0])))


GOOD = CoarseErrors(0.004, 0.018, 0.011)


@pytest.mark.parametrize(
    ("status", "rise", "gap", "errors", "says"),
    [
        ("ok", 0.0099, 0.0, GOOD, ""),
        ("not finite", 0.0, 0.0, GOOD, "breaks: not finite"),
        ("ok", 0.011, 0.0, GOOD, "the energy rises by 0.011"),
        ("ok", math.nan, 0.0, GOOD, "the energy rises by nan"),
        ("ok", 0.0, 0.011, GOOD, "a rod is off its length by 0.011"),
        ("ok", 0.0, 0.0, GOOD._replace(tip=0.03), "off by 0.03 of the length: tip"),
        ("ok", 0.0, 0.0, CoarseErrors(0.03, 0.01, 0.04), "off by 0.04 of the length: centre, lowest"),
        ("ok", 0.0, 0.0, CoarseErrors(), "not known"),
    ],
)
def test_what_moves_badly_is_told(status, rise, gap, errors, says):
    told = why_it_moves_badly(status, rise, gap, errors)
    assert told.startswith(says)
    assert bool(told) == bool(says)
