"""Gragg's extrapolation in double-double arithmetic: the method of the reference.

Its order is as high as wanted, its right-hand side is called with nothing but states, and its rounding errors stay near
those of one call: what 25 digits ask for. Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
II.9 (the modified midpoint rule, the harmonic sequence 2, 4, 6, ..., and step control at a fixed order).
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.compiled import compiled
from pendbench.solvers.copying import copy_rows
from pendbench.solvers.double_double import Number, add, divide, multiply, split, subtract
from pendbench.solvers.outcome import DONE, NOT_FINITE, TOO_MANY, TOO_SMALL, Progress


def extended_derivative(system: Any, y: FloatArray, dy: FloatArray) -> None:
    """Write dy/dt at state y (d, 2) into dy (d, 2): column 0 the high parts, column 1 the low ones."""
    raise NotImplementedError(f"no extended derivative for {type(system).__name__}")


def neville_weights(columns: int) -> FloatArray:
    """`1 / ((n_j / n_{j-k})^2 - 1)` of the sequence n_j = 2 (j + 1), as (columns, columns, 2): [j, k]."""
    weights = np.zeros((columns, columns, 2))
    for j in range(columns):
        for k in range(1, j + 1):
            weights[j, k] = split(1 / (Fraction(j + 1, j + 1 - k) ** 2 - 1))
    return weights


@compiled
def _axpy(out: FloatArray, y: FloatArray, h: Number, dy: FloatArray) -> None:
    """Out = y + h dy."""
    for i in range(len(y)):
        change = multiply((dy[i, 0], dy[i, 1]), h)
        out[i, 0], out[i, 1] = add((y[i, 0], y[i, 1]), change)


@compiled
def _midpoint(system: Any, y: FloatArray, dy: FloatArray, h: Number, steps: int, room: FloatArray) -> FloatArray:
    """The state after `steps` steps of the modified midpoint rule over h, from y with derivative dy."""
    before: FloatArray = room[0]
    now: FloatArray = room[1]
    slope = room[2]
    substep = divide(h, (float(steps), 0.0))
    twice = (2.0 * substep[0], 2.0 * substep[1])
    copy_rows(y, before)
    _axpy(now, y, substep, dy)
    for _ in range(steps - 1):
        extended_derivative(system, now, slope)
        _axpy(before, before, twice, slope)
        before, now = now, before
    return now


@compiled
def _extrapolate(table: FloatArray, row: int, weights: FloatArray) -> None:
    """Fill row `row` of the Aitken-Neville table (columns, d, 2) in place, `table[row]` being its first column.

    On return `table[j]` holds T_{row, row-j}: `table[0]` is the best value and `table[1]` the one before it.
    """
    for k in range(1, row + 1):
        target, source = row - k, row - k + 1
        weight = (weights[row, k, 0], weights[row, k, 1])
        for i in range(table.shape[1]):
            best = (table[source, i, 0], table[source, i, 1])
            old = (table[target, i, 0], table[target, i, 1])
            table[target, i, 0], table[target, i, 1] = add(best, multiply(subtract(best, old), weight))


@compiled
def _error(table: FloatArray, y: FloatArray, tolerance: float, relative: FloatArray) -> float:
    worst = 0.0
    for i in range(len(y)):
        difference = subtract((table[0, i, 0], table[0, i, 1]), (table[1, i, 0], table[1, i, 1]))[0]
        if not np.isfinite(difference):
            return np.inf
        worst = max(worst, abs(difference) / (tolerance * (1.0 + relative[i] * abs(y[i, 0]))))
    return worst


@compiled
def integrate_extended(
    system: Any,
    weights: FloatArray,
    t: float,
    end: float,
    h: float,
    y: FloatArray,
    tolerance: float,
    relative: FloatArray,
    smallest: float,
    most_steps: int,
) -> Progress:
    """Advance y (d, 2), in place, from t to exactly `end` (s) with `len(weights)` columns of extrapolation.

    The arguments are those of `adaptive.integrate`; weights are `neville_weights(columns)`, and the order is twice the
    number of columns. The system must not depend on t.
    """
    columns, d = len(weights), len(y)
    table, room, dy = np.empty((columns, d, 2)), np.empty((3, d, 2)), np.empty((d, 2))
    accepted, rejected = 0, 0
    h = max(h, smallest)
    while t < end:
        if accepted + rejected >= most_steps:
            return Progress(TOO_MANY, t, h, accepted, rejected)
        left = end - t
        last = h >= left
        step = left if last else (0.5 * left if h > 0.5 * left else h)
        target = end if last else t + step
        if not last and (h < smallest or t + 0.1 * h == t):
            return Progress(TOO_SMALL, t, h, accepted, rejected)
        # Times are doubles, so the step between two of them is not: a rounded one would show in the 17th digit.
        exact_step = subtract((target, 0.0), (t, 0.0))
        extended_derivative(system, y, dy)
        if not np.all(np.isfinite(dy)):
            return Progress(NOT_FINITE, t, h, accepted, rejected)
        for row in range(columns):
            copy_rows(_midpoint(system, y, dy, exact_step, 2 * (row + 1), room), table[row])
            _extrapolate(table, row, weights)
        error = _error(table, y, tolerance, relative)
        factor = 0.2
        if np.isfinite(error):
            factor = min(3.0, max(0.2, 0.9 * max(error, 1e-30) ** (-1.0 / (2 * columns - 1))))
        if error <= 1.0:
            copy_rows(table[0], y)
            t = target
            accepted += 1
            h = max(h, step * factor) if last else step * factor
        else:
            rejected += 1
            h = step * min(factor, 0.9)
    return Progress(DONE, t, h, accepted, rejected)
