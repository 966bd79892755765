"""A table of cases as it stands in a CSV file: of a baseline, or of a study's results."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendbench.base.errors import choose, printable
from pendbench.base.faults import STATUSES
from pendbench.measures.verdict import VERDICTS

if TYPE_CHECKING:
    import pandas as pd

#: What names a case.
KEYS: Final = ("scene", "engine", "method", "dt", "settings")


def read_cases(path: Path, numbers: Iterable[str]) -> pd.DataFrame:
    """The table; the columns that are named, and the step, are numbers, all others text.

    Raises ValueError where it is no such table, and OSError where it cannot be read.
    """
    import pandas as pd

    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # lines longer than the heading
        try:
            table = pd.read_csv(path, dtype=str, keep_default_na=False, index_col=False)
        except pd.errors.ParserWarning as error:
            raise ValueError(str(error)) from None
    for name in (*KEYS, "status"):
        if name not in table:
            raise ValueError(f"column {name!r} is missing")
    for name in ("dt", *numbers):
        if name in table:
            table[name] = pd.to_numeric(table[name].where(table[name] != ""))
    for status in table["status"]:
        if status not in STATUSES:
            raise ValueError(choose("status", printable(str(status)), STATUSES))
    for verdict in table.get("verdict", ()):
        if verdict not in VERDICTS:
            raise ValueError(choose("verdict", printable(str(verdict)), VERDICTS))
    return table


def is_nan(cell: Any) -> bool:
    """Whether a cell has no number: so an empty one is read."""
    return isinstance(cell, float) and math.isnan(cell)


def case_key(row: pd.Series) -> tuple[str, ...]:
    """What tells the cases of a table apart, as text."""
    dt = "" if is_nan(row["dt"]) else f"{float(row['dt']):g}"
    settings = "" if is_nan(row["settings"]) else str(row["settings"])
    return str(row["scene"]), str(row["engine"]), str(row["method"]), dt, settings


def case_text(row: pd.Series, *, with_step: bool = True) -> str:
    """A case in one line; without its step, all the steps of a method."""
    scene, engine, method, dt, settings = case_key(row)
    step = f"dt={dt}" if dt and with_step else ""
    return " ".join(part for part in (scene, engine, method, step, settings) if part)
