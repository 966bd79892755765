"""What a number may be, checked in the same words wherever it comes from: a file or Python."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.base.strict import show


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

    def holds(self, numbers: FloatArray) -> npt.NDArray[np.bool_]:
        """Which of the numbers (...) are in the range."""
        return (numbers >= self.low) & (numbers <= self.high)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """A file's number is checked as one given in Python is: ``Annotated[float, Range(...)]`` in a table."""
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        """For the page that lists the keys of files."""
        return {"type": "number", "minimum": self.low, "maximum": self.high}


@dataclass(frozen=True)
class Step(Range):
    """A step, s, as a file has it: a number, or what no decimal says, a fraction ("1/60") or a rate ("60 Hz")."""

    def __str__(self) -> str:
        return f'{super().__str__()}, or in quotes a fraction, as "1/60", or a rate, as "60 Hz"'

    def read(self, value: object) -> float:
        """The value as a float, s. Raises `ValueError`, saying what is allowed, for anything else."""
        return super().read(self._seconds(value) if isinstance(value, str) else value)

    def _seconds(self, text: str) -> float:
        fraction = re.fullmatch(r"\s*(\d{1,15})\s*/\s*(\d{1,15})\s*", text, re.ASCII)
        rate = re.fullmatch(r"\s*(\d{1,15}(?:\.\d{1,15})?)\s*Hz\s*", text, re.ASCII)
        over, under = fraction.groups() if fraction else ("1", rate[1]) if rate else ("1", "0")
        if not float(under):
            raise ValueError(str(self))
        return float(over) / float(under)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        """As for `Range`."""
        return {**super().__get_pydantic_json_schema__(schema, handler), "type": "step"}


#: A fixed step.
STEP: Final = Range(1e-50, 1e50, "s")


def rising_times(times: npt.ArrayLike) -> FloatArray:
    """The times as an array (k,) s of their own. Raises `InputError` for what is no list of rising times from 0 on."""
    try:
        array = np.asarray(times)
    except (ValueError, TypeError):
        array = np.asarray(None)
    if array.ndim != 1 or array.size == 0 or array.dtype.kind not in "iuf":
        raise InputError("times is not a list of numbers; allowed: one time or more, s")
    array = array.astype(np.float64)
    if not (np.all(np.isfinite(array)) and array[0] >= 0.0 and np.all(np.diff(array) > 0.0)):
        raise InputError("times is not in order; allowed: finite times from 0 on, each later than the one before, s")
    return array


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
