"""What links weigh and how they turn, exactly, as both sides of the reference need it. docs/equations.md, (E53)."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.physics import acting
from pendbench.scene.scene import Scene
from pendbench.solvers.extended.double_double import split


class Moments(NamedTuple):
    """Of each link beside the point at its end, exactly: weight kg, its centre over the length, inertia over l^2 kg."""

    points: list[Fraction]
    weights: list[Fraction]
    near: list[Fraction]
    about_centres: list[Fraction]

    def about_joints(self) -> list[Fraction]:
        """Inertias about the joints over l^2, kg."""
        own = zip(self.about_centres, self.weights, self.near, strict=True)
        return [inertia + weight * near**2 for inertia, weight, near in own]

    def about_ends(self) -> list[Fraction]:
        """Inertias about the links' ends over l^2, kg."""
        own = zip(self.about_centres, self.weights, self.near, strict=True)
        return [inertia + weight * (1 - near) ** 2 for inertia, weight, near in own]

    def leans(self) -> list[Fraction]:
        """What links with their masses at their ends lack, over l^2, kg."""
        own = zip(self.about_centres, self.weights, self.near, strict=True)
        return [inertia - weight * near * (1 - near) for inertia, weight, near in own]

    def outer(self) -> list[Fraction]:
        """The shares of the links at their ends, kg."""
        return [weight * near for weight, near in zip(self.weights, self.near, strict=True)]

    def lumped(self) -> list[Fraction]:
        """The points with the shares of the links that meet there, kg."""
        inner = [weight * (1 - near) for weight, near in zip(self.weights, self.near, strict=True)]
        parts = zip(self.points, self.outer(), [*inner[1:], Fraction(0)], strict=True)
        return [point + outer + following for point, outer, following in parts]


def moments_of(scene: Scene) -> Moments:
    """The scene's, as if its numbers were exact."""
    points, lengths = _exact(scene.masses), _exact(scene.lengths)
    if scene.links is None:
        weights = _exact(acting.links(scene).mass)
        return Moments(points, weights, [Fraction(1, 2)] * scene.n, [weight / 12 for weight in weights])
    weights, centres, inertias = (_exact(its) for its in (scene.links.mass, scene.links.centre, scene.links.inertia))
    near = [centre / length for centre, length in zip(centres, lengths, strict=True)]
    return Moments(points, weights, near, [j / length**2 for j, length in zip(inertias, lengths, strict=True)])


def _exact(values: FloatArray) -> list[Fraction]:
    return [Fraction(float(value)) for value in values]


def doubled(values: Sequence[Fraction]) -> FloatArray:
    """Exact numbers (n,) as high and low parts (n, 2)."""
    return np.array([split(value) for value in values])
