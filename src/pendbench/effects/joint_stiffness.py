"""Springs in the joints, at rest where the chain hangs straight."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from pendbench.arrays import FloatArray
from pendbench.effects.term import each
from pendbench.ranges import EachOf, Range

JOINT_STIFFNESS: Final = EachOf(Range(0.0, 1e50, "N m/rad"), "joint")


class JointStiffness(NamedTuple):
    """stiffness: (n,) N m/rad, of the pivot towards hanging, of the others towards the straight chain.

    A spring counts turns: after one it does not rest where it did before.
    """

    stiffness: FloatArray

    @classmethod
    def of(cls, value: float | tuple[float, ...], n: int) -> JointStiffness:
        """The term for a chain of n links."""
        return cls(each(value, n, "joint_stiffness", "joints"))

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return [2.5, 1.5]

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return not self.stiffness.any()

    @staticmethod
    def joint_torque(term: JointStiffness, drive: Any, i: Any, bend: Any, rate: Any) -> Any:  # noqa: ARG004
        """Against the bend."""
        return -(term.stiffness[i] * bend)

    @staticmethod
    def joint_potential(term: JointStiffness, i: Any, bend: Any) -> Any:
        """Of the bent springs."""
        return 0.5 * term.stiffness[i] * bend * bend
