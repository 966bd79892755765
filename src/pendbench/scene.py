"""A scene: a chain, its start, the effects it calls for, and how long."""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, cast

import numpy as np
import numpy.typing as npt

from pendbench.arrays import FloatArray
from pendbench.effects import Effects
from pendbench.effects.term import Term
from pendbench.errors import InputError
from pendbench.ranges import Range
from pendbench.strict import input_error, show

__all__ = ["Effects", "Scene", "load_scene"]

# Far beyond any chain, and such that no product in the equations of motion overflows: the largest, of a mass ratio of
# 1e100, a length ratio of 1e100 and a rate squared, stays below 1e308.
MASS: Final = Range(1e-50, 1e50, "kg")
LENGTH: Final = Range(1e-50, 1e50, "m")
# Beyond 1e9 rad a sine has lost half of its digits.
ANGLE: Final = Range(-1e9, 1e9, "rad")
RATE: Final = Range(-1e9, 1e9, "rad/s")
DURATION: Final = Range(1e-50, 1e9, "s")
MAX_LINKS: Final = 1_000_000


@dataclass(frozen=True, eq=False)
class Scene:
    """A chain of n point masses on rods, which are massless unless an effect says otherwise, and what happens to it.

    masses (n,) kg and lengths (n,) m from the pivot outwards; angles (n,) rad, absolute, from the downward vertical,
    counter-clockwise positive; rates (n,) rad/s; duration s. The arrays are copied, and read-only.

    Raises `InputError`, one line, for arrays that are not (n,) with 1 <= n <= `MAX_LINKS`, for numbers outside `MASS`,
    `LENGTH`, `ANGLE`, `RATE` and `DURATION`, and for effects that do not fit n links.
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
        try:
            self._check()
        except InputError as error:
            raise input_error(f"scene {show(self.name)}", str(error)) from None

    def _check(self) -> None:
        for field, kind in (("name", str), ("title", str), ("effects", Effects)):
            if not isinstance(getattr(self, field), kind):
                raise InputError(f"{field} is {show(getattr(self, field))}; allowed: {kind.__name__}")
        object.__setattr__(self, "duration", _number("duration", self.duration, DURATION))
        for field, allowed in (("masses", MASS), ("lengths", LENGTH), ("angles", ANGLE), ("rates", RATE)):
            object.__setattr__(self, field, _vector(field, getattr(self, field), allowed))
        if not 1 <= self.n <= MAX_LINKS:
            raise InputError(f"masses has {self.n} entries; allowed: 1 to {MAX_LINKS}")
        for field in ("lengths", "angles", "rates"):
            if len(getattr(self, field)) != self.n:
                raise InputError(disagreement("masses", self.n, field, len(getattr(self, field))))
        self.effects.terms(self.n)  # raises where they do not fit

    def __reduce__(self) -> tuple[type[Scene], tuple[Any, ...]]:
        """Pickled by what it was made from, so that its arrays are read-only in another process too."""
        return Scene, tuple(getattr(self, field.name) for field in dataclasses.fields(self))

    @property
    def n(self) -> int:
        """How many links the chain has."""
        return len(self.masses)

    @cached_property
    def terms(self) -> Mapping[str, Term]:
        """What acts on the chain, by the effects' names; one whose numbers are all 0 does not, and is not simulated."""
        return MappingProxyType(self.effects.terms(self.n))

    @property
    def total_length(self) -> float:
        """The length of the straight chain, m."""
        return float(self.lengths.sum())

    def with_start(self, angles: npt.ArrayLike, rates: npt.ArrayLike) -> Scene:
        """The same scene from another start: angles (n,) rad, rates (n,) rad/s."""
        return dataclasses.replace(self, angles=cast(FloatArray, angles), rates=cast(FloatArray, rates))

    def without(self, *effects: str) -> Scene:
        """The same scene without these effects."""
        return dataclasses.replace(self, effects=dataclasses.replace(self.effects, **dict.fromkeys(effects)))

    @property
    def digest(self) -> str:
        """A hash of everything that decides the motion (the name and the title do not)."""
        content = hashlib.sha256()
        for array in (self.masses, self.lengths, self.angles, self.rates):
            content.update(array.tobytes())
        effects = {name: getattr(self.effects, name) for name in self.effects.named()}
        content.update(repr((self.n, self.duration, effects)).encode())
        return content.hexdigest()[:16]


def load_scene(path_or_name: str | os.PathLike[str], *, relative_to: Path | None = None) -> Scene:
    """The scene in a file, or the bundled scene of that name.

    What ends in .toml or holds a path separator is a path; it is looked for in the folder `relative_to` first, where
    one is given, and then in the working folder. Anything else is the name of a bundled scene.

    Raises `InputError`, one line naming the file and the key, for whatever cannot be used.
    """
    from pendbench.scene_file import find_scene, read_scene  # loads pydantic, which importing a scene should not

    return read_scene(find_scene(path_or_name, relative_to))


def disagreement(key: str, count: int, other: str, other_count: int) -> str:
    """Say that two keys (`n`, or lists with one entry for each link) disagree about how many links there are."""
    return f"{_counted(key, count)} but {_counted(other, other_count)}; allowed: one entry for each link"


def _counted(key: str, count: int) -> str:
    return f"{key} is {count}" if key == "n" else f"{key} has {count} {'entry' if count == 1 else 'entries'}"


def _number(name: str, value: object, allowed: Range) -> float:
    try:
        return allowed.read(value)
    except ValueError as error:
        raise InputError(f"{name} is {show(value)}; allowed: {error}") from None


def _vector(name: str, values: npt.ArrayLike, allowed: Range) -> FloatArray:
    """The values as a read-only array (n,) of its own."""
    try:
        array = np.asarray(values)
    except (ValueError, TypeError):
        array = np.asarray(None)
    if array.ndim != 1 or array.dtype.kind not in "iuf":
        raise InputError(f"{name} is not a list of numbers; allowed: one number for each link")
    outside = np.flatnonzero(~((array >= allowed.low) & (array <= allowed.high)))
    if outside.size:
        raise InputError(f"{name}, entry {outside[0] + 1}, is {show(array[outside[0]].item())}; allowed: {allowed}")
    array = np.array(array, dtype=np.float64)
    array.setflags(write=False)
    return array
