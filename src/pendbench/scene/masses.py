"""What the point masses of a chain may be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.base.ranges import Range


@dataclass(frozen=True)
class MassRange(Range):
    """A range, or 0 where a rod with a mass of its own takes the mass's place."""

    def __str__(self) -> str:
        return f"{super().__str__()}, or 0 on a rod with mass"

    def read(self, value: object) -> float:
        """As `Range.read`."""
        is_zero = isinstance(value, int | float) and not isinstance(value, bool) and value == 0
        return 0.0 if is_zero else super().read(value)

    def holds(self, numbers: FloatArray) -> npt.NDArray[np.bool_]:
        """As `Range.holds`."""
        return np.asarray(super().holds(numbers) | (numbers == 0.0))


# Far beyond any chain, and such that no product in the equations of motion overflows: the largest, of a mass ratio of
# 1e100, a length ratio of 1e100 and a rate squared, stays below 1e308.
MASS: Final = MassRange(1e-50, 1e50, "kg")


def check_masses(masses: FloatArray, terms: Mapping[str, Any], key: str = "masses") -> None:
    """Raise `InputError` where a mass (n,) kg is 0 and its rod has none: nothing would keep that link from any rate."""
    rods = [term.rod_masses(term) for term in terms.values() if hasattr(term, "rod_masses")]
    bare = np.flatnonzero((masses == 0.0) & (sum(rods, np.zeros(len(masses))) < MASS.low))
    if bare.size:
        entry = f", entry {bare[0] + 1}," if key == "masses" else ""
        raise InputError(f"{key}{entry} is 0; allowed: {MASS}")
