"""The chain in double-double arithmetic, in two formulations that share no step: the two sides of the reference.

The angle form has angles and rates for its state and the recursion for its accelerations. The vector form has sines,
cosines and rates, needs no trigonometry, and gets the tensions from the tridiagonal system that says that rods keep
their lengths (docs/equations.md).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, part, specialise
from pendbench.physics.acting import check_plain
from pendbench.scene.scene import Scene
from pendbench.solvers.extended.double_double import (
    PI,
    add,
    divide,
    multiply,
    scale,
    sine_cosine,
    split,
    subtract,
    two_product,
)
from pendbench.solvers.extended.extrapolation import extended_derivative

_TURN = split(2 * PI, 3)  # 2 pi in three parts


class AngleForm(NamedTuple):
    """State (2 n, 2): theta, omega. scratch: room for the recursion."""

    masses: FloatArray
    lengths: FloatArray
    gravity: float
    scratch: FloatArray


class VectorForm(NamedTuple):
    """State (3 n, 2): sin theta, cos theta, omega. scratch: room for the tridiagonal system."""

    masses: FloatArray
    lengths: FloatArray
    gravity: float
    scratch: FloatArray


def _arguments(scene: Scene) -> tuple[FloatArray, FloatArray, float, FloatArray]:
    check_plain(scene, "this form of the reference")
    gravity = scene.effects.gravity
    scratch = np.empty((4, scene.n, 2))
    return np.array(scene.masses), np.array(scene.lengths), 0.0 if gravity is None else float(gravity), scratch


def angle_form(scene: Scene) -> tuple[AngleForm, FloatArray]:
    """The system and its state (2 n, 2) at the scene's start, without whole turns: they would cost digits."""
    start = np.concatenate([scene.angles, scene.rates])
    state = np.stack([start, np.zeros_like(start)], axis=1)
    return AngleForm(*_arguments(scene)), _turned(state, -_whole_turns(scene))


def with_whole_turns(scene: Scene, state: FloatArray) -> FloatArray:
    """A state (2 n, 2) of the angle form with the turns that `angle_form` left out, as a new array."""
    return _turned(state.copy(), _whole_turns(scene))


def _whole_turns(scene: Scene) -> FloatArray:
    return np.rint(scene.angles / (2 * math.pi))


def _turned(state: FloatArray, turns: FloatArray) -> FloatArray:
    """The state (2 n, 2) with `turns` (n,) added to its angles, in place."""
    for i in np.flatnonzero(turns):
        angle = (state[i, 0], state[i, 1])
        for digits in _TURN:
            angle = add(angle, two_product(float(turns[i]), digits))
        state[i] = angle
    return state


def vector_form(scene: Scene) -> tuple[VectorForm, FloatArray]:
    """The system and its state (3 n, 2) at the scene's start."""
    n = scene.n
    state = np.zeros((3 * n, 2))
    for i, angle in enumerate(scene.angles):
        state[i], state[n + i] = sine_cosine((float(angle), 0.0))
    state[2 * n :, 0] = scene.rates
    return VectorForm(*_arguments(scene)), state


@part
def _angle_derivative(system: AngleForm, y: FloatArray, dy: FloatArray) -> None:
    masses, lengths = system.masses, system.lengths
    cosine, sine, p, k = system.scratch[0], system.scratch[1], system.scratch[2], system.scratch[3]
    n = len(masses)
    alpha = (masses[n - 1], 0.0)
    w = (y[2 * n - 1, 0], y[2 * n - 1, 1])
    beta = multiply(scale(alpha, lengths[n - 1]), multiply(w, w))
    for i in range(n - 2, -1, -1):
        m = (masses[i], 0.0)
        s, c = sine_cosine(subtract((y[i + 1, 0], y[i + 1, 1]), (y[i, 0], y[i, 1])))
        below = add(m, multiply(alpha, multiply(s, s)))
        s_over = divide(s, below)
        cosine[i, 0], cosine[i, 1] = c
        sine[i, 0], sine[i, 1] = s
        p[i, 0], p[i, 1] = multiply(s_over, beta)
        k[i, 0], k[i, 1] = multiply(multiply(s_over, c), alpha)
        m_over = divide(m, below)
        beta = multiply(multiply(m_over, c), beta)
        alpha = multiply(m_over, add(m, alpha))
        w = (y[n + i, 0], y[n + i, 1])
        beta = add(beta, multiply(scale(alpha, lengths[i]), multiply(w, w)))
    s, c = sine_cosine((y[0, 0], y[0, 1]))
    radial, transverse = scale(c, -system.gravity), scale(s, system.gravity)
    for i in range(n):
        w = (y[n + i, 0], y[n + i, 1])
        dy[i, 0], dy[i, 1] = w
        radial = subtract(radial, scale(multiply(w, w), lengths[i]))
        q = (0.0, 0.0)
        if i < n - 1:
            q = subtract((p[i, 0], p[i, 1]), multiply((k[i, 0], k[i, 1]), radial))
        dy[n + i, 0], dy[n + i, 1] = divide(subtract(q, transverse), (lengths[i], 0.0))
        if i < n - 1:
            c, s = (cosine[i, 0], cosine[i, 1]), (sine[i, 0], sine[i, 1])
            radial, transverse = (
                add(multiply(c, radial), multiply(s, q)),
                subtract(multiply(c, q), multiply(s, radial)),
            )


