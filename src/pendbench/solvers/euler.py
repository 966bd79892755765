"""Semi-implicit Euler: the method of most engines for games."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled
from pendbench.solvers.methods import FixedStep, Form, add
from pendbench.solvers.problem import acceleration


class _State(NamedTuple):
    q: FloatArray
    v: FloatArray


def _begin(q: FloatArray, v: FloatArray) -> _State:
    return _State(q.copy(), v.copy())


@compiled
def semi_implicit_euler(system: Any, state: _State, first: int, dt: float, steps: int) -> int:
    """Take steps as `methods.FixedStep` says: first the rates v (d,), then with them q (d,).

    Symplectic for a Hamiltonian whose force does not depend on v; a chain's does, so here it is of order 1 and no more
    (Hairer, Lubich, Wanner, Geometric Numerical Integration, I.1.2).
    """
    q, v = state.q, state.v
    a = np.empty_like(q)
    for step in range(steps):
        acceleration(system, (first + step) * dt, q, v, a)
        for i in range(len(q)):
            v[i] += dt * a[i]
            q[i] += dt * v[i]
    return steps


add(
    FixedStep(
        "euler",
        order=1,
        note="semi-implicit Euler, the method of most engines for games",
        form=Form.RATES,
        begin=_begin,
        advance=semi_implicit_euler,
    )
)
