"""How the report shows scenes and cases: several numbers of theirs in one cell."""

from __future__ import annotations

import math
from typing import Final

from pendbench.kinds.chaos.columns import threshold_name
from pendbench.kinds.chaos.rows import CaseRow, SceneRow
from pendbench.kinds.chaos.work import THRESHOLDS
from pendbench.report import columns as common
from pendbench.report.columns import Column, energy_drift, text_column, within
from pendbench.report.names import is_ok, method_name
from pendbench.report.numbers import NOTHING, number_text
from pendbench.report.sections import status_text
from pendbench.report.start import start_text

_NOT_BEFORE: Final = "not before the horizon"


def _exponent(row: SceneRow) -> str:
    return f"{number_text(row.exponent.rate)} ± {number_text(row.exponent.error, '.1g')}"


def _motion(row: SceneRow) -> str:
    return "none" if row.still else "chaotic" if row.exponent.chaotic else "regular"


def horizon_text(row: SceneRow) -> str:
    """The horizon, s, what ends it, and how it differs between the starts."""
    horizon = row.truth.horizon
    if math.isnan(horizon):
        return f"none ({row.status}: {row.reason})"
    end = ", the scene's end" if horizon >= row.scene.duration else ""
    low, high = (number_text(time) for time in (min(row.horizons), max(row.horizons)))
    return f"{number_text(horizon)}{end}" + ("" if low == high else f" ({low} to {high} over the starts)")


#: The columns of the table of scenes.
OVERVIEW: Final = (
    *common.SCENE,
    text_column("start", "start", "angles from the vertical", lambda row: start_text(row.scene)),
    common.DURATION,
    text_column("motion", "motion", "chaotic or regular", _motion),
    text_column("exponent", "Lyapunov exponent, 1/s", "with its standard error", _exponent),
    text_column("horizon", "horizon, s", "until when the truth is known", horizon_text),
    Column("lyapunov_times", "1", ".3g", "in Lyapunov times", "the horizon times the exponent",
           lambda row: row.truth.horizon * row.lyapunov),
    common.REFERENCE_ERROR.at(lambda row: row.truth.error),
)  # fmt: skip


def _time(row: CaseRow, at: int) -> str:
    """The time to one threshold: the median and the extremes over the starts, or why there is none."""
    found = row.departures[at]
    median, first, last = (number_text(time) for time in (found.median, found.first, found.last))
    if found.median_is_later:
        return _NOT_BEFORE if math.isnan(found.first) else f"{_NOT_BEFORE} [{first} ..]"
    if found.not_reached:
        return f"{median} [{first} .. {_NOT_BEFORE}]"
    return median if first == last else f"{median} [{first} .. {last}]"


def _to(at: int) -> Column:
    name = threshold_name(at)
    return text_column(f"to_{name}", f"to {name}, s", "over the starts", lambda row: _time(row, at))


def _lyapunov_times(row: CaseRow) -> str:
    """The three medians in Lyapunov times."""
    if not row.scene.exponent.chaotic:
        return "regular motion" if is_ok(row) else NOTHING
    horizon = number_text(row.scene.truth.horizon * row.scene.lyapunov)
    times = [(found.median_is_later, number_text(found.median * row.scene.lyapunov)) for found in row.departures]
    return " / ".join(f"> {horizon}" if is_later else time for is_later, time in times)


#: The columns of the tables of cases.
CASES: Final = (
    common.ENGINE,
    common.METHOD.at(lambda row: method_name(row.case)),
    common.DT,
    *map(_to, range(len(THRESHOLDS))),
    text_column("lyapunov_times", "Lyapunov times", "the three medians", _lyapunov_times),
    Column("error_half", "L", ".1e", "e to half horizon", "the largest", lambda row: row.own.error_half),
    energy_drift("own", "energy.largest")[0],
    Column("slope", "energy scale/s", ".1e", "drift per s", "of a line", lambda row: row.own.energy.slope),
    *within("own", common.GAP_MAX),
    *within("timing", common.STEP_US, common.SIMULATED),
    text_column("status", "status and flags", "how it ended", lambda row: status_text(row, 90)),
)  # fmt: skip
