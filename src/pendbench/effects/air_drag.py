"""Drag on the masses in air at rest: a linear part (Stokes) and a quadratic one (Newton). Rods have none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.ranges import EachOf, Range
from pendbench.effects.table import Parameters, TableOf
from pendbench.effects.term import each

Each = float | tuple[float, ...]


@dataclass(frozen=True)
class AirDragValue(Parameters):
    """linear kg/s and quadratic kg/m, either of which can be left out; one number, or one for each mass."""

    linear: Annotated[Each, EachOf(Range(0.0, 1e50, "kg/s"), "mass")] = 0.0
    quadratic: Annotated[Each, EachOf(Range(0.0, 1e50, "kg/m"), "mass")] = 0.0


AIR_DRAG: Final = TableOf(AirDragValue)


class AirDrag(NamedTuple):
    """The force on a mass at velocity v: -(linear + quadratic |v|) v. linear: (n,) kg/s; quadratic: (n,) kg/m."""

    linear: FloatArray
    quadratic: FloatArray

    @classmethod
    def of(cls, value: AirDragValue, n: int) -> AirDrag:
        """The term for a chain of n links."""
        linear = each(value.linear, n, "air_drag: linear", "masses")
        return cls(linear, each(value.quadratic, n, "air_drag: quadratic", "masses"))

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return {"linear": [0.3, 0.2], "quadratic": 0.3}

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return not (self.linear.any() or self.quadratic.any())

    @staticmethod
    def drag(term: AirDrag, i: Any, x: Any, y: Any) -> tuple[Any, Any]:
        """Against the velocity."""
        factor = term.linear[i] + term.quadratic[i] * np.sqrt(x * x + y * y)
        return -(factor * x), -(factor * y)
