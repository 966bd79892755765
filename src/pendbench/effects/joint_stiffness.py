"""Springs in the joints, at rest where the chain hangs straight, or where joint_rest says."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from pendbench.base.arrays import FloatArray
from pendbench.base.ranges import EachOf, Range
from pendbench.effects.term import each

Each = float | tuple[float, ...]

JOINT_STIFFNESS: Final = EachOf(Range(0.0, 1e50, "N m/rad"), "joint")


class JointStiffness(NamedTuple):
    """stiffness: (n,) N m/rad, of the pivot towards hanging, of the others towards the straight chain.

    A spring counts turns: after one it does not rest where it did before. rest: (n,) rad, the bend at which it
    is at rest: 0, or what joint_rest says.
    """

    stiffness: FloatArray
    rest: FloatArray

    @classmethod
    def of(cls, value: Each, n: int, joint_rest: Each = 0.0) -> JointStiffness:
        """The term for a chain of n links."""
        return cls(each(value, n, "joint_stiffness", "joints"), each(joint_rest, n, "joint_rest", "joints"))

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return [2.5, 1.5]

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return not self.stiffness.any()

    @staticmethod
    def joint_torque(term: JointStiffness, drive: Any, i: Any, bend: Any, rate: Any) -> Any:  # noqa: ARG004
        """Against the bend from where it is at rest."""
        return -(term.stiffness[i] * (bend - term.rest[i]))

    @staticmethod
    def joint_potential(term: JointStiffness, i: Any, bend: Any) -> Any:
        """Of the bent springs."""
        return 0.5 * term.stiffness[i] * (bend - term.rest[i]) * (bend - term.rest[i])
