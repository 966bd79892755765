"""Double-double arithmetic against 70 digits: the errors that the module promises, and numbers chosen to break it."""

from __future__ import annotations

import operator
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from pendbench.solvers.extended import double_double
from pendbench.solvers.extended.double_double import add, divide, multiply, scale, sine_cosine, split, subtract

PROMISED = 1e-31
SAMPLES = 2000


def exact(a):
    """The number that a pair of doubles stands for."""
    return mpmath.mpf(float(a[0])) + mpmath.mpf(float(a[1]))


def number(high, low):
    """A pair whose low part is rounded off the high one, as the arithmetic keeps them."""
    total = float(high) + float(low)
    return total, float(low) - (total - float(high))


def numbers(seed, most=30):
    rng = np.random.default_rng(seed)
    high = rng.standard_normal(SAMPLES) * 2.0 ** rng.integers(-most, most, SAMPLES)
    low = high * rng.uniform(-1, 1, SAMPLES) * 2.0 ** (-53 - rng.integers(0, 2, SAMPLES) * 10)
    return [number(*pair) for pair in zip(high, low, strict=True)]


def nearly(others, seed):
    """Numbers that agree with the others to 15 digits and more."""
    rng = np.random.default_rng(seed)
    high = np.array([a[0] for a in others])
    return [
        number(h * (1 + k * 2.0**-52), h * low * 2.0**-53)
        for h, k, low in zip(high, rng.integers(-3, 4, SAMPLES), rng.uniform(-1, 1, SAMPLES), strict=True)
    ]


def assert_promise(function, truth, pairs):
    with mpmath.workdps(70):
        for a, b in pairs:
            found, expected = exact(function(a, b)), truth(exact(a), exact(b))
            assert abs(found - expected) <= PROMISED * abs(expected), (a, b)


OPERATIONS = [(add, operator.add), (subtract, operator.sub), (multiply, operator.mul), (divide, operator.truediv)]


@pytest.mark.parametrize(("function", "truth"), OPERATIONS)
def test_arithmetic(function, truth):
    assert_promise(function, truth, zip(numbers(1), numbers(2), strict=True))


@pytest.mark.parametrize(("function", "truth"), OPERATIONS)
def test_arithmetic_of_neighbours(function, truth):
    """Where high parts cancel, low parts are all there is."""
    ours = numbers(3)
    assert_promise(function, truth, zip(ours, nearly(ours, 4), strict=True))


def test_arithmetic_far_apart():
    big, small = (1e16, 0.5), (1.0, 1e-17)
    assert_promise(add, operator.add, [(big, small), (small, big), ((-1e16, -0.5), small)])
    assert_promise(subtract, operator.sub, [(big, (1e16, 0.25)), (small, small)])


def test_scale():
    with mpmath.workdps(70):
        for a, (b, _) in zip(numbers(5), numbers(6), strict=True):
            expected = exact(a) * b
            assert abs(exact(scale(a, b)) - expected) <= PROMISED * abs(expected)


def test_results_are_normalised():
    """The low part is what rounding takes from the high one: otherwise the next operation loses digits."""
    ours, others = numbers(7), numbers(8)
    for function, _ in OPERATIONS:
        for a, b in zip(ours, others, strict=True):
            high, low = function(a, b)
            assert high + low == high


def test_no_product_is_fused_with_a_sum_behind_our_back():
    """An error that was computed of a rounded product is not that of one that was never rounded."""
    kernels = [kernel for kernel in vars(double_double).values() if hasattr(kernel, "targetoptions")]
    assert len(kernels) >= 9
    assert not any(kernel.targetoptions.get("fastmath") for kernel in kernels)


def test_one_third_to_32_digits():
    high, low = divide((1.0, 0.0), (3.0, 0.0))
    assert abs(Fraction(high) + Fraction(low) - Fraction(1, 3)) < Fraction(1, 10**32)
    assert (high, low) == split(Fraction(1, 3))


def test_split_is_the_nearest_to_what_is_left():
    seventh = Fraction(1, 7)
    parts = split(seventh, 3)
    for k in range(1, 4):
        left = abs(seventh - sum(map(Fraction, parts[:k])))
        assert left <= Fraction(float(np.spacing(abs(parts[k - 1])))) / 2


ANGLES = {
    "up to 1": lambda rng: rng.uniform(-1.0, 1.0, SAMPLES),
    "up to 100": lambda rng: rng.uniform(-100.0, 100.0, SAMPLES),
    "up to 1e9": lambda rng: rng.uniform(-1e9, 1e9, SAMPLES),
    "multiples of pi/16": lambda rng: rng.integers(-(10**9), 10**9, SAMPLES) * (np.pi / 16),
    "halfway between": lambda rng: (rng.integers(-(10**9), 10**9, SAMPLES) + 0.5) * (np.pi / 16),
    "tiny": lambda rng: rng.standard_normal(SAMPLES) * 10.0 ** rng.integers(-300, -1, SAMPLES),
    "zero and the ends": lambda _: np.array([0.0, 1e9, -1e9, np.pi / 32, -np.pi / 32]),
}


@pytest.mark.parametrize("kind", ANGLES)
def test_sine_and_cosine(kind):
    rng = np.random.default_rng(9)
    with mpmath.workdps(70):
        for angle in ANGLES[kind](rng):
            a = number(angle, angle * rng.uniform(-1, 1) * 2.0**-54)
            sine, cosine = sine_cosine(a)
            expected = mpmath.cos_sin(exact(a))
            assert abs(exact(cosine) - expected[0]) < PROMISED
            assert abs(exact(sine) - expected[1]) < PROMISED
