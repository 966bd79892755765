"""What engines in joint coordinates, and with bodies that turn, make of a chain: written once for their adapters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.physics import acting
from pendbench.scene.scene import Scene


def joint_values(absolute: FloatArray) -> FloatArray:
    """Angles or rates (n,) between each rod and the one before it, from those of the rods against the vertical (n,)."""
    return np.diff(absolute, prepend=0.0)


def absolute_values(joints: FloatArray) -> FloatArray:
    """Angles or rates (n,) of the rods against the vertical, from those between each and the one before it (n,)."""
    return np.asarray(np.cumsum(joints))


def joint_forces(on_rods: FloatArray) -> FloatArray:
    """The torques (n,) N m in the joints that do what those on the rods' angles do: a rod pushes all joints before it.

    equations.md (E40).
    """
    return np.asarray(np.cumsum(on_rods[::-1])[::-1])


class Bodies(NamedTuple):
    """Each link as one body: masses (n,) kg, centres (n,) m from its joint, inertias (n,) kg m^2 about the centre."""

    masses: FloatArray
    centres: FloatArray
    inertias: FloatArray


def bodies(scene: Scene) -> Bodies:
    """The chain's links: rigid ones as they are; or rods, uniform where they have a mass, with points at their ends."""
    its, points = acting.links(scene), scene.masses
    if scene.links is not None:
        return Bodies(its.mass, its.centre, its.inertia)
    masses = points + its.mass
    centres = scene.lengths * ((points + 0.5 * its.mass) / masses)
    # Of the point and the rod against each other, beside that of the rod itself.
    apart = points * (its.mass / masses) * (0.5 * scene.lengths) ** 2
    return Bodies(masses, centres, its.inertia + apart)
