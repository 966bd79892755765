"""How numbers become text for people: here and nowhere else."""

from __future__ import annotations

import math
import re
from typing import Any, Final

import numpy as np

#: What people read where there is nothing to be read.
NOTHING: Final = "\u2013"


def is_missing(value: Any) -> bool:
    """Whether there is no value: None, not a number, or empty text."""
    if isinstance(value, (float, np.floating)):
        return math.isnan(value)
    return value is None or (isinstance(value, str) and not value)


def number_text(value: Any, spec: str = ".3g") -> str:
    """A number for people: three digits rather than an exponent where it is of everyday size."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    number = float(value)
    if math.isnan(number):
        return NOTHING
    if math.isinf(number):
        return "infinite" if number > 0 else "-infinite"
    if number == 0:
        return "0"
    if spec == "d":
        return f"{number:.0f}"
    if spec.endswith("e") and 0.1 <= abs(number) < 1000:
        spec = ".2g"
    text = f"{number:{spec}}"
    if spec.endswith("g"):
        text = f"{float(text):.6g}"
    return re.sub(r"e([+-])0*(\d)", lambda m: f"e{m[1].strip('+')}{m[2]}", text)


def duration_text(seconds: float) -> str:
    """A time for people, to the two digits that a timing is worth, in the unit of its size: ``38 µs``, ``2.3 ms``."""
    for unit, size in (("µs", 1e-6), ("ms", 1e-3)):
        if seconds < 995 * size:  # what reads as 1000 is one of the next unit
            return f"{number_text(seconds / size, '.2g')} {unit}"
    return f"{number_text(seconds, '.2g')} s" if math.isfinite(seconds) else NOTHING


def times_text(ratio: float) -> str:
    """How many times as much, to two digits, with its sign."""
    return f"{number_text(ratio, '.2g')}\u00d7"
