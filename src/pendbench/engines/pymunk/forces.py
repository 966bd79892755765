"""The effects that pymunk has no means for, as forces on its bodies before each step.

`default` applies what its users would: the forces at the state they see. `tuned` keeps the leapfrog's order: its step
moves the positions first, so the forces are those at the positions to come, half a step ahead of the velocities, which
are carried there from the last two.
"""

from __future__ import annotations

import numpy as np
import pymunk

from pendbench.base.arrays import FloatArray
from pendbench.physics import acting
from pendbench.physics.geometry import rod_vectors, wrapped
from pendbench.scene.scene import Scene


class Forces:
    """What acts on one chain besides constant gravity. The bodies must hang in the space before the first `apply`."""

    def __init__(self, scene: Scene, space: pymunk.Space, dt: float, tuned: bool) -> None:
        self._scene, self._space, self._dt, self._tuned = scene, space, dt, tuned
        self._theta = scene.angles
        self._shaken = acting.is_shaken(scene)
        self._pushed = acting.is_pushed(scene)
        self._last: FloatArray | None = None

    def apply(self, t: float) -> None:
        """Set the forces of the step that begins at t s."""
        at = t + 0.5 * self._dt if self._tuned else t
        if self._shaken:
            x, y = acting.pivot_acceleration(self._scene, at)
            self._space.gravity = (-float(x), -float(y))
        if self._pushed:
            bodies = self._space.bodies
            places = np.array([body.position for body in bodies])
            speeds = np.array([body.velocity for body in bodies])
            if self._tuned:
                places = places + self._dt * speeds
                speeds, self._last = speeds + 0.5 * (speeds - (speeds if self._last is None else self._last)), speeds
            for body, force in zip(bodies, self._on_masses(at, places, speeds).tolist(), strict=True):
                body.force = tuple(force)

    def _on_masses(self, t: float, places: FloatArray, speeds: FloatArray) -> FloatArray:
        """The forces (n, 2) N at places (n, 2) m and speeds (n, 2) m/s."""
        with np.errstate(all="ignore"):
            (x, y), (u, v) = rod_vectors(places).T, rod_vectors(speeds).T
            self._theta = self._theta + wrapped(np.arctan2(x, -y) - self._theta)
            omega = (x * v - y * u) / (x * x + y * y)
            return acting.mass_forces(self._scene, t, self._theta, omega)
