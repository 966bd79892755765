"""A motor in one joint: torque amplitude sin(w t + phase) on its rod, and the opposite on the rod before it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.base.ranges import Range
from pendbench.base.strict import show
from pendbench.effects.table import PHASE, Parameters, TableOf, WholeNumber


@dataclass(frozen=True)
class DriveTorqueValue(Parameters):
    """joint, from 1 (the pivot) to n; amplitude N m; angular_frequency rad/s; phase rad, pi / 2 for a cosine."""

    joint: Annotated[int, WholeNumber(1)]
    amplitude: Annotated[float, Range(-1e50, 1e50, "N m")]
    angular_frequency: Annotated[float, Range(1e-50, 1e50, "rad/s")]
    phase: Annotated[float, PHASE] = 0.0


DRIVE_TORQUE: Final = TableOf(DriveTorqueValue)


class DriveTorque(NamedTuple):
    """amplitudes: (n,) N m, 0 in all joints but one; frequency: rad/s; phase: rad."""

    amplitudes: FloatArray
    frequency: float
    phase: float

    @classmethod
    def of(cls, value: DriveTorqueValue, n: int) -> DriveTorque:
        """The term for a chain of n links."""
        if value.joint > n:
            raise InputError(f"drive_torque: joint is {show(value.joint)}; allowed: 1 to {n}, the joints of the chain")
        amplitudes = np.zeros(n)
        amplitudes[value.joint - 1] = value.amplitude
        return cls(amplitudes, value.angular_frequency, value.phase)

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return {"joint": 2, "amplitude": 0.5, "angular_frequency": 3.0, "phase": 0.6}

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return not self.amplitudes.any()

    @staticmethod
    def drive(term: DriveTorque, t: Any) -> Any:
        """The sine, from -1 to 1."""
        return np.sin(term.frequency * t + term.phase)

    @staticmethod
    def joint_torque(term: DriveTorque, drive: Any, i: Any, bend: Any, rate: Any) -> Any:  # noqa: ARG004
        """Whatever the chain does."""
        return term.amplitudes[i] * drive
