"""Collocation as data: the coefficients, a motion with what is kept of it from step to step, and its stages."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.solvers.compensated import add

#: A change of the rates this small, over their size, is near the end of an iteration.
NEAR = 1e-11


class Collocation(NamedTuple):
    """a (s, s), b (s,), c (s,); extrapolate (s, s) takes values at c to those at 1 + c; order 2 s.

    eigenvalues (m,) are those of a, one of each pair of conjugates; `to_modes` (m, s) and the real part of `from_modes`
    (s, m) take values at the stages to the modes of a and back.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    extrapolate: FloatArray
    order: int
    eigenvalues: Any
    to_modes: Any
    from_modes: Any


class Motion(NamedTuple):
    """q (d,) and p (d,), and what is kept from step to step.

    carry (2, d): what rounding left out of q and p. slopes (2, s, d): the rates and forces at the stages of the step
    before. with_newton (1,): how many steps are to be solved by Newton's method at once.
    """

    q: FloatArray
    p: FloatArray
    carry: FloatArray
    slopes: FloatArray
    with_newton: Any


def motion_from(q: FloatArray, p: FloatArray, v: FloatArray, stages: int) -> Motion:
    """The motion at its start q, p (d,), copied; v (d,): the rates there, to begin the iteration with."""
    motion = Motion(q.copy(), p.copy(), np.zeros((2, len(q))), np.zeros((2, stages, len(q))), np.zeros(1, np.int64))
    motion.slopes[0] = v
    return motion


def gauss_legendre(stages: int) -> Collocation:
    """The method with nodes at the roots of the shifted Legendre polynomial of degree `stages`."""
    roots, weights = np.polynomial.legendre.leggauss(stages)
    c = 0.5 * (roots + 1.0)
    degrees = np.arange(stages)
    powers = c[:, None] ** degrees
    to_coefficients = np.linalg.inv(powers)
    integrals = c[:, None] ** (degrees + 1) / (degrees + 1)
    a = integrals @ to_coefficients
    eigenvalues, vectors = np.linalg.eig(a.astype(np.complex128))
    kept = eigenvalues.imag > -1e-9
    twice = np.where(eigenvalues[kept].imag > 1e-9, 2.0, 1.0)  # for the conjugate that is left out
    return Collocation(
        a=a,
        b=0.5 * weights,
        c=c,
        extrapolate=((1.0 + c)[:, None] ** degrees) @ to_coefficients,
        order=2 * stages,
        eigenvalues=eigenvalues[kept],
        to_modes=np.ascontiguousarray(np.linalg.inv(vectors)[kept]),
        from_modes=np.ascontiguousarray(vectors[:, kept] * twice),
    )


@inlined
def combine(weights: FloatArray, h: float, start: FloatArray, slopes: FloatArray, out: FloatArray) -> None:
    """Out = start + h sum_j weights[j] slopes[j]."""
    for i in range(len(start)):
        total = 0.0
        for j in range(len(weights)):
            total += weights[j] * slopes[j, i]
        out[i] = start[i] + h * total


@inlined
def add_slopes(weights: FloatArray, h: float, slopes: FloatArray, y: FloatArray, carry: FloatArray) -> None:
    """Y += h sum_j weights[j] slopes[j], with the rounding errors kept in `carry`."""
    for i in range(len(y)):
        total = 0.0
        for j in range(len(weights)):
            total += weights[j] * slopes[j, i]
        y[i], carry[i] = add(y[i], carry[i], h * total)
