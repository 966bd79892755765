"""The other side of the reference with effects: from the pivot to the tip, each mass with how it gives way to a force.

State (4 n + 1, 2): theta, omega, sin theta, cos theta, t. Directions are followed as vectors and need no trigonometry;
angles are for the springs, which count turns. The unknowns are the forces in the rods and not the accelerations, they
are eliminated in the other direction than in `inertias`, and the air's forces are those in the frame of the ground. The
two share the effects' laws and nothing else. docs/equations.md, (E49) to (E53).
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import part, specialise
from pendbench.physics.extended.acting import Acting, acting_on, pivot, write_torques
from pendbench.physics.extended.moments import doubled, moments_of
from pendbench.physics.kernels import laws
from pendbench.scene.scene import Scene
from pendbench.solvers.extended.double_double import sine_cosine
from pendbench.solvers.extended.extrapolation import extended_derivative
from pendbench.solvers.extended.number import extended, load, store


class MobilityForm(NamedTuple):
    """lengths (n,) m, inverse_lengths (n, 2) 1/m, inverse_masses (n, 2) 1/kg, excess (n, 2) kg, what acts, room.

    inverse_masses: of the points with a share of each link at each of its ends; excess: how much too hard to turn the
    links are with these, over l^2: a sixth of a uniform rod. room (11, n, 2).
    """

    lengths: FloatArray
    inverse_lengths: FloatArray
    inverse_masses: FloatArray
    excess: FloatArray
    acting: Acting
    room: FloatArray


def mobility_form(scene: Scene) -> tuple[MobilityForm, FloatArray]:
    """The system and its state (4 n + 1, 2) at the scene's start, for scenes that it `suits`."""
    its = moments_of(scene)
    inverse_lengths = doubled([1 / Fraction(float(length)) for length in scene.lengths])
    inverse_masses = doubled([1 / mass for mass in its.lumped()])
    parts = np.array(scene.lengths), inverse_lengths, inverse_masses, doubled([-lean for lean in its.leans()])
    return MobilityForm(*parts, acting_on(scene), np.empty((11, scene.n, 2))), start_with_directions(scene)


def suits(scene: Scene) -> bool:
    """Whether all shares of the links are masses, as those of links with their centres between their ends are."""
    its = scene.links
    return its is None or bool(np.all((its.centre > 0.0) & (its.centre <= scene.lengths)))


def start_with_directions(scene: Scene) -> FloatArray:
    """The state (4 n + 1, 2) at the scene's start: theta, omega, sin theta, cos theta, t."""
    n = scene.n
    state = np.zeros((4 * n + 1, 2))
    state[: 2 * n, 0] = np.concatenate([scene.angles, scene.rates])
    for i, angle in enumerate(scene.angles):
        state[2 * n + i], state[3 * n + i] = sine_cosine((float(angle), 0.0))
    return state


@part
def _write_air(s: MobilityForm, y: FloatArray, u: Any, v: Any, along: FloatArray, across: FloatArray) -> None:
    """Write the air's force on each mass (n, 2) N along its rod and across it; (u, v) m/s: the pivot's velocity."""
    n = len(s.lengths)
    for i in range(n):
        si, c = load(y, 2 * n + i), load(y, 3 * n + i)
        speed = load(y, n + i) * s.lengths[i]
        u, v = u + c * speed, v + si * speed
        x, z = laws.drag(s.acting.drags, i, u, v)
        store(along, i, si * x - c * z)
        store(across, i, c * x + si * z)


