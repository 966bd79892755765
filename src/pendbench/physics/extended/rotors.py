"""The side of the reference that is `inertias`, with rotors in the joints: each link's inertia has an angle's row, too.

State (2 n + 1, 2): theta, omega, t. docs/equations.md, (E55) to (E57).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import part, specialise
from pendbench.physics.acting import rotor_inertias
from pendbench.physics.extended.inertias import InertiaForm, inertia_form, write_forces
from pendbench.scene.scene import Scene
from pendbench.solvers.extended.extrapolation import extended_derivative
from pendbench.solvers.extended.number import extended, load, store


class RotorForm(NamedTuple):
    """A chain, rotors (n,) kg m^2 in its joints, and room (n, 2)."""

    chain: InertiaForm
    rotors: FloatArray
    room: FloatArray


def rotor_form(scene: Scene) -> tuple[RotorForm, FloatArray]:
    """The system and its state (2 n + 1, 2) at the scene's start."""
    chain, state = inertia_form(scene)
    return RotorForm(chain, rotor_inertias(scene), np.empty((scene.n, 2))), state


@part
def _eliminate(system: RotorForm) -> None:
    """From the tip to the pivot: leave what each link's turning is made of in the room."""
    s, n = system.chain, len(system.rotors)
    cosine, sine, along, across, torque = s.room[0], s.room[1], s.room[2], s.room[3], s.room[4]
    own, turned, passed, whirl = s.room[5], s.room[6], s.room[7], s.room[8]
    zero = extended(0.0)
    uu, ut, tt, ua, ta, aa = zero, zero, zero, zero, zero, zero
    pull_along, pull_across, pull_angular = zero, zero, zero
    for i in range(n - 1, -1, -1):
        c, si, length = load(cosine, i), load(sine, i), s.lengths[i]
        a_uu = c * c * uu - c * si * ut * 2.0 + si * si * tt + s.points[i]
        a_tt = si * si * uu + c * si * ut * 2.0 + c * c * tt + s.points[i]
        a_ut = c * si * (uu - tt) + (c * c - si * si) * ut
        a_ua, a_ta, a_aa = (c * ua - si * ta) / length, (si * ua + c * ta) / length, aa / length / length
        b_u = load(along, i) + c * pull_along - si * pull_across
        b_t = load(across, i) + si * pull_along + c * pull_across
        effort = (load(torque, i) + pull_angular) / length
        lever = extended(system.rotors[i]) / length
        inverse = extended(1.0) / (load(s.about_joints, i) + a_tt + a_ta * 2.0 + a_aa + lever / length)
        leaning, lifting = a_ut + a_ua, load(s.outer, i) + a_tt + a_ta
        free = (effort + b_t + leaning * load(whirl, i)) * inverse
        store(own, i, free)
        store(turned, i, leaning * inverse)
        store(passed, i, lifting * inverse)
        store(system.room, i, lever * inverse)
        pull_along = b_u + (a_uu + load(s.outer, i)) * load(whirl, i) - leaning * free
        pull_across = b_t + a_ut * load(whirl, i) - lifting * free
        pull_angular = lever * free
        uu = load(s.weights, i) + a_uu - leaning * leaning * inverse
        ut = a_ut - leaning * lifting * inverse
        tt = load(s.weights, i) + a_tt - lifting * lifting * inverse
        ua, ta = leaning * lever * inverse, lifting * lever * inverse
        aa = extended(system.rotors[i]) - lever * lever * inverse


@part
def _rotor_derivative(system: RotorForm, y: FloatArray, dy: FloatArray) -> None:
    s, n = system.chain, len(system.rotors)
    cosine, sine, own, turned, passed, whirl = s.room[0], s.room[1], s.room[5], s.room[6], s.room[7], s.room[8]
    start_along, start_across = write_forces(s, y)
    _eliminate(system)
    angular = extended(0.0)
    for i in range(n):
        turning = load(own, i) - load(turned, i) * start_along - load(passed, i) * start_across
        turning = turning + load(system.room, i) * angular
        angular = turning / s.lengths[i]
        store(dy, i, load(y, n + i))
        store(dy, n + i, angular)
        end_along, end_across = start_along - load(whirl, i), start_across + turning
        c, si = load(cosine, i), load(sine, i)
        start_along, start_across = c * end_along + si * end_across, c * end_across - si * end_along
    store(dy, 2 * n, extended(1.0))


specialise(extended_derivative, RotorForm, _rotor_derivative)
