"""What engines whose bodies are points make of a chain: written once for their adapters."""

from __future__ import annotations

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.protocol import State
from pendbench.physics import acting
from pendbench.physics.geometry import TURN, positions, rod_vectors, velocities
from pendbench.scene.scene import Scene


def start_of(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Places (n, 2) m and speeds (n, 2) m/s of the masses at the start."""
    return positions(scene.lengths, scene.angles), velocities(scene.lengths, scene.angles, scene.rates)


def state_of(lengths: FloatArray, places: FloatArray, speeds: FloatArray) -> State:
    """What places (n, 2) m and speeds (n, 2) m/s say of the rods; angles in (-pi, pi]."""
    with np.errstate(all="ignore"):
        (x, y), (u, v) = rod_vectors(places).T, rod_vectors(speeds).T
        found = np.hypot(x, y)
        gap = float(np.abs(found / lengths - 1.0).max())
        return State(np.arctan2(x, -y), (x / found * v - y / found * u) / found, gap)


def pushes(scene: Scene, t: float, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """The forces on the masses, (n, 2) N, of all that acts but the rods and constant gravity."""
    with np.errstate(all="ignore"):
        return acting.mass_forces(scene, t, theta, omega)


class Turns:
    """Angles that count turns, from such that do not: followed from state to state.

    An angle is expected where the mean of the rates then and now takes it. That is right while this is so to better
    than half a turn, so for samples much closer than a turn's acceleration takes; of others the angle is known up to
    whole turns, which no position and no energy depends on.
    """

    def __init__(self, scene: Scene) -> None:
        self._last, self._at = State(scene.angles, scene.rates), 0.0

    def follow(self, found: State, time: float) -> State:
        """The state at a time (s), with its turns."""
        with np.errstate(all="ignore"):
            expected = self._last.theta + 0.5 * (time - self._at) * (self._last.omega + found.omega)
            theta = found.theta + TURN * np.rint((expected - found.theta) / TURN)
        self._last, self._at = State(theta, found.omega, found.gap), time
        return State(theta.copy(), found.omega.copy(), found.gap)
