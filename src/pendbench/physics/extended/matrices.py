"""A third form of the reference with effects: the equations as matrices, solved as they stand, in O(n^3).

For links that the mobilities do not suit, and for rotors in the joints. The state, (4 n + 1, 2), is that of
`mobilities`, and so are the air's forces; with `inertias`, it shares the effects' laws and nothing else.
docs/equations.md, (E6), (E40), (E53), (E55).
"""

from __future__ import annotations

from fractions import Fraction
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import part, specialise
from pendbench.physics.acting import rotor_inertias
from pendbench.physics.extended.acting import Acting, acting_on, pivot, write_torques
from pendbench.physics.extended.mobilities import start_with_directions
from pendbench.physics.extended.moments import doubled, moments_of
from pendbench.physics.kernels import laws
from pendbench.scene.scene import Scene
from pendbench.solvers.extended.extrapolation import extended_derivative
from pendbench.solvers.extended.number import extended, load, store


class MatrixForm(NamedTuple):
    """lengths (n,) m; hanging, leans (n, 2) kg: what hangs on each link, and what its turning lacks, over l^2.

    rotors (n,) kg m^2, in the joints. What acts; matrix (n, n, 2) and right (n, 2): room.
    """

    lengths: FloatArray
    hanging: FloatArray
    leans: FloatArray
    rotors: FloatArray
    acting: Acting
    matrix: FloatArray
    right: FloatArray


def matrix_form(scene: Scene) -> tuple[MatrixForm, FloatArray]:
    """The system and its state (4 n + 1, 2) at the scene's start."""
    its, n = moments_of(scene), scene.n
    hanging = list(accumulate(reversed(its.lumped()), initial=Fraction(0)))[:0:-1]
    links = np.array(scene.lengths), doubled(hanging), doubled(its.leans()), rotor_inertias(scene)
    return MatrixForm(*links, acting_on(scene), np.empty((n, n, 2)), np.empty((n, 2))), start_with_directions(scene)


@part
def _write_pushes(s: MatrixForm, y: FloatArray) -> None:
    """Write what weight, joints and air do to each link's angle, over its length, (n, 2) N, into the room."""
    n, t = len(s.lengths), load(y, 4 * len(s.lengths))
    ax, ay, u, v = pivot(s.acting.pivots, t)
    write_torques(s.acting.joints, t, y, s.right)
    for i in range(n):
        store(s.right, i, load(s.right, i) / s.lengths[i])
        si, c = load(y, 2 * n + i), load(y, 3 * n + i)
        speed = load(y, n + i) * s.lengths[i]
        u, v = u + c * speed, v + si * speed
        x, z = laws.drag(s.acting.drags, i, u, v)
        pushed_x, pushed_z = extended(x), extended(z)
        for j in range(i + 1):  # a force on the end of link i pushes all links before it
            across = load(y, 3 * n + j) * pushed_x + load(y, 2 * n + j) * pushed_z
            store(s.right, j, load(s.right, j) + across)
    for i in range(n):
        weight = load(y, 3 * n + i) * ax + load(y, 2 * n + i) * ay
        store(s.right, i, load(s.right, i) - load(s.hanging, i) * weight)


@part
def _write_matrix(s: MatrixForm, y: FloatArray) -> None:
    """Write C over the lengths of both links, below and on the diagonal, and take S omega^2 into the right side."""
    n = len(s.lengths)
    for i in range(n):
        si, c, hanging = load(y, 2 * n + i), load(y, 3 * n + i), load(s.hanging, i)
        own = load(y, n + i) * load(y, n + i) * s.lengths[i]
        for j in range(i):
            si_j, c_j = load(y, 2 * n + j), load(y, 3 * n + j)
            store(s.matrix[i], j, hanging * (c * c_j + si * si_j))
            turn = hanging * (si * c_j - c * si_j)
            other = load(y, n + j) * load(y, n + j) * s.lengths[j]
            store(s.right, i, load(s.right, i) - turn * other)
            store(s.right, j, load(s.right, j) + turn * own)
        store(s.matrix[i], i, hanging + load(s.leans, i))
    for i in range(n):
        turned = extended(s.rotors[i]) / s.lengths[i]
        store(s.matrix[i], i, load(s.matrix[i], i) + turned / s.lengths[i])
        if i > 0:
            before = s.rotors[i] / extended(s.lengths[i - 1])
            store(s.matrix[i], i - 1, load(s.matrix[i], i - 1) - turned / s.lengths[i - 1])
            store(s.matrix[i - 1], i - 1, load(s.matrix[i - 1], i - 1) + before / s.lengths[i - 1])


@part
def _solve(matrix: FloatArray, right: FloatArray) -> None:
    """Solve in place by Cholesky's method without roots: L D L^T, with D on the diagonal."""
    n = len(right)
    for j in range(n):
        for i in range(j, n):
            value = load(matrix[i], j)
            for k in range(j):
                value = value - load(matrix[i], k) * load(matrix[k], k) * load(matrix[j], k)
            store(matrix[i], j, value if i == j else value / load(matrix[j], j))
    for i in range(n):
        for k in range(i):
            store(right, i, load(right, i) - load(matrix[i], k) * load(right, k))
    for i in range(n - 1, -1, -1):
        store(right, i, load(right, i) / load(matrix[i], i))
        for k in range(i + 1, n):
            store(right, i, load(right, i) - load(matrix[k], i) * load(right, k))


@part
def _matrix_derivative(s: MatrixForm, y: FloatArray, dy: FloatArray) -> None:
    n = len(s.lengths)
    _write_pushes(s, y)
    _write_matrix(s, y)
    _solve(s.matrix, s.right)
    for i in range(n):
        rate: Any = load(y, n + i)
        store(dy, i, rate)
        store(dy, n + i, load(s.right, i) / s.lengths[i])
        store(dy, 2 * n + i, load(y, 3 * n + i) * rate)
        store(dy, 3 * n + i, -(load(y, 2 * n + i) * rate))
    store(dy, 4 * n, extended(1.0))


specialise(extended_derivative, MatrixForm, _matrix_derivative)
