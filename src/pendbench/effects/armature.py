"""Rotors in the joints: an inertia that turns with each joint's own angle, as that of a motor behind a gear."""

from __future__ import annotations

from typing import Final, NamedTuple

from pendbench.base.arrays import FloatArray
from pendbench.base.ranges import EachOf, Range
from pendbench.effects.term import each

ARMATURE: Final = EachOf(Range(0.0, 1e50, "kg m^2"), "joint")


class Armature(NamedTuple):
    """rotors: (n,) kg m^2, joint 1 being the pivot."""

    rotors: FloatArray

    @classmethod
    def of(cls, value: float | tuple[float, ...], n: int) -> Armature:
        """The term for a chain of n links."""
        return cls(each(value, n, "armature", "joints"))

    @staticmethod
    def example() -> list[float]:
        """Shows in half a second."""
        return [0.2, 0.1]

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return not self.rotors.any()

    @staticmethod
    def rotor_inertias(term: Armature) -> FloatArray:
        """Of each joint."""
        return term.rotors
