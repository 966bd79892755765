"""What a value is made of: equal contents have equal keys, and whatever differs in content has another key."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Mapping, Set
from typing import Any, Final

import numpy as np

from pendbench.base.source import measures, source_digest, surroundings

KEY_LENGTH: Final = 24


def key_of(function: Callable[..., object], *parts: object) -> str:
    """A name for what a function gives for these `parts`: of the function, the project's source and their content,
    and of the libraries and the machine that it runs on.

    Raises TypeError for a part whose content cannot be told, since no two of those could be told apart, and for a
    function whose source is in no key: what runs in workers stands in the `work.py` of a kind.
    """
    if not measures(function.__module__):
        raise TypeError(f"the source of {function.__module__} is in no key; allowed: a function of the kind's work.py")
    program = [source_digest(), *surroundings(), function.__module__, function.__qualname__]
    whole = [*program, *(content(part) for part in parts)]
    return hashlib.sha256(json.dumps(whole).encode()).hexdigest()[:KEY_LENGTH]


def content(value: object) -> Any:
    """A value as lists and texts that JSON can write, with its type wherever values of two types may look the same.

    A class decides for itself by a method `content()`, which returns what counts.
    """
    if value is None or isinstance(value, bool | str):
        return value
    return [type(value).__qualname__, *_parts(value)]


def _parts(value: object) -> list[Any]:
    """What there is inside a value, in an order that does not depend on how it was made."""
    match value:
        case int() | float() | np.number():
            parts: list[Any] = [repr(value)]
        case np.ndarray() if not value.dtype.hasobject:  # those are addresses
            parts = [value.dtype.str, list(value.shape), hashlib.sha256(value.tobytes()).hexdigest()]
        case Mapping():
            parts = sorted(([content(key), content(inner)] for key, inner in value.items()), key=repr)
        case Set():
            parts = sorted((content(entry) for entry in value), key=repr)
        case list() | tuple():
            parts = [content(entry) for entry in value]
        case _ if callable(own := getattr(value, "content", None)):
            parts = [content(own())]
        case _ if dataclasses.is_dataclass(value):
            parts = [[field.name, content(getattr(value, field.name))] for field in dataclasses.fields(value)]
        case _:
            raise TypeError(f"the content of a {type(value).__qualname__} cannot be told")
    return parts
