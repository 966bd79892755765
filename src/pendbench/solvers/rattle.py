"""RATTLE for a chain of points held by rods: Cartesian, symplectic, of order 2, O(n) a step.

The rods' forces are found so that the rods keep their lengths after the step: Newton's method on a tridiagonal system.
Sources: Andersen, J. Comput. Phys. 52 (1983); Hairer, Lubich, Wanner, Geometric Numerical Integration, VII.1.4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined
from pendbench.solvers.copying import copy_rows
from pendbench.solvers.methods import FixedStep, Form, add

_MOST_ITERATIONS = 50
_CLOSE = 1e-10  # the worst relative error of a rod's squared length that passes; a chain of n rounds it to n 1e-15


class Rods(NamedTuple):
    """masses (n,) kg, lengths (n,) m, gravity m/s^2, scratch (rows, n). One thread, one system."""

    masses: FloatArray
    lengths: FloatArray
    gravity: float
    scratch: FloatArray


class _Rows(NamedTuple):
    """The rows of the scratch: the rods before and after the step, and the tridiagonal system."""

    old_x: FloatArray
    old_y: FloatArray
    new_x: FloatArray
    new_y: FloatArray
    below: FloatArray
    diagonal: FloatArray
    above: FloatArray
    right: FloatArray


def rods_of(masses: FloatArray, lengths: FloatArray, gravity: float) -> Rods:
    """A chain of rods, copied, with room to work in."""
    return Rods(masses.copy(), lengths.copy(), float(gravity), np.empty((len(_Rows._fields), len(masses))))


class Ends(NamedTuple):
    """The rods' ends.

    points (n, 2) m and speeds (n, 2) m/s; forces (n,): the rods' multipliers of the step before, to begin Newton's
    method with; turns (n,): how often each rod went over the top, counter-clockwise positive. new_points, new_speeds
    (n, 2): those of the step that is being tried.
    """

    points: FloatArray
    speeds: FloatArray
    forces: FloatArray
    turns: FloatArray
    new_points: FloatArray
    new_speeds: FloatArray


def ends_at(points: FloatArray, speeds: FloatArray) -> Ends:
    """The rods' ends at the start, copied."""
    n = len(points)
    return Ends(points.copy(), speeds.copy(), np.zeros(n), np.zeros(n), np.empty_like(points), np.empty_like(speeds))


@inlined
def _solve(rows: _Rows) -> None:
    """Solve the tridiagonal system in place, the answer in its right side.

    Keeps the pivots' reciprocals, so that on the way back nothing waits for a division.
    """
    below, diagonal, above, right = rows.below, rows.diagonal, rows.above, rows.right
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
def _write_rods(points: FloatArray, x: FloatArray, y: FloatArray) -> None:
    """Write the rods (x, y) between `points` (n, 2), the first from the origin."""
    x[0], y[0] = points[0, 0], points[0, 1]
    for i in range(1, len(x)):
        x[i] = points[i, 0] - points[i - 1, 0]
        y[i] = points[i, 1] - points[i - 1, 1]


@inlined
def _write_matrix(masses: FloatArray, rows: _Rows, x: FloatArray, y: FloatArray) -> None:
    """The matrix of how forces along rods (x, y) change the rods' ends, projected on the new rods."""
    along_x, along_y, below, diagonal, above = rows.new_x, rows.new_y, rows.below, rows.diagonal, rows.above
    for i in range(len(masses)):
        inverse = 1.0 / masses[i]
        before = 1.0 / masses[i - 1] if i > 0 else 0.0
        diagonal[i] = (inverse + before) * (along_x[i] * x[i] + along_y[i] * y[i])
        below[i] = -before * (along_x[i] * x[i - 1] + along_y[i] * y[i - 1]) if i > 0 else 0.0
        above[i] = -inverse * (along_x[i] * x[i + 1] + along_y[i] * y[i + 1]) if i + 1 < len(masses) else 0.0


@inlined
def _count_turns(rows: _Rows, turns: FloatArray) -> None:
    """A rod above the pivot whose x changes sign went over the top (with less than a quarter turn a step)."""
    old_x, new_x, new_y = rows.old_x, rows.new_x, rows.new_y
    for i in range(len(turns)):
        if new_y[i] > 0.0:
            if old_x[i] >= 0.0 > new_x[i]:
                turns[i] += 1.0
            elif old_x[i] < 0.0 <= new_x[i]:
                turns[i] -= 1.0


