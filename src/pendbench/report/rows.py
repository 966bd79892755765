"""Rows of tables as people name and count them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from pendbench.report.columns import is_missing, shown

Row = Mapping[str, Any]


def records(frame: pd.DataFrame | None) -> list[dict[str, Any]]:
    """The rows of a table; none of a table that is not there."""
    if frame is None:
        return []
    return [{str(key): value for key, value in row.items()} for row in frame.to_dict("records")]


def number(row: Row, name: str) -> float:
    """A number of a row, nan where there is none."""
    value = row.get(name)
    return math.nan if value is None or is_missing(value) or isinstance(value, str) else float(value)


def word(row: Row, name: str) -> str:
    """A text of a row, empty where there is none."""
    value = row.get(name)
    return "" if is_missing(value) else str(value)


def distinct(rows: Iterable[Row], name: str) -> list[str]:
    """The texts in one column, in the order in which they first appear."""
    return list(dict.fromkeys(word(row, name) for row in rows))


def of(rows: Iterable[Row], **wanted: str) -> list[Row]:
    """The rows that have these texts: ``of(rows, scene="double", engine="mujoco")``."""
    return [row for row in rows if all(word(row, name) == text for name, text in wanted.items())]


def finite(rows: Iterable[Row], name: str) -> list[float]:
    """The finite numbers in one column."""
    return [value for row in rows if math.isfinite(value := number(row, name))]


def is_ok(row: Row) -> bool:
    """Whether a row, or a scene, ended well."""
    return word(row, "status") in ("ok", "")


def is_noisy(row: Row) -> bool:
    """Whether the timing of a case is flagged as noise."""
    return "noisy timing" in word(row, "flags")


def stays_until(row: Row) -> float:
    """The time, s, at which the median start's error passes 1e-2, or the horizon where it does not; nan if unknown."""
    time = number(row, "t_1e-2_s")
    return number(row, "horizon_s") if math.isnan(time) and number(row, "t_1e-2_not_reached") > 0 else time


def in_order(rows: Iterable[Row]) -> list[Row]:
    """Rows by engine, method, settings and step, the coarsest step first."""

    def place(row: Row) -> tuple[str, str, str, float]:
        dt = number(row, "dt")
        return word(row, "engine"), word(row, "method"), word(row, "settings"), -math.inf if math.isnan(dt) else -dt

    return sorted(rows, key=place)


def method_name(row: Row) -> str:
    """A method with its settings: ``tuned iterations=50``."""
    return " ".join(part for part in (word(row, "method"), word(row, "settings")) if part)


def case_name(row: Row, *, with_scene: bool = True) -> str:
    """A case in a sentence: ``double: mujoco rk4, step 0.001 s``."""
    dt = number(row, "dt")
    name = f"{word(row, 'engine')} {method_name(row)}" + ("" if math.isnan(dt) else f", step {shown('dt', dt)} s")
    return f"{word(row, 'scene')}: {name}" if with_scene else name


def spanned(values: Sequence[float], name: str) -> str:
    """``2.1 to 3.4`` of the numbers of a column, or one number where they read the same."""
    low, high = shown(name, min(values)), shown(name, max(values))
    return low if low == high else f"{low} to {high}"
