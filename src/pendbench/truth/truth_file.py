"""The truth as data, for programs of any language: an `.npz` of plain arrays or a CSV file, with its checksum."""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Iterator
from pathlib import Path
from platform import python_version
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.files import write_whole
from pendbench.base.strict import input_error, shown_path
from pendbench.scene.scene import Scene
from pendbench.scene.to_toml import to_toml
from pendbench.truth.reference import Truth

#: What the text of such a file begins with, and the version of what follows.
FORMAT: Final = "pendbench truth"
VERSION: Final = 1

_SAMPLES: Final = ("t", "theta", "omega", "theta_low", "omega_low", "bound")


def write_truth(scene: Scene, truth: Truth, path: str | os.PathLike[str]) -> tuple[Path, Path]:
    """Write the truth of a scene to a file that ends in .npz or .csv, and its SHA-256 beside it, as `sha256sum` reads.

    docs/truth_files.md says what is in them. Each file is there whole or not at all. Returns both paths.

    Raises `InputError`, one line, for another ending, or where nothing can be written.
    """
    file = check_ending(path)
    content = _CONTENTS[file.suffix](about(scene, truth), truth)
    checksum = file.with_name(f"{file.name}.sha256")
    line = f"{hashlib.sha256(content).hexdigest()}  {file.name}\n".encode()
    try:
        write_whole(file, lambda out: out.write(content))
        write_whole(checksum, lambda out: out.write(line))
    except OSError as error:
        raise input_error(shown_path(file), f"cannot be written: {error.strerror or error}") from None
    return file, checksum


def check_ending(path: str | os.PathLike[str]) -> Path:
    """The path. Raises `InputError` where its ending says neither of the two formats."""
    file = Path(path)
    if file.suffix not in _CONTENTS:
        raise input_error(shown_path(file), "allowed: a name that ends in .npz or .csv")
    return file


def about(scene: Scene, truth: Truth) -> dict[str, Any]:
    """What the numbers are, and what they come from."""
    from pendbench import __version__

    return {
        "format": FORMAT,
        "version": VERSION,
        "scene": scene.name,
        "links": scene.n,
        "horizon_s": truth.horizon,
        "error": truth.error,
        "ended": truth.reason,
        "made_with": {"pendbench": __version__, "numpy": np.__version__, "python": python_version()},
        "scene_file": to_toml(scene),
    }


def _npz(told: dict[str, Any], truth: Truth) -> bytes:
    content = io.BytesIO()
    arrays: dict[str, Any] = {name: getattr(truth, name) for name in _SAMPLES}
    np.savez(content, about=np.array(json.dumps(told)), **arrays)
    return content.getvalue()


def _csv(told: dict[str, Any], truth: Truth) -> bytes:
    """One line that begins with # and holds the text, one of names, and one of numbers for each time."""
    columns = dict(_columns(truth))
    rows = np.column_stack(list(columns.values())).tolist() if len(truth.t) else []
    lines = [f"# {json.dumps(told)}", ",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    return "\n".join([*lines, ""]).encode()


def _columns(truth: Truth) -> Iterator[tuple[str, FloatArray]]:
    yield "t", truth.t
    for name in ("theta", "omega", "theta_low", "omega_low"):
        for link, values in enumerate(getattr(truth, name).T, 1):
            yield f"{name}_{link}", values
    yield "bound", truth.bound


_CONTENTS: Final = {".npz": _npz, ".csv": _csv}
