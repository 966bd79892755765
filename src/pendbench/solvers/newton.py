"""Newton's method for the stages of a collocation method: for steps longer than the fastest motion of the system.

Its unknowns are the rates at the stages. With the derivatives M = dp/dv, G = dp/dq of the momenta and B = df/dv, K =
df/dq of the forces, all at the start of the step, the matrix of the stages is

    1 x M + h a x (G - B) - h^2 a^2 x K

which in the modes of a falls apart into one complex matrix (d, d) for each: M + h l (G - B) - h^2 l^2 K. All of it is
dense: 2 d evaluations for the derivatives, and 8 d^3 / 3 operations for each mode. The derivatives are differences,
which slows the iteration down and changes nothing of what it ends at.

Source: Hairer and Wanner, Solving Ordinary Differential Equations II, IV.8 (simplified Newton iterations, the
transformation, and when they converge).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, part
from pendbench.solvers.collocation import NEAR, Collocation, Motion, add_slopes, combine
from pendbench.solvers.copying import copy
from pendbench.solvers.problem import generalized_force, momentum, velocity

#: Nothing is solved for systems with more coordinates: a step would take a second and more.
MOST_COORDINATES = 300

_MOST_ITERATIONS = 50
# An iteration that does not halve its change each time may end anywhere, if at all: too long a step has many solutions.
_SLOWEST = 0.5
_DIFFERENCE = 1e-7


@part
def _write_derivatives(system: Any, t: float, q: FloatArray, v: FloatArray, matrices: FloatArray) -> None:
    """Write dp/dv, dp/dq - df/dv and df/dq at time t (s), q (d,), v (d,) into matrices (3, d, d), columns in rows.

    In one loop, over the point itself, d rates and d angles: each call in a kernel is compiled into it anew.
    """
    d = len(q)
    room = np.zeros((7, d))  # one piece of memory: a chain of few links takes as long to ask for seven
    p0, f0, p, f, angles, rates, one = room[0], room[1], room[2], room[3], room[4], room[5], room[6]
    copy(q, angles)
    copy(v, rates)
    for run in range(2 * d + 1):
        k, turns = (run - 1) % d, 0 < run <= d
        step = _DIFFERENCE * (1.0 + abs(v[k]))
        if turns:
            rates[k] += step
            one[k] = 1.0  # the momentum is linear in the rates
        elif run > 0:
            angles[k] += _DIFFERENCE
        momentum(system, angles, one if turns else v, p)
        generalized_force(system, t, angles, rates, f)
        angles[k], rates[k], one[k] = q[k], v[k], 0.0
        if turns:
            for i in range(d):
                matrices[0, k, i] = p[i]
                matrices[1, k, i] = -(f[i] - f0[i]) / step
        elif run > 0:
            for i in range(d):
                matrices[1, k, i] += (p[i] - p0[i]) / _DIFFERENCE
                matrices[2, k, i] = (f[i] - f0[i]) / _DIFFERENCE
        else:
            copy(p, p0)
            copy(f, f0)


@compiled
def _factorise(matrix: Any, pivots: Any) -> None:
    """The complex matrix (d, d) into its triangles, in place, with rows exchanged as pivots (d,) say."""
    d = len(matrix)
    for k in range(d):
        largest = k
        for i in range(k + 1, d):
            if abs(matrix[i, k]) > abs(matrix[largest, k]):
                largest = i
        pivots[k] = largest
        for j in range(d):
            matrix[k, j], matrix[largest, j] = matrix[largest, j], matrix[k, j]
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, d):
            matrix[i, k] *= inverse
            share = matrix[i, k]
            for j in range(k + 1, d):
                matrix[i, j] -= share * matrix[k, j]


@compiled
def _solve(matrix: Any, pivots: Any, right: Any) -> None:
    """Solve in place, the answer in right (d,), with what `_factorise` left."""
    d = len(right)
    for k in range(d):
        right[k], right[pivots[k]] = right[pivots[k]], right[k]
    for k in range(d):
        for i in range(k + 1, d):
            right[i] -= matrix[i, k] * right[k]
    for k in range(d - 1, -1, -1):
        for j in range(k + 1, d):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]


@compiled
def _write_matrices(h: float, method: Collocation, matrices: FloatArray, factors: Any, pivots: Any) -> None:
    """Factorise the matrix of each mode into factors (m, d, d)."""
    d = matrices.shape[1]
    for mode in range(len(method.eigenvalues)):
        z = h * method.eigenvalues[mode]
        for i in range(d):
            for k in range(d):
                entry = matrices[0, k, i] + z * matrices[1, k, i] - z * z * matrices[2, k, i]
                factors[mode, i, k] = entry
        _factorise(factors[mode], pivots[mode])


@part
def _write_residuals(
    system: Any, method: Collocation, motion: Motion, step: int, h: float, residuals: FloatArray
) -> None:
    """Write what is missing from the momentum at each stage into residuals (s, d); leaves the forces in the motion."""
    stages, d = len(method.b), len(motion.q)
    rates, forces = motion.slopes[0], motion.slopes[1]
    inner_q, momenta = np.empty(d), np.empty((stages, d))
    for s in range(stages):
        combine(method.a[s], h, motion.q, rates, inner_q)
        momentum(system, inner_q, rates[s], momenta[s])
        generalized_force(system, (step + method.c[s]) * h, inner_q, rates[s], forces[s])
    for s in range(stages):
        combine(method.a[s], h, motion.p, forces, residuals[s])
        for i in range(d):
            residuals[s, i] -= momenta[s, i]


@compiled
def _improve(method: Collocation, factors: Any, pivots: Any, residuals: FloatArray, rates: FloatArray) -> float:
    """Add to the rates (s, d) what the residuals (s, d) ask for; the largest change, or nan."""
    stages, d = residuals.shape
    largest = 0.0
    changes, mode_change = np.zeros((stages, d)), np.empty(d, np.complex128)
    for mode in range(len(method.eigenvalues)):
        for i in range(d):
            mode_change[i] = 0.0
            for s in range(stages):
                mode_change[i] += method.to_modes[mode, s] * residuals[s, i]
        _solve(factors[mode], pivots[mode], mode_change)
        for s in range(stages):
            for i in range(d):
                changes[s, i] += (method.from_modes[s, mode] * mode_change[i]).real
    for s in range(stages):
        for i in range(d):
            rates[s, i] += changes[s, i]
            size = abs(changes[s, i])
            largest = size if size > largest or np.isnan(size) else largest  # nan is kept
    return largest


@part
def _solve_stages(system: Any, method: Collocation, motion: Motion, step: int, h: float) -> bool:
    """Find the slopes of step number `step` of h (s); False where that does not converge, or the system is too large.

    Begins with the rates at the start of the step.
    """
    stages, d = len(method.b), len(motion.q)
    if d > MOST_COORDINATES:
        return False
    rates, start = motion.slopes[0], np.empty(d)
    velocity(system, motion.q, motion.p, start)
    for s in range(stages):
        for i in range(d):
            rates[s, i] = start[i]
    matrices, residuals = np.empty((3, d, d)), np.empty((stages, d))
    modes = len(method.eigenvalues)
    factors, pivots = np.empty((modes, d, d), np.complex128), np.empty((modes, d), np.int64)
    _write_derivatives(system, step * h, motion.q, start, matrices)
    _write_matrices(h, method, matrices, factors, pivots)
    before = np.inf
    for _ in range(_MOST_ITERATIONS):
        _write_residuals(system, method, motion, step, h, residuals)
        change = _improve(method, factors, pivots, residuals, rates)
        size = 0.0
        for s in range(stages):
            for i in range(d):
                size = max(size, abs(rates[s, i]))
        near = change <= NEAR * (1.0 + size)
        if near and (change == 0.0 or change >= _SLOWEST * before):
            # Rounding has the last word; the forces are to be those of the last rates.
            _write_residuals(system, method, motion, step, h, residuals)
            return True
        if not (near or change <= _SLOWEST * before):
            return False
        before = change
    return False


@compiled
def collocate_by_newton(system: Any, method: Collocation, motion: Motion, first: int, h: float, steps: int) -> int:
    """Take steps as `methods.FixedStep` says; stops at the first that does not converge."""
    for step in range(first, first + steps):
        if not _solve_stages(system, method, motion, step, h):
            return step - first
        add_slopes(method.b, h, motion.slopes[0], motion.q, motion.carry[0])
        add_slopes(method.b, h, motion.slopes[1], motion.p, motion.carry[1])
    return steps