@part
def _cross_terms(y: FloatArray, i: int, n: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Cos and sin of theta_{i+1} - theta_i from the sines and cosines of the state."""
    s, c = (y[i, 0], y[i, 1]), (y[n + i, 0], y[n + i, 1])
    s_next, c_next = (y[i + 1, 0], y[i + 1, 1]), (y[n + i + 1, 0], y[n + i + 1, 1])
    cosine = add(multiply(c_next, c), multiply(s_next, s))
    return cosine, subtract(multiply(s_next, c), multiply(c_next, s))


@part
def _vector_derivative(system: VectorForm, y: FloatArray, dy: FloatArray) -> None:
    """Rods keep their lengths: u_i . (a_i - a_{i-1}) = -l_i omega_i^2, linear in the tensions and tridiagonal."""
    masses, lengths = system.masses, system.lengths
    pivot, right, cosine, sine = system.scratch[0], system.scratch[1], system.scratch[2], system.scratch[3]
    n = len(masses)
    # Elimination from the pivot outwards: diagonal 1/m_{i-1} + 1/m_i (no mass at the pivot), off it -cos / m.
    for i in range(n):
        w = (y[2 * n + i, 0], y[2 * n + i, 1])
        wanted = scale(multiply(w, w), lengths[i])
        diagonal = divide((1.0, 0.0), (masses[i], 0.0))
        if i == 0:
            wanted = add(wanted, scale((y[n, 0], y[n, 1]), system.gravity))
        else:
            inverse = divide((1.0, 0.0), (masses[i - 1], 0.0))
            coupling = multiply((cosine[i - 1, 0], cosine[i - 1, 1]), inverse)
            ratio = divide(coupling, (pivot[i - 1, 0], pivot[i - 1, 1]))
            diagonal = subtract(add(diagonal, inverse), multiply(ratio, coupling))
            wanted = add(wanted, multiply(ratio, (right[i - 1, 0], right[i - 1, 1])))
        pivot[i, 0], pivot[i, 1] = diagonal
        right[i, 0], right[i, 1] = wanted
        if i < n - 1:
            c, s = _cross_terms(y, i, n)
            cosine[i, 0], cosine[i, 1] = c
            sine[i, 0], sine[i, 1] = s
    tension = right
    for i in range(n - 1, -1, -1):
        value = (right[i, 0], right[i, 1])
        if i < n - 1:
            pull = multiply((cosine[i, 0], cosine[i, 1]), (tension[i + 1, 0], tension[i + 1, 1]))
            value = add(value, divide(pull, (masses[i], 0.0)))
        tension[i, 0], tension[i, 1] = divide(value, (pivot[i, 0], pivot[i, 1]))
    # Across rod i: l_i theta_i'' = t_i . (a_i - a_{i-1}); only the neighbours' tensions have a part across it.
    for i in range(n):
        s, c, w = (y[i, 0], y[i, 1]), (y[n + i, 0], y[n + i, 1]), (y[2 * n + i, 0], y[2 * n + i, 1])
        across = (0.0, 0.0)
        if i < n - 1:
            pull = multiply((sine[i, 0], sine[i, 1]), (tension[i + 1, 0], tension[i + 1, 1]))
            across = divide(pull, (masses[i], 0.0))
        if i == 0:
            across = subtract(across, scale(s, system.gravity))
        else:
            pull = multiply((sine[i - 1, 0], sine[i - 1, 1]), (tension[i - 1, 0], tension[i - 1, 1]))
            across = subtract(across, divide(pull, (masses[i - 1], 0.0)))
        dy[i, 0], dy[i, 1] = multiply(c, w)
        dy[n + i, 0], dy[n + i, 1] = multiply((-s[0], -s[1]), w)
        dy[2 * n + i, 0], dy[2 * n + i, 1] = divide(across, (lengths[i], 0.0))


specialise(extended_derivative, AngleForm, _angle_derivative)
specialise(extended_derivative, VectorForm, _vector_derivative)


@compiled
def form_difference(angles: FloatArray, vectors: FloatArray) -> FloatArray:
    """Theta of the vector form's state minus theta of the angle form's, (n,) rad, for differences well below 1."""
    n = len(angles) // 2
    out = np.empty(n)
    for i in range(n):
        s, c = sine_cosine((angles[i, 0], angles[i, 1]))
        s_other, c_other = (vectors[i, 0], vectors[i, 1]), (vectors[n + i, 0], vectors[n + i, 1])
        sine = subtract(multiply(s_other, c), multiply(c_other, s))
        cosine = add(multiply(s_other, s), multiply(c_other, c))
        out[i] = math.atan2(sine[0], cosine[0])
    return out
