"""One side of the reference with effects: from the tip to the pivot, each link with the inertia that hangs on it.

State (2 n + 1, 2): theta, omega, t; the time is one of the variables, since the method of the reference knows none.
docs/equations.md, (E38) to (E45), (E53), (E54).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import part, specialise
from pendbench.physics.extended.acting import Acting, acting_on, pivot, write_torques
from pendbench.physics.extended.moments import doubled, moments_of
from pendbench.physics.kernels import laws
from pendbench.scene.scene import Scene
from pendbench.solvers.extended.extrapolation import extended_derivative
from pendbench.solvers.extended.number import extended, load, sine_and_cosine, store


class InertiaForm(NamedTuple):
    """points (n,) kg, lengths (n,) m, what acts, room (9, n, 2); of the links beside the points, (n, 2) kg each:

    weights, outer: their shares at their ends, about_joints and about_ends: their inertias over l^2, leans: what those
    of the shares lack; spreads (n, 2) kg^2: weight times inertia about the centre over l^2.
    """

    points: FloatArray
    weights: FloatArray
    outer: FloatArray
    about_joints: FloatArray
    about_ends: FloatArray
    leans: FloatArray
    spreads: FloatArray
    lengths: FloatArray
    acting: Acting
    room: FloatArray


def inertia_form(scene: Scene) -> tuple[InertiaForm, FloatArray]:
    """The system and its state (2 n + 1, 2) at the scene's start."""
    state = np.zeros((2 * scene.n + 1, 2))
    state[:-1, 0] = np.concatenate([scene.angles, scene.rates])
    its = moments_of(scene)
    spreads = [weight * inertia for weight, inertia in zip(its.weights, its.about_centres, strict=True)]
    form = InertiaForm(
        points=np.array(scene.masses),
        weights=doubled(its.weights),
        outer=doubled(its.outer()),
        about_joints=doubled(its.about_joints()),
        about_ends=doubled(its.about_ends()),
        leans=doubled(its.leans()),
        spreads=doubled(spreads),
        lengths=np.array(scene.lengths),
        acting=acting_on(scene),
        room=np.empty((9, scene.n, 2)),
    )
    return form, state


@part
def write_forces(s: InertiaForm, y: FloatArray) -> tuple[Any, Any]:
    """Write into the room how the links bend and whirl, and what pushes them; return how the pivot accelerates.

    Along the first link and across it, as all is said in the links' own frames.
    """
    n = len(s.points)
    cosine, sine, along, across, torque, whirl = s.room[0], s.room[1], s.room[2], s.room[3], s.room[4], s.room[8]
    ax, ay, u, v = pivot(s.acting.pivots, load(y, 2 * n))
    si, c = sine_and_cosine(load(y, 0))
    start_along, start_across = si * ax - c * ay, c * ax + si * ay
    fast_along, fast_across = si * u - c * v, c * u + si * v
    write_torques(s.acting.joints, load(y, 2 * n), y, torque)
    for i in range(n):
        rate = load(y, n + i)
        store(whirl, i, rate * rate * s.lengths[i])
        fast_across = fast_across + rate * s.lengths[i]
        pulled, pushed = laws.drag(s.acting.drags, i, fast_along, fast_across)
        store(along, i, extended(pulled))
        store(across, i, extended(pushed))
        c, si = extended(1.0), extended(0.0)
        if i < n - 1:
            si, c = sine_and_cosine(load(y, i + 1) - load(y, i))
        store(cosine, i, c)
        store(sine, i, si)
        fast_along, fast_across = c * fast_along + si * fast_across, c * fast_across - si * fast_along
    return start_along, start_across


@part
def _eliminate(s: InertiaForm) -> None:
    """From the tip to the pivot: leave what each link's turning is made of in the room."""
    n = len(s.points)
    cosine, sine, along, across, torque = s.room[0], s.room[1], s.room[2], s.room[3], s.room[4]
    own, turned, passed, whirl = s.room[5], s.room[6], s.room[7], s.room[8]
    zero = extended(0.0)
    uu, ut, tt, pull_along, pull_across = zero, zero, zero, zero, zero
    for i in range(n - 1, -1, -1):
        c, si, lean = load(cosine, i), load(sine, i), load(s.leans, i)
        # What hangs on the end of rod i, in its own frame; a torque acts on the rod itself.
        a_uu = c * c * uu - c * si * ut * 2.0 + si * si * tt + s.points[i]
        a_tt = si * si * uu + c * si * ut * 2.0 + c * c * tt + s.points[i]
        a_ut = c * si * (uu - tt) + (c * c - si * si) * ut
        b_u = load(along, i) + c * pull_along - si * pull_across
        b_t = load(across, i) + si * pull_along + c * pull_across
        effort = load(torque, i) / s.lengths[i]
        inverse = extended(1.0) / (load(s.about_joints, i) + a_tt)
        leaning = a_ut * inverse
        free = (effort + b_t) * inverse + leaning * load(whirl, i)
        store(own, i, free)
        store(turned, i, leaning)
        store(passed, i, (load(s.outer, i) + a_tt) * inverse)
        pull_along = b_u + (a_uu + load(s.outer, i)) * load(whirl, i) - a_ut * free
        pull_across = lean * free - effort
        uu = load(s.weights, i) + a_uu - a_ut * leaning
        ut = lean * leaning
        tt = (load(s.spreads, i) + load(s.about_ends, i) * a_tt) * inverse


@part
def _inertia_derivative(s: InertiaForm, y: FloatArray, dy: FloatArray) -> None:
    n = len(s.points)
    cosine, sine, own, turned, passed, whirl = s.room[0], s.room[1], s.room[5], s.room[6], s.room[7], s.room[8]
    start_along, start_across = write_forces(s, y)
    _eliminate(s)
    for i in range(n):
        turning = load(own, i) - load(turned, i) * start_along - load(passed, i) * start_across
        store(dy, i, load(y, n + i))
        store(dy, n + i, turning / s.lengths[i])
        end_along, end_across = start_along - load(whirl, i), start_across + turning
        c, si = load(cosine, i), load(sine, i)
        start_along, start_across = c * end_along + si * end_across, c * end_across - si * end_along
    store(dy, 2 * n, extended(1.0))


specialise(extended_derivative, InertiaForm, _inertia_derivative)
