"""Between which values a number of a case may have been: by what its rows say of it, and by repeated runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from pendbench.study.changes import Range
from pendbench.study.timing import SPREAD_LIMIT

if TYPE_CHECKING:
    import pandas as pd

#: How well numbers are known: what is below is not told from 0.
_KNOWN_TO: Final = {
    "error_half": "reference_error_half",
    "error_max": "reference_error",
    "energy_drift_half": "energy_floor",
    "energy_drift_max": "energy_floor",
    "balance_error": "balance_floor",
}
_SPREAD: Final = "step_spread"
#: The time to 1e-2 and what a row says of it: over the starts, in Lyapunov times, between samples.
_FIRST: Final = ("t_1e-2_min_s", "t_1e-2_max_s", "t_1e-2_lyapunov", "t_1e-2_band_s")
#: The columns that say so.
SAYING: Final = (*_KNOWN_TO.values(), _SPREAD, *_FIRST)


def _of(row: pd.Series, name: str) -> float:
    return float(row[name]) if name in row else math.nan


def _joined(ranges: Sequence[Range]) -> Range:
    """All of the ranges together; not known where none is."""
    known = [each for each in ranges if not math.isnan(each.low)]
    if not known:
        return Range(math.nan, math.nan)
    return Range(min(each.low for each in known), max(each.high for each in known))


def error_range(name: str, rows: Sequence[pd.Series]) -> Range:
    """Between which values a number was that is the same in every run, but for how well it is known."""
    return _joined([_known(_of(row, name), _of(row, _KNOWN_TO.get(name, ""))) for row in rows])


def _known(value: float, floor: float) -> Range:
    return Range(0.0, floor) if value < floor else Range(value, value)


def first_pass(name: str, rows: Sequence[pd.Series]) -> Range:
    """When the error passed 1e-2, s: over the starts, and a Lyapunov time more to either side, in which rounding grows
    threefold. Infinite where it never does.
    """
    return _joined([_first_pass(row, name) for row in rows])


def _first_pass(row: pd.Series, name: str) -> Range:
    median, (low, high, lyapunov, band) = _of(row, name), (_of(row, each) for each in _FIRST)
    slack = max(0.0 if math.isnan(each) else each for each in (median / lyapunov if lyapunov else math.nan, band))
    return Range(*(math.inf if math.isnan(each) else each + side for each, side in ((low, -slack), (high, slack))))


def time_range(name: str, rows: Sequence[pd.Series]) -> Range | str:
    """Between which values a cost was: by the spread of its samples, and over repeated runs; or why nobody knows.

    Runs whose timing is noisy count only where none is calm, and then as noise. "": none was timed.
    """
    timed = [row for row in rows if not math.isnan(_of(row, name))]
    if not timed:
        return ""
    calm = [row for row in timed if not _of(row, _SPREAD) > SPREAD_LIMIT]
    if not calm:
        return f"noisy timing: spread {min(_of(row, _SPREAD) for row in timed):.0%}"
    if len(calm) == 1 and math.isnan(_of(calm[0], _SPREAD)):
        return "one run, and no spread"
    return _joined([_sampled(_of(row, name), _of(row, _SPREAD)) for row in calm])


def _sampled(value: float, spread: float) -> Range:
    wide = 0.0 if math.isnan(spread) else spread * value
    return Range(value - wide, value + wide)
