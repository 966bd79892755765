"""Gauss-Legendre collocation in canonical variables: implicit, symplectic, of order twice the number of stages.

The stages are solved by fixed-point iteration, which asks for steps shorter than the fastest motion in the system. A
step whose iteration does not converge is begun again with Newton's method (`newton`), and so are the few after it.
Sources: Hairer, Lubich, Wanner, Geometric Numerical Integration, II.1.3, VI.6.2 (momenta from a Lagrangian), VIII.6
(iteration until rounding, starting values from the polynomial of the step before); compensated summation against the
drift of rounding: Hairer, McLachlan, Razakarivony, BIT 48 (2008).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined
from pendbench.solvers.collocation import NEAR, Collocation, Motion, add_slopes, combine, gauss_legendre, motion_from
from pendbench.solvers.copying import copy_rows
from pendbench.solvers.methods import FixedStep, Form, add
from pendbench.solvers.newton import collocate_by_newton
from pendbench.solvers.problem import generalized_force, velocity

_MOST_ITERATIONS = 100
# So many steps in a row take Newton's method at once, before the cheap iteration is tried again.
_STEPS_WITH_NEWTON = 50


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


class _Room(NamedTuple):
    """rates, forces (s, d): the slopes; guess (s, d), inner_q, inner_p, new (d,): for a while."""

    rates: FloatArray
    forces: FloatArray
    guess: FloatArray
    inner_q: FloatArray
    inner_p: FloatArray
    new: FloatArray


@inlined
def _iterate(
    system: Any, a: FloatArray, c: FloatArray, q: FloatArray, p: FloatArray, step: int, h: float, room: _Room
) -> bool:
    """Find the slopes of step number `step` from q, p (d,) by fixed-point iteration; whether it converged."""
    rates, forces, inner_q, inner_p, new = room.rates, room.forces, room.inner_q, room.inner_p, room.new
    change, before, size = np.inf, np.inf, 0.0
    for _ in range(_MOST_ITERATIONS):
        before, change, size = change, 0.0, 0.0
        for s in range(len(c)):
            combine(a[s], h, q, rates, inner_q)
            combine(a[s], h, p, forces, inner_p)
            velocity(system, inner_q, inner_p, new)
            for i in range(len(new)):
                moved = abs(new[i] - rates[s, i])
                if not moved <= change:  # so that nan counts
                    change = moved
                size = max(size, abs(new[i]))
                rates[s, i] = new[i]
            generalized_force(system, (step + c[s]) * h, inner_q, new, forces[s])
        if not change < np.inf:
            return False
        # Rounding has the last word: near the end, iterate until the change no longer falls.
        if change == 0.0 or (change <= NEAR * (1.0 + size) and change >= before):
            break
    return change <= NEAR * (1.0 + size)


def collocate(system: Any, method: Collocation, motion: Motion, first: int, h: float, steps: int) -> int:
    """Take steps as `methods.FixedStep` says; stops at the first whose iteration does not converge."""
    # A group costs Python a microsecond and more, so it passes arrays.
    taken: int = _collocate(system, *method[:4], *motion[:4], first, h, steps)
    return taken


@compiled
def _collocate(
    system: Any,
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    extrapolate: FloatArray,
    q: FloatArray,
    p: FloatArray,
    carry: FloatArray,
    slopes: FloatArray,
    first: int,
    h: float,
    steps: int,
) -> int:
    rates, forces, d = slopes[0], slopes[1], len(q)
    room = _Room(rates, forces, np.empty_like(rates), np.empty(d), np.empty(d), np.empty(d))
    carry_q, carry_p = carry[0], carry[1]
    for step in range(first, first + steps):
        _guess(extrapolate, rates, room.guess)
        _guess(extrapolate, forces, room.guess)
        if not _iterate(system, a, c, q, p, step, h, room):
            return step - first
        add_slopes(b, h, rates, q, carry_q)
        add_slopes(b, h, forces, p, carry_p)
    return steps


def take_steps(system: Any, method: Collocation, motion: Motion, first: int, h: float, steps: int) -> int:
    """The same, with Newton's method where it takes that: its kernels are compiled when they are first needed."""
    taken, left = 0, motion.with_newton
    while taken < steps:
        if left[0] == 0:
            taken += collocate(system, method, motion, first + taken, h, steps - taken)
            left[0] = 0 if taken == steps else _STEPS_WITH_NEWTON
        few = min(int(left[0]), steps - taken)
        done = collocate_by_newton(system, method, motion, first + taken, h, few) if few else 0
        taken += done
        left[0] -= done
        if done < few:
            break
    return taken


def _method(name: str, stages: int, words: str) -> FixedStep:
    collocation = gauss_legendre(stages)

    def advance(system: Any, motion: Motion, first: int, dt: float, steps: int) -> int:
        return take_steps(system, collocation, motion, first, dt, steps)

    return FixedStep(
        name,
        order=collocation.order,
        note=f"Gauss-Legendre collocation with {words} stages: implicit, symplectic",
        form=Form.MOMENTA,
        begin=lambda q, p, v: motion_from(q, p, v, stages),
        advance=advance,
        stuck="the stages of a step did not converge",
        remedy="a smaller step might",
    )


add(_method("gauss4", 2, "two"))
add(_method("gauss6", 3, "three"))
