"""Finished work on disk: one file for each piece, written whole or not at all, found again by what it depends on."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar, get_type_hints

import numpy as np

from pendbench.base.files import write_whole
from pendbench.execution.content import KEY_LENGTH

R = TypeVar("R")

# Also what a write leaves behind that was killed: a dot, the name, and more. npz: of earlier versions.
_OURS: Final = re.compile(rf"[0-9a-f]{{{KEY_LENGTH}}}\.(json|npz)|\.[0-9a-f]{{{KEY_LENGTH}}}\.(json|npz)\..+")


@cache
def _converter() -> Any:
    """Turns records into what JSON can write, and back by the types of their fields; arrays to the last bit."""
    import cattrs

    def written(array: Any) -> dict[str, Any]:
        return {"dtype": array.dtype.str, "shape": array.shape, "base64": base64.b64encode(array.tobytes()).decode()}

    def read(kept: dict[str, Any], _: object) -> Any:
        return np.frombuffer(base64.b64decode(kept["base64"]), dtype=kept["dtype"]).reshape(kept["shape"])

    def read_named(kept: list[Any], wanted: Any) -> Any:
        entries = zip(kept, get_type_hints(wanted).values(), strict=True)
        return wanted(*(converter.structure(entry, its) for entry, its in entries))

    converter = cattrs.Converter(forbid_extra_keys=True)
    # Of its own accord cattrs does not resolve annotations of named tuples that are text.
    converter.register_structure_hook_func(_is_named_tuple, read_named)
    converter.register_unstructure_hook_func(_is_array, written)
    converter.register_structure_hook_func(_is_array, read)
    return converter


def _is_array(wanted: Any) -> bool:
    return (getattr(wanted, "__origin__", None) or wanted) is np.ndarray


def _is_named_tuple(wanted: Any) -> bool:
    return isinstance(wanted, type) and issubclass(wanted, tuple) and hasattr(wanted, "_fields")


def _hash(key: str, value: Any) -> str:
    """By this, a digit that changed on the disk is noticed."""
    return hashlib.sha256(json.dumps([key, value]).encode()).hexdigest()[:16]


class Store:
    """The folder of finished work of one study."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.json"

    def load(self, key: str, wanted: type[R]) -> R | None:
        """What was saved under `key`, or None where there is nothing of that type that can be read."""
        try:
            kept = json.loads(self._path(key).read_text("utf-8"))
            if kept["hash"] != _hash(key, kept["value"]):
                return None
            found: R = _converter().structure(kept["value"], wanted)
        except Exception:  # what is damaged, or of another making, fails in any way
            return None
        return found

    def save(self, key: str, value: object) -> None:
        """Save a record: a dataclass or a named tuple of numbers, texts, arrays and further records."""
        plain = _converter().unstructure(value)
        text = json.dumps({"key": key, "hash": _hash(key, plain), "value": plain}).encode()
        write_whole(self._path(key), lambda file: file.write(text))

    def count(self) -> int:
        """How many results there are, of whatever making."""
        return sum(1 for path in self.folder.glob("*") if _OURS.fullmatch(path.name) and not path.name.startswith("."))

    def forget(self, key: str) -> None:
        """Forget what was saved under `key`."""
        self._path(key).unlink(missing_ok=True)

    def clear(self) -> None:
        """Forget all of it. Files that are not the store's stay."""
        for path in self.folder.glob("*"):
            if _OURS.fullmatch(path.name):
                path.unlink(missing_ok=True)