@inlined
def _place(rods: Rods, rows: _Rows, h: float, ends: Ends) -> bool:
    """Find the points after a step of h, and the rods' multipliers; False if there are none.

    Leaves the old rods and the new ones in the rows.
    """
    lengths, n, points, speeds, out = rods.lengths, len(rods.lengths), ends.points, ends.speeds, ends.new_points
    new_x, new_y, right = rows.new_x, rows.new_y, rows.right
    _write_rods(points, rows.old_x, rows.old_y)
    worst, before = np.inf, np.inf
    for _ in range(_MOST_ITERATIONS):
        for i in range(n):
            out[i, 0] = points[i, 0] + h * speeds[i, 0]
            out[i, 1] = points[i, 1] + h * speeds[i, 1] - 0.5 * h * h * rods.gravity
        _push(rods.masses, rows.old_x, rows.old_y, ends.forces, out)
        _write_rods(out, new_x, new_y)
        before, worst = worst, 0.0
        for i in range(n):
            excess = new_x[i] * new_x[i] + new_y[i] * new_y[i] - lengths[i] * lengths[i]
            worst = max(worst, abs(excess) / (lengths[i] * lengths[i]))
            right[i] = -0.5 * excess
        if not np.isfinite(worst) or worst < 4e-16 or 0.5 * before <= worst < _CLOSE:
            break
        _write_matrix(rods.masses, rows, rows.old_x, rows.old_y)
        _solve(rows)
        for i in range(n):
            ends.forces[i] += right[i]
    return worst < _CLOSE


@inlined
def _write_speeds(rods: Rods, rows: _Rows, h: float, ends: Ends) -> None:
    """The speeds after a step to the new points, less what stretches the rods: that is linear in the forces."""
    speeds, right, x, y = ends.new_speeds, rows.right, rows.new_x, rows.new_y
    for i in range(len(x)):
        speeds[i, 0] = (ends.new_points[i, 0] - ends.points[i, 0]) / h
        speeds[i, 1] = (ends.new_points[i, 1] - ends.points[i, 1]) / h - 0.5 * h * rods.gravity
    _write_matrix(rods.masses, rows, x, y)
    for i in range(len(x)):
        relative_x = speeds[i, 0] - (speeds[i - 1, 0] if i > 0 else 0.0)
        relative_y = speeds[i, 1] - (speeds[i - 1, 1] if i > 0 else 0.0)
        right[i] = -(x[i] * relative_x + y[i] * relative_y)
    _solve(rows)
    _push(rods.masses, x, y, right, speeds)


@inlined
def quickness(masses: FloatArray, forces: FloatArray) -> float:
    """(h W)^2 of the step whose multipliers were forces (n,), -h^2 T / (2 l) kg; nan where one of them is.

    masses (n,) kg; W is the bound on the chain's frequencies that `frame` explains.
    """
    most, n = 0.0, len(masses)
    for i in range(n):
        outer = abs(forces[i + 1]) if i + 1 < n else 0.0
        squared = 4.0 * (abs(forces[i]) + outer) / masses[i]
        if not squared <= most:  # so that nan counts
            most = squared
    return most


def _steps(rods: Rods, ends: Ends, h: float, steps: int, quickest: float) -> int:
    """Take steps of h (s), and return how many were taken.

    Stops at the first step whose rods cannot be brought to their lengths, or whose `quickness` is above `quickest`.
    """
    s = rods.scratch
    rows = _Rows(s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7])
    for step in range(steps):
        if not _place(rods, rows, h, ends):
            return step
        if quickest < np.inf and not quickness(rods.masses, ends.forces) <= quickest:
            return step
        _write_speeds(rods, rows, h, ends)
        _count_turns(rows, ends.turns)
        copy_rows(ends.new_points, ends.points)
        copy_rows(ends.new_speeds, ends.speeds)
    return steps


#: Measured at two links: made part of `_rattle` the steps take a fifth longer, and made part of `frame` a fifth less.
_kernel = compiled(_steps)
take_steps = inlined(_steps)


@compiled
def _rattle(
    rods: Rods, points: FloatArray, speeds: FloatArray, forces: FloatArray, turns: FloatArray, dt: float, steps: int
) -> int:
    ends = Ends(points, speeds, forces, turns, np.empty_like(points), np.empty_like(speeds))
    return _kernel(rods, ends, dt, steps, np.inf)


def rattle(rods: Rods, ends: Ends, first: int, dt: float, steps: int) -> int:  # noqa: ARG001
    """Take steps as `methods.FixedStep` says. A group costs Python a microsecond and more, so it passes arrays."""
    taken: int = _rattle(rods, *ends[:4], dt, steps)
    return taken


add(
    FixedStep(
        "rattle",
        order=2,
        note="constrained Cartesian Stormer-Verlet: symplectic, for large n",
        form=Form.ENDS,
        begin=ends_at,
        advance=rattle,
        stuck="no forces keep the rods at their lengths",
        remedy="a smaller step might",
    )
)
