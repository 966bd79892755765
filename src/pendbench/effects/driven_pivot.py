"""A pivot that is shaken: r_0(t) = amplitude sin(w t + phase) along one axis.

Angles are those of the rods, and energy is that which the chain has for someone who rides on the pivot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Final, NamedTuple

import numpy as np

from pendbench.base.ranges import Range
from pendbench.effects.table import PHASE, OneOf, Parameters, TableOf


@dataclass(frozen=True)
class DrivenPivotValue(Parameters):
    """axis "x" (to the right) or "y" (upwards); amplitude m; angular_frequency rad/s; phase rad, pi / 2: a cosine."""

    axis: Annotated[str, OneOf(("x", "y"))]
    amplitude: Annotated[float, Range(-1e50, 1e50, "m")]
    angular_frequency: Annotated[float, Range(1e-50, 1e50, "rad/s")]
    phase: Annotated[float, PHASE] = 0.0


DRIVEN_PIVOT: Final = TableOf(DrivenPivotValue)


class DrivenPivot(NamedTuple):
    """x and y: the amplitude's parts, m; frequency: rad/s; phase: rad."""

    x: float
    y: float
    frequency: float
    phase: float

    @classmethod
    def of(cls, value: DrivenPivotValue, n: int) -> DrivenPivot:  # noqa: ARG003
        """The term for a chain of n links."""
        along_x = value.axis == "x"
        x, y = (value.amplitude, 0.0) if along_x else (0.0, value.amplitude)
        return cls(x, y, value.angular_frequency, value.phase)

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return {"axis": "y", "amplitude": 0.05, "angular_frequency": 10.0, "phase": 0.6}

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return self.x == 0.0 == self.y

    @staticmethod
    def pivot_position(term: DrivenPivot, t: Any) -> tuple[Any, Any]:
        """r_0 itself."""
        factor = np.sin(term.frequency * t + term.phase)
        return term.x * factor, term.y * factor

    @staticmethod
    def pivot_acceleration(term: DrivenPivot, t: Any) -> tuple[Any, Any]:
        """The second derivative of r_0."""
        factor = -(np.sin(term.frequency * t + term.phase) * term.frequency * term.frequency)
        return term.x * factor, term.y * factor

    @staticmethod
    def pivot_velocity(term: DrivenPivot, t: Any) -> tuple[Any, Any]:
        """The first derivative of r_0."""
        factor = np.cos(term.frequency * t + term.phase) * term.frequency
        return term.x * factor, term.y * factor
