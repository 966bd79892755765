"""A model's joint coordinates as absolute angles, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pendbench.base.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class JointMap:
    """signs: (n,) 1, or -1 where a joint turns against the first one; zeros: (n,) rad, the coordinates of the model's
    reference pose; references: (n,) rad, the links' absolute angles there.

    Coordinates are in the model's own order, which is from the pivot outwards.
    """

    signs: FloatArray
    zeros: FloatArray
    references: FloatArray

    def angles(self, coordinates: FloatArray) -> FloatArray:
        """The links' absolute angles (..., n) rad from MuJoCo's qpos (..., n)."""
        return np.asarray(self.references + np.cumsum(self.signs * (coordinates - self.zeros), axis=-1))

    def rates(self, velocities: FloatArray) -> FloatArray:
        """The links' rates (..., n) rad/s from MuJoCo's qvel (..., n), and their accelerations from its qacc."""
        return np.asarray(np.cumsum(self.signs * velocities, axis=-1))

    def coordinates(self, angles: FloatArray) -> FloatArray:
        """MuJoCo's qpos (..., n) rad from absolute angles (..., n)."""
        return np.asarray(self.zeros + self.signs * np.diff(angles - self.references, prepend=0.0, axis=-1))

    def velocities(self, rates: FloatArray) -> FloatArray:
        """MuJoCo's qvel (..., n) rad/s from the links' rates (..., n), and its qacc from their accelerations."""
        return np.asarray(self.signs * np.diff(rates, prepend=0.0, axis=-1))
