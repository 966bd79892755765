"""Finished work on disk: one file for each piece, written whole or not at all, found again by what it depends on."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.files import write_whole
from pendbench.source import source_digest

_KEY: Final = "key of these arrays"
_KEY_LENGTH: Final = 24
# Also what a write leaves behind that was killed: a dot, the name, and more.
_OURS: Final = re.compile(rf"[0-9a-f]{{{_KEY_LENGTH}}}\.(json|npz)|\.[0-9a-f]{{{_KEY_LENGTH}}}\.(json|npz)\..+")


def key_of(*parts: object) -> str:
    """A name for what depends on `parts` (their repr) and on the project's source."""
    return hashlib.sha256(repr((source_digest(), *parts)).encode()).hexdigest()[:_KEY_LENGTH]


def _hash(key: str, value: Any) -> str:
    """By this, a digit that changed on the disk is noticed."""
    return hashlib.sha256(json.dumps([key, value]).encode()).hexdigest()[:16]


class Store:
    """The folder of finished work of one study."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def _path(self, key: str, ending: str) -> Path:
        return self.folder / f"{key}.{ending}"

    def load(self, key: str) -> Any:
        """What was saved under `key`, or None where there is nothing that can be read."""
        try:
            record = json.loads(self._path(key, "json").read_text("utf-8"))
            whole = isinstance(record, dict) and record.get("hash") == _hash(key, record.get("value"))
        except (OSError, ValueError, RecursionError):
            return None
        return record["value"] if whole else None

    def save(self, key: str, value: Any) -> None:
        """Save a value of JSON's types; numbers may be nan or infinite."""
        text = json.dumps({"key": key, "hash": _hash(key, value), "value": value}).encode()
        write_whole(self._path(key, "json"), lambda file: file.write(text))

    def load_arrays(self, key: str) -> dict[str, FloatArray] | None:
        """The arrays that were saved under `key`, or None where there is nothing that can be read."""
        try:
            with open(self._path(key, "npz"), "rb") as file, np.load(file, allow_pickle=False) as archive:
                arrays = {name: archive[name] for name in archive.files}
        except Exception:  # what is damaged, or of another making, fails in any way: numpy, zipfile and zlib raise
            return None
        return arrays if str(arrays.pop(_KEY, "")) == key else None

    def save_arrays(self, key: str, arrays: dict[str, FloatArray]) -> None:
        """Save arrays by name."""
        write_whole(self._path(key, "npz"), lambda file: np.savez(file, **arrays, **{_KEY: np.array(key)}))  # type: ignore[arg-type]

    def forget(self, key: str) -> None:
        """Forget the value that was saved under `key`, so that it is found again by running."""
        self._path(key, "json").unlink(missing_ok=True)

    def clear(self) -> None:
        """Forget all of it. Files that are not the store's stay."""
        for path in self.folder.glob("*"):
            if _OURS.fullmatch(path.name):
                path.unlink(missing_ok=True)
