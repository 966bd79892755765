"""What a number may be, checked in the same words wherever it comes from: a file or Python."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, Final

import numpy as np

from pendbench.errors import InputError
from pendbench.strict import show


@dataclass(frozen=True)
class Range:
    """The finite numbers from low to high, both included."""

    low: float
    high: float
    unit: str

    def __str__(self) -> str:
        return f"a number from {self.low:g} to {self.high:g} {self.unit}"

    def read(self, value: object) -> float:
        """The value as a float. Raises `ValueError`, saying what is allowed, for anything but a number in the range."""
        if isinstance(value, bool) or not isinstance(value, Real):
            raise ValueError(str(self))
        try:
            number = float(value)
        except OverflowError:  # an integer can be too large for a float
            raise ValueError(str(self)) from None
        if not self.low <= number <= self.high:
            raise ValueError(str(self))
        return number

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """A file's number is checked as one given in Python is: ``Annotated[float, Range(...)]`` in a table."""
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(self.read)


#: A fixed step.
STEP: Final = Range(1e-50, 1e50, "s")


@dataclass(frozen=True)
class EachOf:
    """One number in a range that is meant for all, or a list with one for each."""

    range: Range
    of: str

    def __str__(self) -> str:
        return f"{self.range}, or a list with one for each {self.of}"

    def read(self, value: object) -> float | tuple[float, ...]:
        """The value as a float or a tuple of floats. Raises `ValueError`, saying what is allowed.

        For an entry of a list, `InputError` with a sentence.
        """
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, Sequence) or isinstance(value, str | bytes | bytearray):
            try:
                return self.range.read(value)
            except ValueError:
                raise ValueError(str(self)) from None
        if not value:
            raise ValueError(str(self))
        return tuple(self._entry(number, entry) for number, entry in enumerate(value, start=1))

    def _entry(self, number: int, entry: object) -> float:
        try:
            return self.range.read(entry)
        except ValueError:
            raise InputError(f"entry {number} is {show(entry)}; allowed: {self.range}") from None

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """As for `Range`."""
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(self.read)
