"""Cases that differ in step or tolerance alone: what a method offers in a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pendbench.report.rows import Row, is_ok, number, word

_KEYS = ("scene", "engine", "method", "settings")


def step(row: Row) -> float:
    """The step, s, or the tolerance that stands for it: the smaller, the better and the dearer."""
    dt = number(row, "dt")
    return number(row, "tolerance") if math.isnan(dt) else dt


def without_tolerance(row: Row) -> Row:
    """The row, its settings without the tolerance: what it has in common with its series."""
    kept = [setting for setting in word(row, "settings").split() if not setting.startswith("tolerance=")]
    return {**row, "settings": " ".join(kept)}


def series(cases: Sequence[Row]) -> list[list[Row]]:
    """Cases by scene, engine, method and settings, as they first appear; in each, the coarsest step first."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in map(without_tolerance, cases):
        groups.setdefault(tuple(word(row, name) for name in _KEYS), []).append(row)
    return [sorted(rows, key=lambda row: -step(row)) for rows in groups.values()]


def is_measured(row: Row) -> bool:
    """Whether both the error and the cost of a case are known."""
    return is_ok(row) and 0 <= number(row, "error_max") < math.inf and 0 < number(row, "run_s") < math.inf
