"""A planar chain of rigid links, as it is read from a compiled model."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from pendbench.base.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class PlanarChain:
    """n rigid links in a plane, each hinged to the one before it, the first to a fixed point; arrays are (n,).

    lengths: m from a link's joint to the next one, of the last link to its tip; masses: kg; centres: m from the link's
    joint to its centre of mass, along the link; inertias: kg m^2 about that centre; damping: N m s/rad and stiffness:
    N m/rad of the joints; rests: rad, the joint angles that the springs pull to; armature: kg m^2 on the joints' own
    angles; gravity: m/s^2 in the plane. Joint angles are those between a link and the one before it, of the first link
    and the vertical.
    """

    lengths: FloatArray
    masses: FloatArray
    centres: FloatArray
    inertias: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    rests: FloatArray
    armature: FloatArray
    gravity: float

    @property
    def n(self) -> int:
        """How many links the chain has."""
        return len(self.lengths)

    def in_unit(self, unit: float) -> PlanarChain:
        """The chain whose masses, inertias and torques are given in 1/unit: the same motion."""
        scaled = ("masses", "inertias", "damping", "stiffness", "armature")
        return dataclasses.replace(self, **{name: getattr(self, name) / unit for name in scaled})

    def accelerations(self, angles: FloatArray, rates: FloatArray) -> FloatArray:
        """The links' accelerations (n,) rad/s^2 from absolute angles (n,) rad and rates (n,) rad/s.

        Lagrange's equations of the links as they stand, solved as a dense system: what reading is checked with.
        """
        return np.asarray(np.linalg.solve(*self.system(angles, rates)))

    def system(self, angles: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The matrix (n, n) kg m^2 and the right side (n,) N m of these equations."""
        arms = np.tril(np.broadcast_to(self.lengths, (self.n, self.n)), -1) + np.diag(self.centres)
        pairs = arms.T @ (self.masses[:, np.newaxis] * arms)
        apart = np.subtract.outer(angles, angles)
        between = np.eye(self.n) - np.eye(self.n, k=-1)
        inertia = pairs * np.cos(apart) + np.diag(self.inertias)
        inertia += between.T @ (self.armature[:, np.newaxis] * between)
        torques = between.T @ self._joint_torques(between @ angles, between @ rates)
        torques -= (pairs * np.sin(apart)) @ rates**2 + self.gravity * (self.masses @ arms) * np.sin(angles)
        return np.asarray(inertia), np.asarray(torques)

    def _joint_torques(self, joints: FloatArray, rates: FloatArray) -> FloatArray:
        return np.asarray(-self.stiffness * (joints - self.rests) - self.damping * rates)
