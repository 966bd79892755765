"""The start of a scene as people read it: in radians, as it is written, and in degrees, as it is meant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from pendbench.report.numbers import number_text
from pendbench.scene.scene import Scene

_LISTED: Final = 4
#: Nobody releases a link more than a turn from the vertical on purpose.
_TURN: Final = 2.0 * math.pi


def start_text(scene: Scene) -> str:
    """``1.57 rad (90°)``: the angles at the start, and the rates where there are any."""
    text = f"{_numbers(scene.angles.tolist())} rad ({_numbers(np.degrees(scene.angles).tolist(), '°')})"
    return f"{text}, {_numbers(scene.rates.tolist())} rad/s" if scene.rates.any() else text


def _numbers(values: Sequence[float], unit: str = "") -> str:
    """One number where all are the same, all of a few, or from where to where they reach."""
    if len(set(values)) == 1:
        return f"{number_text(values[0])}{unit}"
    if len(values) <= _LISTED:
        return ", ".join(f"{number_text(value)}{unit}" for value in values)
    return f"{number_text(min(values))}{unit} to {number_text(max(values))}{unit}"


def turns_at_start(scene: Scene) -> float:
    """The most turns from the vertical at which a link starts, where that is more than one; 0 otherwise."""
    farthest = float(np.abs(scene.angles).max())
    return farthest / _TURN if farthest > _TURN else 0.0
