"""The value of an effect that needs several numbers: a table of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Integral
from typing import Any, ClassVar, Final, Generic, TypeVar, get_type_hints

from pendbench.base.errors import InputError, choose, printable
from pendbench.base.ranges import Range
from pendbench.base.strict import show

Values = TypeVar("Values", bound="Parameters")

#: When a drive begins: where its sine is at 0 s. Beyond 1e9 rad a sine has lost half of its digits.
PHASE: Final = Range(-1e9, 1e9, "rad")


@dataclass(frozen=True)
class Parameters:
    """The base of such a table's class, whose fields are `Annotated` with what is allowed.

    Raises `InputError` where a value is not.
    """

    __pydantic_config__: ClassVar[Any] = {"extra": "forbid"}

    def __post_init__(self) -> None:
        for name, hint in get_type_hints(type(self), include_extras=True).items():
            if hasattr(hint, "__metadata__"):
                object.__setattr__(self, name, _read(hint.__metadata__[0], name, getattr(self, name)))


def _read(allowed: Any, name: str, value: object) -> object:
    try:
        return allowed.read(value)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    except ValueError as error:
        raise InputError(f"{name} is {show(value)}; allowed: {error}") from None


@dataclass(frozen=True)
class TableOf(Generic[Values]):
    """Reads such a table, from a file or from Python."""

    values: type[Values]

    def read(self, value: object) -> Values:
        """The table, from itself or from a mapping. Raises `InputError` with one line."""
        if isinstance(value, self.values):
            return value
        fields = {field.name: field for field in dataclasses.fields(self.values)}
        if not isinstance(value, Mapping):
            raise ValueError(f"a table of {', '.join(fields)}")
        if not value:
            raise InputError(f"an empty table; allowed: {', '.join(fields)}")
        if unknown := sorted(str(key) for key in value if key not in fields):
            raise InputError(choose("key", printable(unknown[0][:60])[:60], fields))
        for field in fields.values():
            if field.default is dataclasses.MISSING and field.name not in value:
                raise InputError(f"missing key '{field.name}'")
        return self.values(**value)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """A file's table is checked as a mapping given in Python is."""
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(self.read)


@dataclass(frozen=True)
class OneOf:
    """One of a few words."""

    words: tuple[str, ...]

    def __str__(self) -> str:
        return " or ".join(f'"{word}"' for word in self.words)

    def read(self, value: object) -> str:
        """The word. Raises `ValueError`, saying which are allowed."""
        if not isinstance(value, str) or value not in self.words:
            raise ValueError(str(self))
        return value


@dataclass(frozen=True)
class WholeNumber:
    """A whole number from `low` on."""

    low: int

    def __str__(self) -> str:
        return f"a whole number from {self.low} on"

    def read(self, value: object) -> int:
        """The number. Raises `ValueError`, saying what is allowed."""
        if isinstance(value, bool) or not isinstance(value, Integral) or value < self.low:
            raise ValueError(str(self))
        return int(value)
