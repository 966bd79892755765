"""The loop: let every mass fly, put the rods right one after the other, and take the velocity from where they went.

Sources: Mueller et al., J. Vis. Commun. Image R. 18 (2007); Macklin et al., Small Steps in Physics Simulation (SCA
2019); the second order by BDF2: English and Bridson, SIGGRAPH 2008.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined


class Points(NamedTuple):
    """Masses in the plane.

    inverse (n,) 1/kg, lengths (n,) m; places, speeds (n, 2) m, m/s; places_before, speeds_before: those a step ago;
    turns (n,): how often each rod went over the top, counter-clockwise positive.
    """

    inverse: FloatArray
    lengths: FloatArray
    places: FloatArray
    speeds: FloatArray
    places_before: FloatArray
    speeds_before: FloatArray
    turns: FloatArray


def points_of(masses: FloatArray, lengths: FloatArray, places: FloatArray, speeds: FloatArray) -> Points:
    """A chain at its start, copied. Masses count against the least of them."""
    before = np.empty_like(places), np.empty_like(places)
    return Points(masses.min() / masses, lengths.copy(), places.copy(), speeds.copy(), *before, np.zeros(len(masses)))


class Scheme(NamedTuple):
    """second: BDF2 in place of BDF1. The rods are gone through `most` times, or until none is off by `close`."""

    second: bool
    most: int
    close: float


@compiled
def advance(p: Points, pushes: FloatArray, scheme: Scheme, dt: float, first: int, steps: int) -> float:
    """Steps of dt s, from number `first` on, under the accelerations `pushes` (n, 2) m/s^2.

    Returns the worst relative error of a rod that the last pass of a step found.
    """
    worst = 0.0
    for k in range(first, first + steps):
        bdf2 = scheme.second and k > 0
        _fly(p, pushes, dt, bdf2)
        found = math.inf
        for _ in range(scheme.most):
            found = _put_right(p)
            if found <= scheme.close:
                break
        worst = max(worst, found)
        newest = 1.5 / dt if bdf2 else 1.0 / dt
        for i in range(len(p.inverse)):
            p.speeds[i, 0] += newest * p.places[i, 0]
            p.speeds[i, 1] += newest * p.places[i, 1]
        _count_turns(p)
    return worst


@inlined
def _fly(p: Points, pushes: FloatArray, dt: float, bdf2: bool) -> None:
    """Where the masses get without rods, and of their speeds what does not hang on where they will be."""
    for i in range(len(p.inverse)):
        for k in range(2):
            x, v = p.places[i, k], p.speeds[i, k]
            x_before, v_before = p.places_before[i, k], p.speeds_before[i, k]
            p.places_before[i, k], p.speeds_before[i, k] = x, v
            if bdf2:
                flown = (4.0 * x - x_before) / 3.0 + dt * (8.0 * v - 2.0 * v_before) / 9.0
                p.places[i, k] = flown + 4.0 / 9.0 * dt * dt * pushes[i, k]
                p.speeds[i, k] = (x_before - 4.0 * x) / (2.0 * dt)
            else:
                p.places[i, k] = x + dt * (v + dt * pushes[i, k])
                p.speeds[i, k] = -x / dt


@inlined
def _put_right(p: Points) -> float:
    """Each rod's ends moved along it until its length is right, from the pivot outwards; by how much one was off."""
    worst = 0.0
    x, y, w = 0.0, 0.0, 0.0
    for i in range(len(p.inverse)):
        along, up = p.places[i, 0] - x, p.places[i, 1] - y
        length = math.hypot(along, up)
        off = (length - p.lengths[i]) / length
        worst = max(worst, abs(off))
        share = off / (w + p.inverse[i])
        if i > 0:
            p.places[i - 1, 0] += w * share * along
            p.places[i - 1, 1] += w * share * up
        w = p.inverse[i]
        p.places[i, 0] -= w * share * along
        p.places[i, 1] -= w * share * up
        x, y = p.places[i, 0], p.places[i, 1]
    return worst


@inlined
def _count_turns(p: Points) -> None:
    """A rod that is above its joint has gone over the top where it changed sides."""
    x, y, x_before = 0.0, 0.0, 0.0
    for i in range(len(p.inverse)):
        now, before = p.places[i, 0] - x, p.places_before[i, 0] - x_before
        if p.places[i, 1] > y and (now > 0.0) != (before > 0.0):
            p.turns[i] += -1.0 if now > 0.0 else 1.0
        x, y, x_before = p.places[i, 0], p.places[i, 1], p.places_before[i, 0]