@part
def _eliminate(s: MobilityForm, y: FloatArray, ax: Any, ay: Any) -> None:
    """From the pivot, accelerated by (ax, ay), to the tip: write into the room what each rod's tension is made of.

    (E49) to (E51): g is how a mass gives way to the force of the rod that it carries, h how it accelerates without one.
    """
    n = len(s.lengths)
    cosine, sine, along, across, couple = s.room[0], s.room[1], s.room[2], s.room[3], s.room[4]
    given, inverse, leaning, yielding, ease, turned = s.room[5], s.room[6], s.room[7], s.room[8], s.room[9], s.room[10]
    g_uu, g_ut, g_tt = extended(0.0), extended(0.0), extended(0.0)
    h_u, h_t = ax, ay
    before_s, before_c = extended(1.0), extended(0.0)
    for i in range(n):
        si, c, rate = load(y, 2 * n + i), load(y, 3 * n + i), load(y, n + i)
        turn_c, turn_s = c * before_c + si * before_s, si * before_c - c * before_s
        before_s, before_c = si, c
        both, square_c, square_s = turn_c * turn_s, turn_c * turn_c, turn_s * turn_s
        g_uu, g_ut, g_tt = (
            square_c * g_uu + both * g_ut * 2.0 + square_s * g_tt,
            both * (g_tt - g_uu) + (square_c - square_s) * g_ut,
            square_s * g_uu - both * g_ut * 2.0 + square_c * g_tt,
        )
        h_u, h_t = turn_c * h_u + turn_s * h_t, turn_c * h_t - turn_s * h_u
        w, excess = load(s.inverse_masses, i), load(s.excess, i)
        m_uu, m_tt = w + g_uu, w + g_tt
        k = extended(1.0) / (extended(1.0) - excess * m_tt)
        bound = k * excess
        below = extended(1.0) / (m_uu + bound * g_ut * g_ut)
        pair = load(couple, i) * load(s.inverse_lengths, i)
        pushed = k * pair - bound * h_t
        pulled = rate * rate * s.lengths[i] - h_u + g_ut * pushed
        store(cosine, i, turn_c)
        store(sine, i, turn_s)
        store(couple, i, pair)
        store(given, i, pulled)
        store(inverse, i, below)
        store(leaning, i, g_ut)
        store(yielding, i, m_tt)
        store(ease, i, k)
        store(turned, i, h_t)
        tension, share = pulled * below, w * below
        h_u, h_t = -(w * tension), w * (pushed - bound * g_ut * tension)
        g_uu, g_ut, g_tt = (
            share * (g_uu + bound * g_ut * g_ut),
            -(share * w * bound * g_ut),
            w + share * w * bound * m_uu,
        )
        f_u, f_t = load(along, i), load(across, i)
        h_u, h_t = h_u + g_uu * f_u + g_ut * f_t, h_t + g_ut * f_u + g_tt * f_t


@part
def _substitute(s: MobilityForm, y: FloatArray, dy: FloatArray) -> None:
    """From the tip to the pivot: each rod's force, and how the rod turns. (E52)."""
    n = len(s.lengths)
    cosine, sine, along, across, couple = s.room[0], s.room[1], s.room[2], s.room[3], s.room[4]
    given, inverse, leaning, yielding, ease, turned = s.room[5], s.room[6], s.room[7], s.room[8], s.room[9], s.room[10]
    pull_u, pull_t = extended(0.0), extended(0.0)
    for i in range(n - 1, -1, -1):
        w, excess, k, m_ut = load(s.inverse_masses, i), load(s.excess, i), load(ease, i), load(leaning, i)
        r_u, r_t = pull_u + load(along, i), pull_t + load(across, i)
        tension = (load(given, i) + w * (r_u + m_ut * k * excess * r_t)) * load(inverse, i)
        turning = k * (w * r_t - m_ut * tension + load(yielding, i) * load(couple, i) - load(turned, i))
        push = -(load(couple, i) + excess * turning)
        c, si = load(cosine, i), load(sine, i)
        pull_u, pull_t = c * tension - si * push, si * tension + c * push
        rate = load(y, n + i)
        store(dy, i, rate)
        store(dy, n + i, turning * load(s.inverse_lengths, i))
        store(dy, 2 * n + i, load(y, 3 * n + i) * rate)
        store(dy, 3 * n + i, -(load(y, 2 * n + i) * rate))


@part
def _mobility_derivative(s: MobilityForm, y: FloatArray, dy: FloatArray) -> None:
    n = len(s.lengths)
    t = load(y, 4 * n)
    ax, ay, u, v = pivot(s.acting.pivots, t)
    _write_air(s, y, u, v, s.room[2], s.room[3])
    write_torques(s.acting.joints, t, y, s.room[4])
    _eliminate(s, y, ax, ay)
    _substitute(s, y, dy)
    store(dy, 4 * n, extended(1.0))


specialise(extended_derivative, MobilityForm, _mobility_derivative)
