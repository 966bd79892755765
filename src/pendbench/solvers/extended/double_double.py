"""Arithmetic with about 32 digits: a number is the unevaluated sum of two doubles, high and low.

The algorithms are the error-free transformations of Dekker (1971) and Knuth (The Art of Computer Programming 2, 4.2.2),
put together as in Hida, Li and Bailey, Library for Double-Double and Quad-Double Arithmetic (2007). Relative errors are
below 1e-31 for sums, products and quotients; sines and cosines are good to 1e-31 absolutely for arguments up to 1e9.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from numba.core import types
from numba.extending import intrinsic

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import as_written

Number = tuple[float, float]

# pi to 75 digits, as a fraction.
PI = Fraction(
    3_141592653589793238462643383279502884197169399375105820974944592307816406286,
    10**75,
)
_ANGLES = 32  # sines and cosines are tabulated at multiples of 2 pi / 32 = pi / 16
_UNIT = 10**75  # the tables are made of whole numbers: fractions take a hundred times as long
_TERMS = 10  # of the Taylor series on |r| <= pi / 32: the next one is below 1e-36


def split(exact: Fraction, parts: int = 2) -> tuple[float, ...]:
    """The nearest double to `exact`, the nearest to what is left, and so on."""
    out = []
    for _ in range(parts):
        out.append(float(exact))
        exact -= Fraction(out[-1])
    return tuple(out)


def _series(x: int, first: int) -> int:
    """Sin x (first = 1) or cos x (first = 0) to 1e-70, for |x| up to 2 pi: both in units of `_UNIT`."""
    total, term = 0, x if first else _UNIT
    for power in range(first, first + 96, 2):
        total += term
        term = -term * x * x // (_UNIT**2 * (power + 1) * (power + 2))
    return total


def _table(first: int) -> FloatArray:
    step = round(PI / 16 * _UNIT)
    return np.array([split(Fraction(_series(j * step, first), _UNIT)) for j in range(_ANGLES)])


def _coefficients(first: int) -> FloatArray:
    return np.array([split(Fraction((-1) ** j, math.factorial(2 * j + first))) for j in range(_TERMS)])


_SINES, _COSINES = _table(1), _table(0)
_SINE_SERIES, _COSINE_SERIES = _coefficients(1), _coefficients(0)
_PER_STEP = float(16 / PI)
_STEP_1, _STEP_2, _STEP_3 = split(PI / 16, 3)


def _multiply_add(typingctx: Any, a: Any, b: Any, c: Any) -> Any:  # noqa: ARG001
    """`a b + c`, rounded once."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001
        return builder.fma(*args)

    return types.float64(types.float64, types.float64, types.float64), codegen


_fma: Any = intrinsic(_multiply_add)


@as_written
def _two_sum(a: float, b: float) -> Number:
    """The rounded a + b, and its error, exactly."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@as_written
def _fast_two_sum(a: float, b: float) -> Number:
    """The same where |a| >= |b|."""
    s = a + b
    return s, b - (s - a)


@as_written
def two_product(a: float, b: float) -> Number:
    """The rounded a b, and its error, exactly."""
    p = a * b
    return p, _fma(a, b, -p)


@as_written
def add(a: Number, b: Number) -> Number:
    """A + b."""
    s, e = _two_sum(a[0], b[0])
    t, f = _two_sum(a[1], b[1])
    s, e = _fast_two_sum(s, e + t)
    return _fast_two_sum(s, e + f)


@as_written
def subtract(a: Number, b: Number) -> Number:
    """A - b."""
    return add(a, (-b[0], -b[1]))


@as_written
def multiply(a: Number, b: Number) -> Number:
    """A b."""
    p, e = two_product(a[0], b[0])
    return _fast_two_sum(p, e + (a[0] * b[1] + a[1] * b[0]))


@as_written
def scale(a: Number, b: float) -> Number:
    """A b, where b is one double."""
    p, e = two_product(a[0], b)
    return _fast_two_sum(p, e + a[1] * b)


@as_written
def divide(a: Number, b: Number) -> Number:
    """A / b, by long division."""
    q1 = a[0] / b[0]
    rest = subtract(a, scale(b, q1))
    q2 = rest[0] / b[0]
    rest = subtract(rest, scale(b, q2))
    return add(_fast_two_sum(q1, q2), (rest[0] / b[0], 0.0))


@as_written
def _polynomial(coefficients: FloatArray, x: Number) -> Number:
    value = (coefficients[-1, 0], coefficients[-1, 1])
    for j in range(len(coefficients) - 2, -1, -1):
        value = add(multiply(value, x), (coefficients[j, 0], coefficients[j, 1]))
    return value


@as_written
def sine_cosine(a: Number) -> tuple[Number, Number]:
    """Sin a and cos a, for |a| up to 1e9."""
    multiple = np.rint(a[0] * _PER_STEP)
    rest = subtract(a, two_product(multiple, _STEP_1))
    rest = subtract(rest, two_product(multiple, _STEP_2))
    rest = subtract(rest, two_product(multiple, _STEP_3))
    square = multiply(rest, rest)
    s = multiply(_polynomial(_SINE_SERIES, square), rest)
    c = _polynomial(_COSINE_SERIES, square)
    j = int(multiple) % _ANGLES
    table_s, table_c = (_SINES[j, 0], _SINES[j, 1]), (_COSINES[j, 0], _COSINES[j, 1])
    return (
        add(multiply(table_s, c), multiply(table_c, s)),
        subtract(multiply(table_c, c), multiply(table_s, s)),
    )
