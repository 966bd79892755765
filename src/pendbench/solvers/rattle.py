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
_CLOSE = 1e-10  # the worst relative error of a rod's squared length that passes; a chain of n rounds it to n 1e-15


class Rods(NamedTuple):
    """masses (n,) kg, lengths (n,) m, gravity m/s^2, scratch (8, n)."""

    masses: FloatArray
    lengths: FloatArray
    gravity: float
    scratch: FloatArray


@inlined
def _solve_tridiagonal(below: FloatArray, diagonal: FloatArray, above: FloatArray, right: FloatArray) -> None:
    """Solve in place, the answer in `right`. below[i] and above[i] stand left of and right of diagonal[i].

    Keeps the pivots' reciprocals, so that on the way back nothing waits for a division.
    """
    n = len(diagonal)
    diagonal[0] = 1.0 / diagonal[0]
    for i in range(1, n):
        ratio = below[i] * diagonal[i - 1]
        diagonal[i] = 1.0 / (diagonal[i] - ratio * above[i - 1])
        right[i] -= ratio * right[i - 1]
    right[n - 1] *= diagonal[n - 1]
    for i in range(n - 2, -1, -1):
        right[i] = (right[i] - above[i] * right[i + 1]) * diagonal[i]


@inlined
def _push(masses: FloatArray, along_x: FloatArray, along_y: FloatArray, force: FloatArray, out: FloatArray) -> None:
    """Add to the points' `out` (n, 2) what forces in the rods, each along its (x, y), do to them over their masses."""
    outer_x, outer_y = 0.0, 0.0
    for i in range(len(masses) - 1, -1, -1):
        inverse = 1.0 / masses[i]
        x = force[i] * along_x[i]
        y = force[i] * along_y[i]
        out[i, 0] += (x - outer_x) * inverse
        out[i, 1] += (y - outer_y) * inverse
        outer_x, outer_y = x, y


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


@inlined
def _place(rods: Rods, h: float, points: FloatArray, speeds: FloatArray, forces: FloatArray, out: FloatArray) -> bool:
    """Write the points after a step of h into `out` and the rods' multipliers into `forces`; False if there are none.

    Leaves the old rods in rows 0 and 1 of the scratch, the new ones in rows 2 and 3.
    """
    masses, lengths, n = rods.masses, rods.lengths, len(rods.masses)
    old_x, old_y, new_x, new_y = rods.scratch[0], rods.scratch[1], rods.scratch[2], rods.scratch[3]
    below, diagonal, above, right = rods.scratch[4], rods.scratch[5], rods.scratch[6], rods.scratch[7]
    _rods_of(points, old_x, old_y)
    worst, before = np.inf, np.inf
    for _ in range(_MOST_ITERATIONS):
        for i in range(n):
            out[i, 0] = points[i, 0] + h * speeds[i, 0]
            out[i, 1] = points[i, 1] + h * speeds[i, 1] - 0.5 * h * h * rods.gravity
        _push(masses, old_x, old_y, forces, out)
        _rods_of(out, new_x, new_y)
        before, worst = worst, 0.0
        for i in range(n):
            excess = new_x[i] * new_x[i] + new_y[i] * new_y[i] - lengths[i] * lengths[i]
            worst = max(worst, abs(excess) / (lengths[i] * lengths[i]))
            right[i] = -0.5 * excess
        if not np.isfinite(worst) or worst < 4e-16 or 0.5 * before <= worst < _CLOSE:
            break
        _fill(masses, new_x, new_y, old_x, old_y, below, diagonal, above)
        _solve_tridiagonal(below, diagonal, above, right)
        for i in range(n):
            forces[i] += right[i]
    return worst < _CLOSE


@inlined
def _project(rods: Rods, x: FloatArray, y: FloatArray, speeds: FloatArray) -> None:
    """Take from `speeds` (n, 2) what stretches the rods (x, y): linear in the second half of the forces."""
    masses = rods.masses
    below, diagonal, above, right = rods.scratch[4], rods.scratch[5], rods.scratch[6], rods.scratch[7]
    _fill(masses, x, y, x, y, below, diagonal, above)
    for i in range(len(masses)):
        relative_x = speeds[i, 0] - (speeds[i - 1, 0] if i > 0 else 0.0)
        relative_y = speeds[i, 1] - (speeds[i - 1, 1] if i > 0 else 0.0)
        right[i] = -(x[i] * relative_x + y[i] * relative_y)
    _solve_tridiagonal(below, diagonal, above, right)
    _push(masses, x, y, right, speeds)


@inlined
def try_step(
    rods: Rods,
    h: float,
    points: FloatArray,
    speeds: FloatArray,
    forces: FloatArray,
    new_points: FloatArray,
    new_speeds: FloatArray,
) -> bool:
    """Write what points and speeds, (n, 2) each, are a step of h later; False if the rods cannot keep their lengths.

    forces (n,): the multipliers to begin Newton's method with, and then those of this step.
    """
    if not _place(rods, h, points, speeds, forces, new_points):
        return False
    for i in range(len(points)):
        new_speeds[i, 0] = (new_points[i, 0] - points[i, 0]) / h
        new_speeds[i, 1] = (new_points[i, 1] - points[i, 1]) / h - 0.5 * h * rods.gravity
    _project(rods, rods.scratch[2], rods.scratch[3], new_speeds)
    return True


@inlined
def accept_step(
    rods: Rods,
    points: FloatArray,
    speeds: FloatArray,
    turns: FloatArray,
    new_points: FloatArray,
    new_speeds: FloatArray,
) -> None:
    """Make the step that `try_step` took last the state, and count the rods that it took over the top."""
    _count_turns(rods.scratch[0], rods.scratch[2], rods.scratch[3], turns)
    copy_rows(new_points, points)
    copy_rows(new_speeds, speeds)


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
    new_points, new_speeds = np.empty_like(points), np.empty_like(speeds)
    for step in range(steps):
        if not try_step(rods, h, points, speeds, forces, new_points, new_speeds):
            return step
        accept_step(rods, points, speeds, turns, new_points, new_speeds)
    return steps
