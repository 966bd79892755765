"""A motor in one joint: torque amplitude sin(w t) on its rod, and the opposite on the rod before it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Final, NamedTuple

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.effects.table import Parameters, TableOf, WholeNumber
from pendbench.errors import InputError
from pendbench.ranges import Range
from pendbench.strict import show


@dataclass(frozen=True)
class DriveTorqueValue(Parameters):
    """joint, from 1 (the pivot) to n; amplitude N m; angular_frequency rad/s."""

    joint: Annotated[int, WholeNumber(1)]
    amplitude: Annotated[float, Range(-1e50, 1e50, "N m")]
    angular_frequency: Annotated[float, Range(1e-50, 1e50, "rad/s")]


DRIVE_TORQUE: Final = TableOf(DriveTorqueValue)


class DriveTorque(NamedTuple):
    """amplitudes: (n,) N m, 0 in all joints but one; frequency: rad/s."""

    amplitudes: FloatArray
    frequency: float

    @classmethod
    def of(cls, value: DriveTorqueValue, n: int) -> DriveTorque:
        """The term for a chain of n links."""
        if value.joint > n:
            raise InputError(f"drive_torque: joint is {show(value.joint)}; allowed: 1 to {n}, the joints of the chain")
        amplitudes = np.zeros(n)
        amplitudes[value.joint - 1] = value.amplitude
        return cls(amplitudes, value.angular_frequency)

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return {"joint": 2, "amplitude": 0.5, "angular_frequency": 3.0}

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return not self.amplitudes.any()

    @staticmethod
    def drive(term: DriveTorque, t: Any) -> Any:
        """The phase, from -1 to 1."""
        return np.sin(term.frequency * t)

    @staticmethod
    def joint_torque(term: DriveTorque, drive: Any, i: Any, bend: Any, rate: Any) -> Any:  # noqa: ARG004
        """Whatever the chain does."""
        return term.amplitudes[i] * drive
