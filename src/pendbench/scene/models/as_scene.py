"""A planar chain as a scene: of point masses and uniform rods where it is one, of rigid links otherwise."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.effects import Effects
from pendbench.scene.models.chain import PlanarChain
from pendbench.scene.scene import Links, Scene

#: Inertias that differ by less, over the link's, are the same but for rounding.
EXACT: Final = 1e-12


class Naming(NamedTuple):
    """What a scene has beyond its chain."""

    name: str
    title: str
    duration: float
    notes: tuple[str, ...]


def as_scene(chain: PlanarChain, angles: FloatArray, rates: FloatArray, naming: Naming) -> Scene:
    """The scene of a chain from a start: angles and rates (n,), absolute.

    Raises `InputError` where its numbers are none that a scene may have.
    """
    plain, effects = points_and_rods(chain), _effects(chain)
    if plain is not None and plain.rods.any():
        effects["rod_mass"] = _each(plain.rods)
    return Scene(
        name=naming.name,
        title=naming.title,
        duration=naming.duration,
        masses=np.zeros(chain.n) if plain is None else plain.points,
        lengths=chain.lengths,
        angles=angles,
        rates=rates,
        effects=Effects(**effects),
        links=Links(chain.masses, chain.centres, chain.inertias) if plain is None else None,
        notes=naming.notes,
    )


class PointsAndRods(NamedTuple):
    """points (n,) kg at the links' ends, rods (n,) kg."""

    points: FloatArray
    rods: FloatArray


def points_and_rods(chain: PlanarChain) -> PointsAndRods | None:
    """The chain as points on uniform rods, where this has each link's mass, centre and inertia; else None.

    A point m and a rod r make a link of mass m + r, whose centre is at l (m + r/2) / (m + r), and whose inertia about
    its joint is l^2 (m + r/3).
    """
    lengths, masses = chain.lengths, chain.masses
    points = masses * (2.0 * chain.centres / lengths - 1.0)
    points = np.where(abs(points) <= EXACT * masses, 0.0, points)
    points = np.where(abs(points - masses) <= EXACT * masses, masses, points)
    rods = masses - points
    about_joint = chain.inertias + masses * chain.centres**2
    differ = abs(about_joint - lengths**2 * (points + rods / 3.0)) > EXACT * about_joint
    return None if np.any(differ | (points < 0.0) | (rods < 0.0)) else PointsAndRods(points, rods)


def _effects(chain: PlanarChain) -> dict[str, Any]:
    """What acts, by the names that scenes have for it."""
    found: dict[str, Any] = {"gravity": chain.gravity} if chain.gravity else {}
    for name, values in (
        ("joint_damping", chain.damping),
        ("joint_stiffness", chain.stiffness),
        ("joint_rest", np.where(chain.stiffness > 0.0, chain.rests, 0.0)),
        ("armature", chain.armature),
    ):
        if values.any():
            found[name] = _each(values)
    return found


def _each(values: FloatArray) -> float | tuple[float, ...]:
    """One number where all are the same."""
    first = float(values[0])
    return first if np.all(values == first) else tuple(values.tolist())
