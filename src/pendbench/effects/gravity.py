"""Gravity, downwards."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from pendbench.base.ranges import Range

# A chain in upward gravity is the same chain with pi added to its angles.
GRAVITY: Final = Range(0.0, 1e9, "m/s^2")


class Gravity(NamedTuple):
    """gravity: m/s^2. A chain under gravity accelerates as one whose pivot accelerates upwards."""

    gravity: float

    @classmethod
    def of(cls, value: float, n: int) -> Gravity:  # noqa: ARG003
        """The term for a chain of n links."""
        return cls(value)

    @staticmethod
    def example() -> Any:
        """Shows in half a second."""
        return 9.81

    def is_nothing(self) -> bool:
        """Whether it does nothing."""
        return self.gravity == 0.0

    @staticmethod
    def pivot_acceleration(term: Gravity, t: Any) -> tuple[Any, Any]:  # noqa: ARG004
        """Upwards, at all times."""
        return 0.0, term.gravity

    @staticmethod
    def mass_potential(term: Gravity, x: Any, y: Any) -> Any:  # noqa: ARG004
        """Of the height."""
        return term.gravity * y
