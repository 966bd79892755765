"""Gauss-Legendre collocation in canonical variables: implicit, symplectic, of order twice the number of stages.

The stages are solved by fixed-point iteration, which asks for steps shorter than the fastest motion in the system.
Sources: Hairer, Lubich, Wanner, Geometric Numerical Integration, II.1.3, VI.6.2 (momenta from a Lagrangian), VIII.6
(iteration until rounding, starting values from the polynomial of the step before); compensated summation against the
drift of rounding: Hairer, McLachlan, Razakarivony, BIT 48 (2008).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.compiled import compiled, inlined
from pendbench.solvers.copying import copy_rows
from pendbench.solvers.problem import generalized_force, velocity

_MOST_ITERATIONS = 100
_NEAR = 1e-11  # a change of the rates this small, over their size, is near the end of the iteration


class Collocation(NamedTuple):
    """a (s, s), b (s,), c (s,); extrapolate (s, s) takes values at c to those at 1 + c; order 2 s."""

    a: FloatArray
    b: FloatArray
    c: FloatArray
    extrapolate: FloatArray
    order: int


def gauss_legendre(stages: int) -> Collocation:
    """The method with nodes at the roots of the shifted Legendre polynomial of degree `stages`."""
    roots, weights = np.polynomial.legendre.leggauss(stages)
    c = 0.5 * (roots + 1.0)
    degrees = np.arange(stages)
    powers = c[:, None] ** degrees
    to_coefficients = np.linalg.inv(powers)
    integrals = c[:, None] ** (degrees + 1) / (degrees + 1)
    return Collocation(
        a=integrals @ to_coefficients,
        b=0.5 * weights,
        c=c,
        extrapolate=((1.0 + c)[:, None] ** degrees) @ to_coefficients,
        order=2 * stages,
    )


@inlined
def _combine(weights: FloatArray, h: float, start: FloatArray, slopes: FloatArray, out: FloatArray) -> None:
    """Out = start + h sum_j weights[j] slopes[j]."""
    for i in range(len(start)):
        total = 0.0
        for j in range(len(weights)):
            total += weights[j] * slopes[j, i]
        out[i] = start[i] + h * total


@inlined
def _add(weights: FloatArray, h: float, slopes: FloatArray, y: FloatArray, carry: FloatArray) -> None:
    """Y += h sum_j weights[j] slopes[j], with the rounding errors kept in `carry`."""
    for i in range(len(y)):
        total = 0.0
        for j in range(len(weights)):
            total += weights[j] * slopes[j, i]
        small = h * total + carry[i]
        value = y[i] + small
        carry[i] = small - (value - y[i])
        y[i] = value


@inlined
def _guess(extrapolate: FloatArray, slopes: FloatArray, room: FloatArray) -> None:
    """Replace the slopes of the step before by what their polynomial says of this one."""
    copy_rows(slopes, room)
    for s in range(len(extrapolate)):
        for i in range(slopes.shape[1]):
            total = 0.0
            for j in range(len(extrapolate)):
                total += extrapolate[s, j] * room[j, i]
            slopes[s, i] = total


@compiled
def collocate(
    system: Any,
    method: Collocation,
    first: int,
    h: float,
    q: FloatArray,
    p: FloatArray,
    carry: FloatArray,
    slopes: FloatArray,
    steps: int,
) -> int:
    """Take the steps from number `first` on, each of h, the one with number 0 at time 0; return how many converged.

    q (d,) and p (d,) are changed in place.

    carry (2, d): what rounding left out of q and p. slopes (2, s, d): the rates and forces at the stages of the step
    before, to begin the iteration with. Both are kept between calls. Stops at the first step whose stages do not
    converge.
    """
    stages, d = len(method.b), len(q)
    rates, forces = slopes[0], slopes[1]
    inner_q, inner_p, new = np.empty(d), np.empty(d), np.empty(d)
    room = np.empty((stages, d))
    for step in range(steps):
        _guess(method.extrapolate, rates, room)
        _guess(method.extrapolate, forces, room)
        change, before, size = np.inf, np.inf, 0.0
        for _ in range(_MOST_ITERATIONS):
            before, change, size = change, 0.0, 0.0
            for s in range(stages):
                _combine(method.a[s], h, q, rates, inner_q)
                _combine(method.a[s], h, p, forces, inner_p)
                velocity(system, inner_q, inner_p, new)
                for i in range(d):
                    moved = abs(new[i] - rates[s, i])
                    if not moved <= change:  # so that nan counts
                        change = moved
                    size = max(size, abs(new[i]))
                    rates[s, i] = new[i]
                generalized_force(system, (first + step + method.c[s]) * h, inner_q, new, forces[s])
            # Rounding has the last word: near the end, iterate until the change no longer falls.
            if change == 0.0 or (change <= _NEAR * (1.0 + size) and change >= before):
                break
        if not change <= _NEAR * (1.0 + size):
            return step
        _add(method.b, h, rates, q, carry[0])
        _add(method.b, h, forces, p, carry[1])
    return steps
