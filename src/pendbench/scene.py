"""A scene: a chain, its start, the effects it calls for, and how long."""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Effects:
    """What acts on the chain. None: the scene does not call for it, and nothing of it is simulated.

    gravity: m/s^2, downwards.
    """

    gravity: float | None = None

    def named(self) -> tuple[str, ...]:
        """The names of the effects that the scene calls for."""
        return tuple(f.name for f in dataclasses.fields(self) if getattr(self, f.name) is not None)


@dataclass(frozen=True, eq=False)
class Scene:
    """A chain of n point masses on massless rods, and what happens to it.

    masses (n,) kg and lengths (n,) m from the pivot outwards; angles (n,) rad, absolute, from the downward vertical,
    counter-clockwise positive; rates (n,) rad/s; duration s. The arrays are read-only.
    """

    name: str
    title: str
    duration: float
    masses: FloatArray
    lengths: FloatArray
    angles: FloatArray
    rates: FloatArray
    effects: Effects

    def __post_init__(self) -> None:
        for field in ("masses", "lengths", "angles", "rates"):
            array = np.array(getattr(self, field), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, field, array)

    @property
    def n(self) -> int:
        """How many links the chain has."""
        return len(self.masses)

    @property
    def total_length(self) -> float:
        """The length of the straight chain, m."""
        return float(self.lengths.sum())

    def with_start(self, angles: npt.ArrayLike, rates: npt.ArrayLike) -> Scene:
        """The same scene from another start: angles (n,) rad, rates (n,) rad/s."""
        return dataclasses.replace(self, angles=np.asarray(angles), rates=np.asarray(rates))

    @property
    def digest(self) -> str:
        """A hash of everything that decides the motion (the name and the title do not)."""
        content = hashlib.sha256()
        for array in (self.masses, self.lengths, self.angles, self.rates):
            content.update(array.tobytes())
        content.update(repr((self.n, self.duration, self.effects)).encode())
        return content.hexdigest()[:16]
