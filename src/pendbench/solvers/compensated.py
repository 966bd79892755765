"""Sums that keep what rounding leaves out of them (compensated summation, Kahan 1965)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined


class Sum(NamedTuple):
    """A state, value (d,), and what rounding left out of it, carry (d,)."""

    value: FloatArray
    carry: FloatArray


def sum_from(start: FloatArray) -> Sum:
    """The state `start`, copied, with nothing left out yet."""
    return Sum(start.copy(), np.zeros_like(start))


@inlined
def add(value: float, carry: float, change: float) -> tuple[float, float]:
    """Value + change, and what rounding left out of it."""
    small = change + carry
    total = value + small
    return total, small - (total - value)
