"""Uniform rods with a mass of their own. Gravity pulls at them; the air does not hold them."""

from __future__ import annotations

from typing import Final, NamedTuple

from pendbench.base.arrays import FloatArray
from pendbench.base.ranges import EachOf, Range
from pendbench.effects.term import each

ROD_MASS: Final = EachOf(Range(0.0, 1e50, "kg"), "rod")


class RodMass(NamedTuple):
    """rods: (n,) kg."""

    rods: FloatArray

    @classmethod
    def of(cls, value: float | tuple[float, ...], n: int) -> RodMass:
        """The term for a chain of n links."""
        return cls(each(value, n, "rod_mass", "rods"))

    @staticmethod
    def example() -> list[float]:
        """Shows in half a second."""
        return [0.6, 0.3]

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return not self.rods.any()

    @staticmethod
    def rod_masses(term: RodMass) -> FloatArray:
        """Of each rod."""
        return term.rods
