"""Runs in files: an `.npz` of plain arrays, and of one text in JSON that says what they are. Nothing in one is run."""

from __future__ import annotations

import dataclasses
import json
import os
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.base.faults import STATUSES
from pendbench.base.files import write_whole
from pendbench.base.strict import input_error, show, shown_path
from pendbench.scene.scene import Links, Scene
from pendbench.scene.trajectory import Maker, Trajectory

#: What the text begins with, and the version of what follows.
_FORMAT: Final = "pendbench run"
_VERSION: Final = 1

_SAMPLES: Final = ("t", "theta", "omega", "gap")
_CHAIN: Final = ("masses", "lengths", "angles", "rates")
_LINKS: Final = ("mass", "centre", "inertia")
# What numpy, zip and JSON raise for a file that is damaged or somebody else's.
_DAMAGE: Final = (
    ValueError, KeyError, TypeError, AttributeError, EOFError, NotImplementedError, RuntimeError, MemoryError,
    OverflowError, SyntaxError, tokenize.TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip


def write_run(run: Trajectory, path: str | os.PathLike[str]) -> None:
    """Write a run to a file, which is there whole or not at all. Raises `InputError`, one line."""
    file = _path(path)
    _check_times(run.t)
    if file.suffix != ".npz":
        raise input_error(shown_path(file), "a run is saved as numpy's .npz; allowed: a name that ends in .npz")
    arrays = {key: getattr(run, key) for key in _SAMPLES} | _arrays_of(run.scene)
    try:
        write_whole(file, lambda out: np.savez(out, about=np.array(json.dumps(_about(run))), **arrays))
    except OSError as error:
        raise input_error(shown_path(file), f"cannot be written: {error.strerror or error}") from None


def load_run(path: str | os.PathLike[str]) -> Trajectory:
    """The run that `Trajectory.save` wrote to a file, with its scene and its maker.

    >>> import pendbench as pb, tempfile, os
    >>> file = os.path.join(tempfile.mkdtemp(), "run.npz")
    >>> pb.simulate("double", times=[0.0, 1.0]).save(file)
    >>> pb.load_run(file)
    <Trajectory of 'double' by analytic taylor: 2 samples of 2 links, 0 to 1 s, ok>

    Raises InputError, one line, for a file that is damaged or was not written by `save`; nothing in it is run.
    """
    file = _path(path)
    where = shown_path(file)
    try:
        if file.exists() and not file.is_file():
            raise InputError("not a regular file")
        with file.open("rb") as content, np.load(content, allow_pickle=False) as arrays:
            return _run_of(arrays)
    except FileNotFoundError:
        raise input_error(where, "no such file") from None
    except OSError as error:
        raise input_error(where, f"cannot be read: {error.strerror or error}") from None
    except InputError as error:
        raise input_error(where, str(error)) from None
    except _DAMAGE:
        raise input_error(where, "damaged, or not a run that Trajectory.save wrote") from None


def _path(path: str | os.PathLike[str]) -> Path:
    try:
        return Path(path)
    except TypeError:
        raise InputError(f"{show(path)} is not a path") from None


def _arrays_of(scene: Scene | None) -> dict[str, FloatArray]:
    if scene is None:
        return {}
    links = {} if scene.links is None else {f"scene_link_{key}": getattr(scene.links, key) for key in _LINKS}
    return {f"scene_{key}": getattr(scene, key) for key in _CHAIN} | links


def _about(run: Trajectory) -> dict[str, Any]:
    scene = run.scene
    return {
        "format": _FORMAT,
        "version": _VERSION,
        "status": run.status,
        "reason": run.reason,
        "steps": run.steps,
        "maker": None if run.maker is None else dataclasses.asdict(run.maker),
        "scene": None if scene is None else _about_scene(scene),
    }


def _about_scene(scene: Scene) -> dict[str, Any]:
    effects = {name: value for name, value in dataclasses.asdict(scene.effects).items() if value is not None}
    return {"name": scene.name, "title": scene.title, "duration": scene.duration, "effects": effects}


def _run_of(arrays: Mapping[str, Any]) -> Trajectory:
    about = json.loads(str(arrays["about"]))
    if about["format"] != _FORMAT:
        raise ValueError("somebody else's")
    if about["version"] != _VERSION:
        raise InputError(f"a run of version {show(about['version'])} of the format; this pendbench reads {_VERSION}")
    t, theta, omega, gap = (_numbers(arrays[key]) for key in _SAMPLES)
    if t.ndim != 1 or theta.ndim != 2 or not len(t) == len(theta) == len(gap) or theta.shape != omega.shape:
        raise ValueError("samples that do not agree")
    _check_times(t)
    scene = None if about["scene"] is None else _scene_of(about["scene"], arrays)
    if scene is not None and scene.n != theta.shape[1]:
        raise ValueError("another scene's samples")
    return Trajectory(t, theta, omega, gap, *_ending(about), scene=scene, maker=_maker_of(about["maker"]))


def _check_times(t: FloatArray) -> None:
    """Raise `InputError` where a run's times (k,) s are not those of one motion."""
    wrong = ~(np.isfinite(t) & (np.diff(t, prepend=-np.inf) > 0.0))
    if wrong.any():
        at = int(wrong.argmax())
        raise InputError(f"t, entry {at + 1}, is {t[at]:g}; allowed: finite times, each later than the one before, s")


def _ending(about: Mapping[str, Any]) -> tuple[str, str, int | None]:
    status, reason, steps = about["status"], about["reason"], about["steps"]
    if status not in STATUSES or not isinstance(reason, str) or not (steps is None or type(steps) is int):
        raise ValueError("no ending of a run")
    return status, reason, steps


def _scene_of(about: Mapping[str, Any], arrays: Mapping[str, Any]) -> Scene:
    has_links = f"scene_link_{_LINKS[0]}" in arrays
    links = Links(*(_numbers(arrays[f"scene_link_{key}"]) for key in _LINKS)) if has_links else None
    chain: dict[str, Any] = {key: _numbers(arrays[f"scene_{key}"]) for key in _CHAIN}
    return Scene(**about, **chain, links=links)


def _maker_of(about: Mapping[str, Any] | None) -> Maker | None:
    if about is None:
        return None
    pairs = {key: tuple((str(name), its) for name, its in about[key]) for key in ("settings", "versions")}
    made = Maker(str(about["engine"]), str(about["method"]), about["dt"], **pairs)
    str(made)  # raises where its numbers are none
    return made


def _numbers(values: Any) -> FloatArray:
    if values.dtype != np.float64:
        raise ValueError("no numbers")
    return np.asarray(values)
