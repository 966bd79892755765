"""RATTLE for a chain of points held by rods: Cartesian, symplectic, of order 2, O(n) a step.

The rods' forces are found so that the rods keep their lengths after the step: Newton's method on a tridiagonal system.
Sources: Andersen, J. Comput. Phys. 52 (1983); Hairer, Lubich, Wanner, Geometric Numerical Integration, VII.1.4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.compiled import compiled, inlined
from pendbench.solvers.copying import copy_rows

_MOST_ITERATIONS = 50


class Rods(NamedTuple):
    """masses (n,) kg, lengths (n,) m, gravity m/s^2, scratch (8, n)."""

    masses: FloatArray
    lengths: FloatArray
    gravity: float
    scratch: FloatArray


@inlined
def _solve_tridiagonal(below: FloatArray, diagonal: FloatArray, above: FloatArray, right: FloatArray) -> None:
    """Solve in place, the answer in `right`. below[i] and above[i] stand left of and right of diagonal[i]."""
    n = len(diagonal)
    for i in range(1, n):
        ratio = below[i] / diagonal[i - 1]
        diagonal[i] -= ratio * above[i - 1]
        right[i] -= ratio * right[i - 1]
    right[n - 1] /= diagonal[n - 1]
    for i in range(n - 2, -1, -1):
        right[i] = (right[i] - above[i] * right[i + 1]) / diagonal[i]


@inlined
def _push(masses: FloatArray, along_x: FloatArray, along_y: FloatArray, force: FloatArray, out: FloatArray) -> None:
    """Add to the points' `out` (n, 2) what forces in the rods, each along its (x, y), do to them over their masses."""
    n = len(masses)
    for i in range(n):
        x = force[i] * along_x[i]
        y = force[i] * along_y[i]
        out[i, 0] += x / masses[i]
        out[i, 1] += y / masses[i]
        if i > 0:
            out[i - 1, 0] -= x / masses[i - 1]
            out[i - 1, 1] -= y / masses[i - 1]


@inlined
def _rods_of(points: FloatArray, x: FloatArray, y: FloatArray) -> None:
    """The rods (x, y) between `points` (n, 2), the first from the origin."""
    x[0], y[0] = points[0, 0], points[0, 1]
    for i in range(1, len(x)):
        x[i] = points[i, 0] - points[i - 1, 0]
        y[i] = points[i, 1] - points[i - 1, 1]


@inlined
def _fill(
    masses: FloatArray,
    row_x: FloatArray,
    row_y: FloatArray,
    x: FloatArray,
    y: FloatArray,
    below: FloatArray,
    diagonal: FloatArray,
    above: FloatArray,
) -> None:
    """The matrix of how forces along rods (x, y) change the rods' ends, projected on (row_x, row_y)."""
    for i in range(len(masses)):
        inverse = 1.0 / masses[i]
        before = 1.0 / masses[i - 1] if i > 0 else 0.0
        diagonal[i] = (inverse + before) * (row_x[i] * x[i] + row_y[i] * y[i])
        below[i] = -before * (row_x[i] * x[i - 1] + row_y[i] * y[i - 1]) if i > 0 else 0.0
        above[i] = -inverse * (row_x[i] * x[i + 1] + row_y[i] * y[i + 1]) if i + 1 < len(masses) else 0.0


@inlined
def _count_turns(old_x: FloatArray, new_x: FloatArray, new_y: FloatArray, turns: FloatArray) -> None:
    """A rod above the pivot whose x changes sign went over the top (with less than a quarter turn a step)."""
    for i in range(len(turns)):
        if new_y[i] > 0.0:
            if old_x[i] >= 0.0 > new_x[i]:
                turns[i] += 1.0
            elif old_x[i] < 0.0 <= new_x[i]:
                turns[i] -= 1.0


@compiled
def rattle(
    rods: Rods,
    h: float,
    points: FloatArray,
    speeds: FloatArray,
    forces: FloatArray,
    turns: FloatArray,
    steps: int,
) -> int:
    """Take steps of h (s), changing points (n, 2) m and speeds (n, 2) m/s in place; return how many were taken.

    forces (n,): the rods' multipliers of the step before, to begin Newton's method with; kept between calls. turns
    (n,): how often each rod went over the top, counter-clockwise positive. Stops at the first step whose rods cannot be
    brought to their lengths.
    """
    masses, lengths, n = rods.masses, rods.lengths, len(rods.masses)
    old_x, old_y, new_x, new_y = rods.scratch[0], rods.scratch[1], rods.scratch[2], rods.scratch[3]
    below, diagonal, above, right = rods.scratch[4], rods.scratch[5], rods.scratch[6], rods.scratch[7]
    moved, trial = np.empty((n, 2)), np.empty((n, 2))
    for step in range(steps):
        _rods_of(points, old_x, old_y)
        for i in range(n):
            moved[i, 0] = points[i, 0] + h * speeds[i, 0]
            moved[i, 1] = points[i, 1] + h * speeds[i, 1] - 0.5 * h * h * rods.gravity
        worst, before = np.inf, np.inf
        for iteration in range(_MOST_ITERATIONS):
            copy_rows(moved, trial)
            _push(masses, old_x, old_y, forces, trial)
            _rods_of(trial, new_x, new_y)
            before, worst = worst, 0.0
            for i in range(n):
                excess = new_x[i] * new_x[i] + new_y[i] * new_y[i] - lengths[i] * lengths[i]
                worst = max(worst, abs(excess) / (lengths[i] * lengths[i]))
                right[i] = -0.5 * excess
            if not np.isfinite(worst) or worst < 4e-16 or (iteration > 3 and worst < 1e-12 and worst >= 0.5 * before):
                break
            _fill(masses, new_x, new_y, old_x, old_y, below, diagonal, above)
            _solve_tridiagonal(below, diagonal, above, right)
            for i in range(n):
                forces[i] += right[i]
        if not worst < 1e-10:
            return step
        for i in range(n):
            for axis in range(2):
                speeds[i, axis] = (trial[i, axis] - points[i, axis]) / h
                points[i, axis] = trial[i, axis]
            speeds[i, 1] -= 0.5 * h * rods.gravity
        _count_turns(old_x, new_x, new_y, turns)
        # The rods' ends must not move along the rods: linear in the second half of the forces.
        _fill(masses, new_x, new_y, new_x, new_y, below, diagonal, above)
        for i in range(n):
            x = speeds[i, 0] - (speeds[i - 1, 0] if i > 0 else 0.0)
            y = speeds[i, 1] - (speeds[i - 1, 1] if i > 0 else 0.0)
            right[i] = -(new_x[i] * x + new_y[i] * y)
        _solve_tridiagonal(below, diagonal, above, right)
        _push(masses, new_x, new_y, right, speeds)
    return steps
