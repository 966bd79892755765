"""Drag on the masses in air at rest: a linear part (Stokes) and a quadratic one (Newton). Rods have none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Final, NamedTuple

import numpy as np

from pendbench.effects.table import Parameters, TableOf
from pendbench.ranges import Range


@dataclass(frozen=True)
class AirDragValue(Parameters):
    """linear kg/s and quadratic kg/m, either of which can be left out."""

    linear: Annotated[float, Range(0.0, 1e50, "kg/s")] = 0.0
    quadratic: Annotated[float, Range(0.0, 1e50, "kg/m")] = 0.0


AIR_DRAG: Final = TableOf(AirDragValue)


class AirDrag(NamedTuple):
    """The force on a mass at velocity v: -(linear + quadratic |v|) v."""

    linear: float
    quadratic: float

    @classmethod
    def of(cls, value: AirDragValue, n: int) -> AirDrag:  # noqa: ARG003
        """The term for a chain of n links."""
        return cls(value.linear, value.quadratic)

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return {"linear": 0.3, "quadratic": 0.3}

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return self.linear == 0.0 == self.quadratic

    @staticmethod
    def drag(term: AirDrag, i: Any, x: Any, y: Any) -> tuple[Any, Any]:  # noqa: ARG004
        """Against the velocity."""
        factor = term.linear + term.quadratic * np.sqrt(x * x + y * y)
        return -(factor * x), -(factor * y)
