"""Ropes of any number of links, by their names: `rope50000` is the bundled `rope1000` in fifty thousand links."""

from __future__ import annotations

import math
import os
import re

from pendbench.base.bundled import bundled_names
from pendbench.scene.scene import MAX_LINKS, Scene

_DURATION = 2.0  # s: the fall, the crack and the way back


def rope_named(name: object) -> Scene | None:
    """The rope that a name such as `rope50000` stands for: a metre and a kilogram, released horizontally.

    None for a bundled scene's name and whatever else is none of a rope.
    """
    text = os.fspath(name) if isinstance(name, str | os.PathLike) else ""
    found = re.fullmatch(r"rope([1-9][0-9]{0,6})", text) if isinstance(text, str) else None
    if found is None or int(found[1]) > MAX_LINKS or text in bundled_names("models"):
        return None
    n = int(found[1])
    title = f"Rope of {n} links, released horizontally"
    each, right = 1.0 / n, 0.5 * math.pi
    return Scene.chain(
        n=n, length=each, mass=each, angles=right, name=text, title=title, duration=_DURATION, gravity=9.81
    )
