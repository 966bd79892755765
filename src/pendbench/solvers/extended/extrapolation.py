"""Gragg's extrapolation in double-double arithmetic: the method of the reference.

Its order is as high as wanted, its right-hand side is called with nothing but states, and its rounding errors stay near
those of one call: what 25 digits ask for. Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
II.9 (the modified midpoint rule, the harmonic sequence 2, 4, 6, ..., and step control at a fixed order).
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, part
from pendbench.solvers.copying import copy_rows
from pendbench.solvers.extended.double_double import Number, add, divide, multiply, split, subtract
from pendbench.solvers.outcome import DONE, NOT_FINITE, TOO_MANY, TOO_SMALL, Reached

# A step that only has to reach a time asked for makes do with fewer columns, but not with fewer than these: the
# difference of two low orders can be small by chance.
_FEWEST_COLUMNS = 4


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


@part
def _axpy(out: FloatArray, y: FloatArray, h: Number, dy: FloatArray) -> None:
    """Out = y + h dy."""
    for i in range(len(y)):
        change = multiply((dy[i, 0], dy[i, 1]), h)
        out[i, 0], out[i, 1] = add((y[i, 0], y[i, 1]), change)


@part
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


@part
def _error(table: FloatArray, y: FloatArray, tolerance: float, relative: FloatArray) -> float:
    worst = 0.0
    for i in range(len(y)):
        difference = subtract((table[0, i, 0], table[0, i, 1]), (table[1, i, 0], table[1, i, 1]))[0]
        if not np.isfinite(difference):
            return np.inf
        worst = max(worst, abs(difference) / (tolerance * (1.0 + relative[i] * abs(y[i, 0]))))
    return worst


@part
def _all_finite(values: FloatArray) -> bool:
    """As a loop: numba takes a second to compile `np.all(np.isfinite(values))`."""
    finite = True
    for i in range(len(values)):
        finite = finite and bool(np.isfinite(values[i, 0]) and np.isfinite(values[i, 1]))
    return finite


@compiled
def extrapolated_step(
    system: Any,
    weights: FloatArray,
    h: Number,
    y: FloatArray,
    tolerance: float,
    relative: FloatArray,
    fewest: int,
    table: FloatArray,
    room: FloatArray,
) -> tuple[float, int]:
    """Write the state a step of h after y into table[0]; its scaled error, and how many columns that took.

    room: (4, d, 2). Stops as soon as `fewest` columns or more have an error that is allowed; at once, with an error of
    nan, where the derivative at y is not finite. The modified midpoint rule stands here and not in a kernel of its own:
    each kernel that has the equations of motion in it is compiled with them, for every form of them.
    """
    dy, slope = room[0], room[1]
    extended_derivative(system, y, dy)
    if not _all_finite(dy):
        return np.nan, 0
    error = np.inf
    for row in range(len(weights)):
        before: FloatArray = room[2]
        now: FloatArray = room[3]
        steps = 2 * (row + 1)
        substep = divide(h, (float(steps), 0.0))
        twice = (2.0 * substep[0], 2.0 * substep[1])
        copy_rows(y, before)
        _axpy(now, y, substep, dy)
        for _ in range(steps - 1):
            extended_derivative(system, now, slope)
            _axpy(before, before, twice, slope)
            before, now = now, before
        copy_rows(now, table[row])
        _extrapolate(table, row, weights)
        if row + 1 >= fewest:
            error = _error(table, y, tolerance, relative)
            if error <= 1.0:
                return error, row + 1
    return error, len(weights)


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
) -> Reached:
    """Advance y (d, 2), in place, from t to exactly `end` (s) with `len(weights)` columns of extrapolation.

    The arguments are those of `adaptive.integrate`; weights are `neville_weights(columns)`, and the order is twice the
    number of columns. The system must not depend on t. The loop is in Python: a step costs hundreds of microseconds and
    more, and what is compiled is compiled for every form of the equations.
    """
    columns, d = len(weights), len(y)
    table, room = np.empty((columns, d, 2)), np.empty((4, d, 2))
    accepted, rejected, t, h = 0, 0, float(t), max(h, smallest)
    while t < end:
        if accepted + rejected >= most_steps:
            return Reached(TOO_MANY, t, h, accepted, rejected)
        left = end - t
        last = h >= left
        step = left if last else min(h, 0.5 * left)
        target = end if last else t + step
        if not last and (h < smallest or t + 0.1 * h == t):
            return Reached(TOO_SMALL, t, h, accepted, rejected)
        # Times are doubles, so the step between two of them is not: a rounded one would show in the 17th digit.
        exact_step = subtract((target, 0.0), (t, 0.0))
        fewest = min(_FEWEST_COLUMNS, columns) if last else columns
        error, used = extrapolated_step(system, weights, exact_step, y, tolerance, relative, fewest, table, room)
        if not used:
            return Reached(NOT_FINITE, t, h, accepted, rejected)
        factor = _factor(error, used)
        if error <= 1.0:
            y[:] = table[0]
            t = target
            accepted += 1
            h = max(h, step * factor) if last else step * factor
        else:
            rejected += 1
            h = step * min(factor, 0.9)
    return Reached(DONE, t, h, accepted, rejected)


def _factor(error: float, columns: int) -> float:
    """By how much the next step may be longer than one with this scaled error."""
    if not math.isfinite(error):
        return 0.2
    return min(3.0, max(0.2, 0.9 * math.pow(max(error, 1e-30), -1.0 / (2 * columns - 1))))
