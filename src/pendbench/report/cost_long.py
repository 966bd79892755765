"""Long runs: what drifts, in words and in a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from pendbench.report import sections
from pendbench.report.columns import NOTHING, number_text, shown
from pendbench.report.rows import Row, distinct, in_order, is_ok, number, of, word
from pendbench.report.text import markdown, table

#: A slope that moves the energy by less than this share of its band is none.
_NO_TREND: Final = 0.1
_WIDE: Final = 0.01  # of the energy scale: who strays that far has kept little
#: Bands of two stretches of one motion differ by up to this factor, and mean nothing by it.
_ALIKE: Final = 2.0

READING: Final = """\
A method that keeps the energy has a band and no slope: what its slope moves the energy by in the whole run is a small
share of the band (below 0.1), and its last tenth has about the band of its first. "No drift" says that both hold, the
second to a factor of 2 either way. A band that is much narrower at the end than at the beginning is no good sign: the
energy has gone somewhere else first."""

_NAMES: Final = (
    "scene", "engine", "method", "dt", "steps", "energy_drift_max", "energy_drift_band", "energy_slope_share",
    "energy_band_first_tenth", "energy_band_last_tenth",
)  # fmt: skip


def long_runs(rows: Sequence[Row]) -> str:
    """A row for each long run, with the verdict."""
    by_scene = [row for scene in distinct(rows, "scene") for row in in_order(of(rows, scene=scene))]
    numbers = range(3, len(_NAMES))
    headings = [*(sections.heading(name) for name in _NAMES), "verdict"]
    lines = [[*(sections.cell(row, name) for name in _NAMES), _told(row)] for row in by_scene]
    return table(headings, lines, numbers)


def _told(row: Row) -> str:
    verdict = verdict_of(row)
    return f"**{markdown(verdict, 300)}**" if not is_ok(row) else markdown(verdict)


def verdict_of(row: Row) -> str:
    """What the energy of a long run does."""
    if not is_ok(row):
        after = "" if math.isnan(number(row, "steps")) else f" after {shown('steps', row['steps'])} steps"
        return f"{word(row, 'status')}{after}: {word(row, 'reason') or 'no reason given'}"
    if number(row, "energy_drift_max") > 1.0:
        times = shown("energy_drift_max", row["energy_drift_max"])
        return f"blows up: its energy goes {times} times its scale astray, and the run says nothing of it"
    if number(row, "energy_drift_band") == 0.0:
        return "no drift: the energy does not change at all"
    share, first = number(row, "energy_slope_share"), number(row, "energy_band_first_tenth")
    if math.isnan(share):
        return NOTHING
    grows = number(row, "energy_band_last_tenth") / first if first > 0 else math.inf
    return _trend(row, grows) if share >= _NO_TREND else _band(row, grows)


def _trend(row: Row, grows: float) -> str:
    """What a slope does. grows: how many times as wide the last tenth's band is as the first's."""
    slope = number(row, "energy_drift_slope_per_s")
    does = "gains" if slope > 0 else "loses"
    if grows < 1 / _ALIKE:
        return f"{does} energy, {shown('energy_drift_max', row.get('energy_drift_max'))} of its scale, most of it early"
    seconds = number(row, "steps") * number(row, "dt")
    told = f"{does} {number_text(seconds * abs(slope), '.1e')} of the energy scale in {number_text(seconds)} s"
    return f"{told}, and its band grows {number_text(grows, '.2g')}-fold" if grows > _ALIKE else f"{told}, steadily"


def _band(row: Row, grows: float) -> str:
    if grows > _ALIKE:
        return f"no trend, but a band that grows {number_text(grows, '.2g')}-fold"
    if grows < 1 / _ALIKE:
        return f"leaves its energy by {shown('energy_drift_max', row.get('energy_drift_max'))} early, and stays there"
    if (band := number(row, "energy_drift_band")) > _WIDE:
        return f"no trend, but a band of {number_text(band, '.1e')} of the energy scale"
    return "no drift"
