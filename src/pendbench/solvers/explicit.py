"""Loops with a fixed step: explicit Runge-Kutta methods and semi-implicit Euler."""

from __future__ import annotations

from typing import Any

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.compiled import compiled, inlined
from pendbench.solvers.copying import copy
from pendbench.solvers.problem import acceleration, derivative
from pendbench.solvers.tableaux import Tableau


@inlined
def stage_state(a: FloatArray, row: int, h: float, y: FloatArray, k: FloatArray, out: FloatArray) -> None:
    """Write `y + h sum_j a[row, j] k[j]` over the stages before `row` into `out`."""
    copy(y, out)
    for j in range(row):
        weight = h * a[row, j]
        if weight != 0.0:
            for i in range(len(y)):
                out[i] += weight * k[j, i]


@inlined
def add_stages(weights: FloatArray, stages: int, h: float, k: FloatArray, out: FloatArray) -> None:
    """Add `h sum_j weights[j] k[j]` over the first `stages` stages to `out`, four at a time: each pass costs memory."""
    together = stages - stages % 4
    for j in range(0, together, 4):
        w0, w1, w2, w3 = h * weights[j], h * weights[j + 1], h * weights[j + 2], h * weights[j + 3]
        for i in range(len(out)):
            out[i] += (w0 * k[j, i] + w1 * k[j + 1, i]) + (w2 * k[j + 2, i] + w3 * k[j + 3, i])
    for j in range(together, stages):
        weight = h * weights[j]
        if weight != 0.0:
            for i in range(len(out)):
                out[i] += weight * k[j, i]


@compiled
def runge_kutta(system: Any, method: Tableau, first: int, dt: float, y: FloatArray, steps: int) -> None:
    """Take the steps from number `first` on, each of `dt`, the one with number 0 at time 0; y (d,) in place."""
    stages, d = len(method.b), len(y)
    k = np.empty((stages, d))
    inner = np.empty(d)
    for step in range(steps):
        start = (first + step) * dt
        for s in range(stages):
            stage_state(method.a, s, dt, y, k, inner)
            derivative(system, start + method.c[s] * dt, inner, k[s])
        for s in range(stages):
            weight = dt * method.b[s]
            for i in range(d):
                y[i] += weight * k[s, i]


@compiled
def semi_implicit_euler(system: Any, first: int, dt: float, q: FloatArray, v: FloatArray, steps: int) -> None:
    """Take steps of `dt` as `runge_kutta` does: first the rates v (d,), then with them q (d,), both in place.

    Symplectic for a Hamiltonian whose force does not depend on v; a chain's does, so here it is of order 1 and no more
    (Hairer, Lubich, Wanner, Geometric Numerical Integration, I.1.2).
    """
    a = np.empty_like(q)
    for step in range(steps):
        acceleration(system, (first + step) * dt, q, v, a)
        for i in range(len(q)):
            v[i] += dt * a[i]
            q[i] += dt * v[i]
