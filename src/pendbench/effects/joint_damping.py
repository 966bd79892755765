"""Damping in the joints: a torque against each joint's rate."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from pendbench.base.arrays import FloatArray
from pendbench.base.ranges import EachOf, Range
from pendbench.effects.term import each

JOINT_DAMPING: Final = EachOf(Range(0.0, 1e50, "N m s/rad"), "joint")


class JointDamping(NamedTuple):
    """damping: (n,) N m s/rad, joint 1 being the pivot."""

    damping: FloatArray

    @classmethod
    def of(cls, value: float | tuple[float, ...], n: int) -> JointDamping:
        """The term for a chain of n links."""
        return cls(each(value, n, "joint_damping", "joints"))

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return [0.3, 0.15]

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return not self.damping.any()

    @staticmethod
    def joint_torque(term: JointDamping, drive: Any, i: Any, bend: Any, rate: Any) -> Any:  # noqa: ARG004
        """Against the rate."""
        return -(term.damping[i] * rate)
