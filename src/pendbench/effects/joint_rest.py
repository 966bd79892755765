"""Where the joints' springs are at rest, if that is not the straight chain. The law is that of joint_stiffness."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from pendbench.base.arrays import FloatArray
from pendbench.base.ranges import EachOf, Range
from pendbench.effects.term import each

JOINT_REST: Final = EachOf(Range(-1e9, 1e9, "rad"), "joint")


class JointRest(NamedTuple):
    """rest: (n,) rad, the bend at which each spring is at rest."""

    rest: FloatArray

    @classmethod
    def of(cls, value: float | tuple[float, ...], n: int) -> JointRest:
        """The term for a chain of n links."""
        return cls(each(value, n, "joint_rest", "joints"))

    @staticmethod
    def modifies() -> str:
        """The effect that it does nothing without."""
        return "joint_stiffness"

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return [0.5, -0.4]

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return not self.rest.any()
