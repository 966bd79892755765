"""The loop with a fixed step for explicit Runge-Kutta methods, and the sums of stages that others use too."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined
from pendbench.solvers.copying import copy
from pendbench.solvers.methods import FixedStep, Form
from pendbench.solvers.problem import derivative


class Tableau(NamedTuple):
    """An explicit Runge-Kutta method: a (s, s) strictly lower triangular, b (s,), c (s,), and its order."""

    a: FloatArray
    b: FloatArray
    c: FloatArray
    order: int


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


@inlined
def stage_state(a: FloatArray, row: int, h: float, y: FloatArray, k: FloatArray, out: FloatArray) -> None:
    """Write `y + h sum_j a[row, j] k[j]` over the stages before `row` into `out`."""
    copy(y, out)
    add_stages(a[row], row, h, k, out)


@compiled
def runge_kutta(system: Any, method: Tableau, y: FloatArray, first: int, dt: float, steps: int) -> None:
    """Take steps as `methods.FixedStep` says; y (d,) in place."""
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


class _State(NamedTuple):
    """y (2 d,), and the two halves of it."""

    y: FloatArray
    q: FloatArray
    v: FloatArray


def _begin(q: FloatArray, v: FloatArray) -> _State:
    y = np.concatenate([q, v])
    return _State(y, *np.split(y, 2))


def runge_kutta_method(name: str, tableau: Tableau, note: str) -> FixedStep:
    """The method with these coefficients."""

    def advance(system: Any, state: _State, first: int, dt: float, steps: int) -> int:
        runge_kutta(system, tableau, state.y, first, dt, steps)
        return steps

    return FixedStep(name, tableau.order, note, Form.RATES, _begin, advance)
