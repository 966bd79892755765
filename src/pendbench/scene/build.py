"""Scenes made in Python: one number for every link or a list with one for each, and effects by their names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np

from pendbench.base.errors import InputError, choose, printable
from pendbench.base.strict import show
from pendbench.effects import names as effect_names

#: The fields of a scene that have one number for each link.
VECTORS: Final = ("masses", "lengths", "angles", "rates")


def check_names(given: Iterable[str], others: Iterable[str]) -> None:
    """Raise InputError for a name that is neither an effect's nor one of the others."""
    known = {*effect_names(), *others}
    if unknown := [name for name in given if name not in known]:
        raise InputError(choose("field or effect", printable(unknown[0][:60]), known))


def count_of(values: Iterable[Any], n: int | None, most: int) -> int:
    """How many links there are: as many as the first list has entries, n where there is none.

    Raises InputError where that is no such number. That all agree is checked by the scene.
    """
    found = next((len(value) for value in values if _is_list(value)), n)
    if type(found) is not int or not 1 <= found <= most:
        raise InputError(f"n is {show(found)}; allowed: a whole number from 1 to {most}, or a list for each link")
    return found


def each(value: Any, n: int) -> Any:
    """One number for each of n links: a list as it is, a number so many times."""
    return value if value is None or _is_list(value) else np.full(n, value)


def _is_list(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return hasattr(value, "__len__") and not isinstance(value, str | Mapping)
