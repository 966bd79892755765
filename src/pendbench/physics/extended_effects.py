"""The chain with effects in double-double arithmetic, in two formulations: the two sides of its reference.

The recursive form eliminates link after link, each with an inertia (2, 2). The dense form solves the matrices of the
equations of motion, in the frame of the ground. They share the effects' laws and nothing else (docs/equations.md,
(E36) to (E46)). State (2 n + 1, 2): theta, omega, t; the time is one of the variables, since the method of the
reference knows none.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.compiled import compiled, specialise
from pendbench.physics import acting, laws
from pendbench.physics.system import system_of
from pendbench.scene import Scene
from pendbench.solvers.extended_number import extended, load, store
from pendbench.solvers.extrapolation import extended_derivative


class RecursiveForm(NamedTuple):
    """points and rods (n,) kg, lengths (n,) m; the rest as in `system.System`. room (9, n, 2)."""

    points: FloatArray
    rods: FloatArray
    lengths: FloatArray
    gravity: float
    frames: Any
    joints: Any
    drags: Any
    room: FloatArray


class DenseForm(NamedTuple):
    """points and rods (n,) kg, lengths (n,) m; the rest as in `system.System`. room (8, n, 2), matrix (n, n, 2)."""

    points: FloatArray
    rods: FloatArray
    lengths: FloatArray
    gravity: float
    frames: Any
    joints: Any
    drags: Any
    room: FloatArray
    matrix: FloatArray


def recursive_form(scene: Scene) -> tuple[RecursiveForm, FloatArray]:
    """The system and its state (2 n + 1, 2) at the scene's start."""
    return RecursiveForm(**_arguments(scene), room=np.empty((9, scene.n, 2))), _start(scene)


def dense_form(scene: Scene) -> tuple[DenseForm, FloatArray]:
    """The system and its state (2 n + 1, 2) at the scene's start."""
    room, matrix = np.empty((8, scene.n, 2)), np.empty((scene.n, scene.n, 2))
    return DenseForm(**_arguments(scene), room=room, matrix=matrix), _start(scene)


def _arguments(scene: Scene) -> dict[str, Any]:
    system = system_of(scene)
    effects = {name: getattr(system, name) for name in ("gravity", "frames", "joints", "drags")}
    chain = {"points": np.array(scene.masses), "rods": acting.rods(scene), "lengths": np.array(scene.lengths)}
    return {**chain, **effects}


def _start(scene: Scene) -> FloatArray:
    state = np.zeros((2 * scene.n + 1, 2))
    state[:-1, 0] = np.concatenate([scene.angles, scene.rates])
    return state


@compiled
def _write_torques(joints: Any, y: FloatArray, out: FloatArray) -> None:
    """Write the torque on each rod (n, 2) N m: of its own joint, less that of the next one."""
    n = len(out)
    drives = laws.drives(joints, load(y, 2 * n))
    outer = extended(0.0)
    for i in range(n - 1, -1, -1):
        bend, rate = load(y, i), load(y, n + i)
        if i > 0:
            bend, rate = bend - load(y, i - 1), rate - load(y, n + i - 1)
        own = extended(laws.joint_torque(joints, drives, i, bend, rate))
        store(out, i, own - outer)
        outer = own


@compiled
def _pivot(frames: Any, gravity: float, t: Any) -> tuple[Any, Any, Any, Any]:
    """The pivot's acceleration against free fall, and its velocity."""
    x, y = laws.pivot_acceleration(frames, t)
    u, v = laws.pivot_velocity(frames, t)
    return extended(x), extended(y) + gravity, extended(u), extended(v)


