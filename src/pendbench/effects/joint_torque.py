"""Constant torques in the joints, whatever the chain does: each has a potential, as a weight on a drum has."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from pendbench.base.arrays import FloatArray
from pendbench.base.ranges import EachOf, Range
from pendbench.effects.term import each

JOINT_TORQUE: Final = EachOf(Range(-1e50, 1e50, "N m"), "joint")


class JointTorque(NamedTuple):
    """torque: (n,) N m, counter-clockwise on each joint's rod, and the opposite on the rod before it."""

    torque: FloatArray

    @classmethod
    def of(cls, value: float | tuple[float, ...], n: int) -> JointTorque:
        """The term for a chain of n links."""
        return cls(each(value, n, "joint_torque", "joints"))

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return [1.5, -0.8]

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return not self.torque.any()

    @staticmethod
    def joint_torque(term: JointTorque, drive: Any, i: Any, bend: Any, rate: Any) -> Any:  # noqa: ARG004
        """The same at all times."""
        return term.torque[i]

    @staticmethod
    def joint_potential(term: JointTorque, i: Any, bend: Any) -> Any:
        """Of the bend, which counts turns: each turn gives as much again."""
        return -(term.torque[i] * bend)
