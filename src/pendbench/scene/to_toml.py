"""A scene as the text of a scene file."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import printable
from pendbench.scene.scene import Scene

LONGEST_TITLE: Final = 200


def to_toml(scene: Scene) -> str:
    """The scene as TOML that reads back as the same scene to the last bit; the name is the file's, and not in it."""
    lines = [f"# {printable(note)}" for note in scene.notes]
    lines += [f"title = {_text(printable(scene.title)[:LONGEST_TITLE])}", f"duration = {scene.duration!r}"]
    lines += ["", "[chain]", f"n = {scene.n}"]
    lines += [_each("length", "lengths", scene.lengths)]
    if scene.links is None:
        lines += [_each("mass", "masses", scene.masses)]
    else:
        lines += ["", "[links]"]
        lines += [f"{name} = {_numbers(getattr(scene.links, name))}" for name in ("mass", "centre", "inertia")]
    lines += ["", "[start]", f"angles = {_numbers(scene.angles)}", f"rates = {_numbers(scene.rates)}"]
    if scene.effects.named():
        lines += ["", "[effects]"]
        lines += [f"{name} = {_value(getattr(scene.effects, name))}" for name in scene.effects.named()]
    return "\n".join(lines) + "\n"


def _each(one: str, each: str, values: FloatArray) -> str:
    """A key with one number for all links, where all are the same, or the key with a list."""
    return f"{one if np.all(values == values[0]) else each} = {_numbers(values)}"


def _numbers(values: FloatArray) -> str:
    listed = values.tolist()
    # By their digits, since 0.0 == -0.0.
    return _value(listed[0] if len(set(map(repr, listed))) == 1 else listed)


def _value(value: Any) -> str:
    """An effect's value as TOML: a number, a text, a list, or a table of those, written without what it leaves out."""
    if dataclasses.is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        inside = ", ".join(f"{key} = {_value(its)}" for key, its in value.items() if its is not None)
        return f"{{ {inside} }}"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)


def _text(text: str) -> str:
    """A text on one line in TOML's basic quotes."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
