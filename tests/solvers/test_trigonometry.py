"""The sines that vectorise, against 50 digits."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from pendbench.solvers import trigonometry
from pendbench.solvers.trigonometry import FAR
from support.kernels import called

cosine_sine, direction, write_bends = map(
    called, (trigonometry.cosine_sine, trigonometry.direction, trigonometry.write_bends)
)

SAMPLES = 3000
PROMISED = 2.5  # units in the last place

ANGLES = {
    "a turn": lambda rng: rng.uniform(-math.pi, math.pi, SAMPLES),
    "many turns": lambda rng: rng.uniform(-FAR, FAR, SAMPLES),
    "tiny": lambda rng: rng.standard_normal(SAMPLES) * 10.0 ** rng.integers(-300, 0, SAMPLES),
    "beside multiples of pi/4": lambda rng: beside(rng, rng.integers(-100, 100, SAMPLES) * (math.pi / 4)),
    "beside large multiples of pi/2": lambda rng: beside(rng, rng.integers(-63000, 63000, SAMPLES) * (math.pi / 2)),
    "zero and the ends": lambda _: np.array([0.0, FAR, -FAR, math.pi / 2, math.pi, -math.pi]),
}


def beside(rng, angles):
    return angles * (1 + rng.integers(-3, 4, SAMPLES) * 2.0**-52)


def ulps(found, exact):
    """By how many units in the last place of the exact value `found` is off."""
    return float(abs(mpmath.mpf(float(found)) - exact)) / np.spacing(abs(float(exact)) or 5e-324)


@pytest.mark.parametrize("kind", ANGLES)
def test_cosine_and_sine(kind):
    with mpmath.workdps(50):
        for angle in map(float, ANGLES[kind](np.random.default_rng(1))):
            for found, exact in zip(cosine_sine(angle, 0.0), mpmath.cos_sin(angle), strict=True):
                assert ulps(found, exact) < PROMISED, angle


def test_tail_is_taken_into_account():
    rng = np.random.default_rng(2)
    with mpmath.workdps(50):
        for angle in map(float, rng.uniform(-100.0, 100.0, SAMPLES)):
            tail = float(rng.uniform(-0.5, 0.5) * np.spacing(angle))
            whole = mpmath.cos_sin(mpmath.mpf(angle) + mpmath.mpf(tail))
            for found, exact in zip(cosine_sine(angle, tail), whole, strict=True):
                assert abs(found - exact) < 2.5e-16


@pytest.mark.parametrize("angle", [0.3, -FAR, 1.1 * FAR, -1e9])
def test_direction_of_any_angle(angle):
    np.testing.assert_allclose(direction(angle), (math.cos(angle), math.sin(angle)), rtol=0, atol=2e-16)


def test_direction_of_no_angle_is_none():
    assert np.isnan(direction(math.nan)).all()


def test_even_and_odd():
    for angle in np.random.default_rng(3).uniform(-100.0, 100.0, 100):
        (c, s), (mirrored_c, mirrored_s) = direction(angle), direction(-angle)
        assert (mirrored_c, mirrored_s) == (c, -s)


@pytest.mark.parametrize("turns", [0.0, 1.0, 1e4, 1e6], ids=["no turn", "one turn", "far", "beyond"])
def test_bends_keep_what_rounding_takes_from_differences(turns):
    rng = np.random.default_rng(4)
    theta = rng.uniform(-3.0, 3.0, 12) + turns * rng.integers(-1, 2, 12) * 2 * math.pi
    out = np.full((3, 12), 7.0)
    write_bends(theta, out, 2, 0)
    with mpmath.workdps(50):
        for i in range(11):
            c, s = mpmath.cos_sin(mpmath.mpf(float(theta[i + 1])) - mpmath.mpf(float(theta[i])))
            assert abs(out[2, i] - c) < 2.5e-16
            assert abs(out[0, i] - s) < 2.5e-16
    assert (out[1] == 7.0).all()
    assert (out[:, 11] == 7.0).all()
