"""Double-double numbers with operators, for kernels that read like their formulas.

Inside a kernel an `Extended` can be added, subtracted, multiplied and divided, also with floats, and has sine, cosine
and square root (`np.sin`, `np.cos`, `np.sqrt`): a law in plain arithmetic is compiled for it as for a float.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.core import types

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import chosen_by_type, part_as_written
from pendbench.solvers.extended.double_double import Number, add, divide, multiply, scale, sine_cosine, subtract


class Extended(NamedTuple):
    """The unevaluated sum of two floats."""

    high: float
    low: float


@part_as_written
def _number(x: Any) -> Number:
    return x[0], x[1]


@part_as_written
def _sine(a: Number) -> Number:
    return sine_cosine(a)[0]


@part_as_written
def _cosine(a: Number) -> Number:
    return sine_cosine(a)[1]


@part_as_written
def _root(a: Number) -> Number:
    """The square root, by one step of Newton's method from the float's."""
    if a[0] <= 0.0:
        return 0.0, 0.0
    near = np.sqrt(a[0])
    rest = subtract(a, scale((near, 0.0), near))
    return add((near, 0.0), (rest[0] / (2.0 * near), 0.0))


@part_as_written
def _negative(a: Number) -> Number:
    return -a[0], -a[1]


def extended(x: Any) -> Any:
    """A float or an Extended as an Extended, in a kernel."""
    raise NotImplementedError


def _is_extended(kind: Any) -> bool:
    return getattr(kind, "instance_class", None) is Extended


def _is_float(kind: Any) -> bool:
    return isinstance(kind, types.Float)


def _binary(generic: Callable[..., Any], kernel: Any) -> None:
    """Have kernels use `kernel` for `generic(a, b)` of two Extended, or of one and a float."""

    def choose(a: Any, b: Any) -> Any:
        if not (_is_extended(a) or _is_extended(b)):
            return None
        if _is_float(a):
            return lambda a, b: Extended(*kernel((a, 0.0), _number(b)))
        if _is_float(b):
            return lambda a, b: Extended(*kernel(_number(a), (b, 0.0)))
        return lambda a, b: Extended(*kernel(_number(a), _number(b)))

    chosen_by_type(generic)(choose)


def _unary(generic: Callable[..., Any], kernel: Any) -> None:
    def choose(a: Any) -> Any:
        return (lambda a: Extended(*kernel(_number(a)))) if _is_extended(a) else None

    chosen_by_type(generic)(choose)


_binary(operator.add, add)
_binary(operator.sub, subtract)
_binary(operator.mul, multiply)
_binary(operator.truediv, divide)
_unary(operator.neg, _negative)
_unary(np.sin, _sine)
_unary(np.cos, _cosine)
_unary(np.sqrt, _root)


@part_as_written
def sine_and_cosine(x: Any) -> Any:
    """Both of an Extended, for little more than the price of one."""
    s, c = sine_cosine(_number(x))
    return Extended(s[0], s[1]), Extended(c[0], c[1])


@chosen_by_type(extended)
def _choose_extended(x: Any) -> Any:
    if _is_extended(x):
        return lambda x: x
    return lambda x: Extended(float(x), 0.0)


@part_as_written
def load(array: FloatArray, i: int) -> Any:
    """Number i of an array (d, 2)."""
    return Extended(array[i, 0], array[i, 1])


@part_as_written
def store(array: FloatArray, i: int, x: Any) -> None:
    """Make x number i of an array (d, 2)."""
    array[i, 0], array[i, 1] = x[0], x[1]