@compiled
def _recursive_derivative(s: RecursiveForm, y: FloatArray, dy: FloatArray) -> None:
    n = len(s.points)
    cosine, sine, along, across, torque = s.room[0], s.room[1], s.room[2], s.room[3], s.room[4]
    own, turned, passed, whirl = s.room[5], s.room[6], s.room[7], s.room[8]
    zero = extended(0.0)
    ax, ay, u, v = _pivot(s.frames, s.gravity, load(y, 2 * n))
    c, si = np.cos(load(y, 0)), np.sin(load(y, 0))
    start_along, start_across = si * ax - c * ay, c * ax + si * ay
    fast_along, fast_across = si * u - c * v, c * u + si * v
    _write_torques(s.joints, y, torque)
    for i in range(n):
        rate = load(y, n + i)
        store(whirl, i, rate * rate * s.lengths[i])
        fast_across = fast_across + rate * s.lengths[i]
        pulled, pushed = laws.drag(s.drags, i, fast_along, fast_across)
        store(along, i, extended(pulled))
        store(across, i, extended(pushed))
        c, si = extended(1.0), zero
        if i < n - 1:
            bend = load(y, i + 1) - load(y, i)
            c, si = np.cos(bend), np.sin(bend)
        store(cosine, i, c)
        store(sine, i, si)
        fast_along, fast_across = c * fast_along + si * fast_across, c * fast_across - si * fast_along
    uu, ut, tt, pull_along, pull_across = zero, zero, zero, zero, zero
    for i in range(n - 1, -1, -1):
        c, si, rod = load(cosine, i), load(sine, i), extended(s.rods[i])
        # What hangs on the end of rod i, in its own frame; a torque acts on the rod itself.
        a_uu = c * c * uu - c * si * ut * 2.0 + si * si * tt + s.points[i]
        a_tt = si * si * uu + c * si * ut * 2.0 + c * c * tt + s.points[i]
        a_ut = c * si * (uu - tt) + (c * c - si * si) * ut
        b_u = load(along, i) + c * pull_along - si * pull_across
        b_t = load(across, i) + si * pull_along + c * pull_across
        effort = load(torque, i) / s.lengths[i]
        inverse = extended(1.0) / (rod / 3.0 + a_tt)
        leaning = a_ut * inverse
        free = (effort + b_t) * inverse + leaning * load(whirl, i)
        store(own, i, free)
        store(turned, i, leaning)
        store(passed, i, (rod / 2.0 + a_tt) * inverse)
        pull_along = b_u + (a_uu + rod / 2.0) * load(whirl, i) - a_ut * free
        pull_across = -(rod / 6.0 * free) - effort
        uu = rod + a_uu - a_ut * leaning
        ut = -(rod / 6.0 * leaning)
        tt = rod / 3.0 * (rod / 4.0 + a_tt) * inverse
    for i in range(n):
        turning = load(own, i) - load(turned, i) * start_along - load(passed, i) * start_across
        store(dy, i, load(y, n + i))
        store(dy, n + i, turning / s.lengths[i])
        end_along, end_across = start_along - load(whirl, i), start_across + turning
        c, si = load(cosine, i), load(sine, i)
        start_along, start_across = c * end_along + si * end_across, c * end_across - si * end_along
    store(dy, 2 * n, extended(1.0))


@compiled
def _dense_derivative(s: DenseForm, y: FloatArray, dy: FloatArray) -> None:
    n = len(s.points)
    cosine, sine, force_x, force_y, torque = s.room[0], s.room[1], s.room[2], s.room[3], s.room[4]
    hanging, right, diagonal = s.room[5], s.room[6], s.room[7]
    ax, ay, x, v = _pivot(s.frames, s.gravity, load(y, 2 * n))
    for i in range(n):
        c, si = np.cos(load(y, i)), np.sin(load(y, i))
        store(cosine, i, c)
        store(sine, i, si)
        speed = load(y, n + i) * s.lengths[i]
        x, v = x + c * speed, v + si * speed
        drag_x, drag_y = laws.drag(s.drags, i, x, v)
        store(force_x, i, extended(drag_x))
        store(force_y, i, extended(drag_y))
    _write_torques(s.joints, y, torque)
    total_x, total_y, mass = extended(0.0), extended(0.0), extended(0.0)
    for i in range(n - 1, -1, -1):
        outer = s.rods[i + 1] if i < n - 1 else 0.0
        mass = mass + s.points[i] + extended(s.rods[i]) / 2.0 + extended(outer) / 2.0
        store(hanging, i, mass)
        total_x, total_y = total_x + load(force_x, i), total_y + load(force_y, i)
        lever_x, lever_y = total_x - mass * ax, total_y - mass * ay
        store(right, i, load(torque, i) + (load(cosine, i) * lever_x + load(sine, i) * lever_y) * s.lengths[i])
    for i in range(n):
        total = load(right, i)
        for j in range(n):
            shared = load(hanging, max(i, j)) * s.lengths[i] * s.lengths[j]
            c = load(cosine, i) * load(cosine, j) + load(sine, i) * load(sine, j)
            entry = shared * c
            if i == j:
                entry = shared - extended(s.rods[i]) * s.lengths[i] * s.lengths[i] / 6.0
            store(s.matrix[i], j, entry)
            si = load(sine, j) * load(cosine, i) - load(cosine, j) * load(sine, i)
            total = total + shared * si * load(y, n + j) * load(y, n + j)
        store(right, i, total)
    _solve(s.matrix, diagonal, right)
    for i in range(n):
        store(dy, i, load(y, n + i))
        store(dy, n + i, load(right, i))
    store(dy, 2 * n, extended(1.0))


@compiled
def _solve(matrix: FloatArray, diagonal: FloatArray, right: FloatArray) -> None:
    """Solve the symmetric system in place by L D L^T, the answer in `right`."""
    n = len(right)
    for i in range(n):
        for j in range(i + 1):
            entry = load(matrix[i], j)
            for k in range(j):
                entry = entry - load(matrix[i], k) * load(matrix[j], k) * load(diagonal, k)
            if i == j:
                store(diagonal, i, entry)
            else:
                store(matrix[i], j, entry / load(diagonal, j))
        value = load(right, i)
        for k in range(i):
            value = value - load(matrix[i], k) * load(right, k)
        store(right, i, value)
    for i in range(n):
        store(right, i, load(right, i) / load(diagonal, i))
    for i in range(n - 1, -1, -1):
        value = load(right, i)
        for k in range(i + 1, n):
            value = value - load(matrix[k], i) * load(right, k)
        store(right, i, value)


specialise(extended_derivative, RecursiveForm, _recursive_derivative)
specialise(extended_derivative, DenseForm, _dense_derivative)
