"""Long runs: what their energy does, in words and in a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from pendbench.kinds.cost.columns import LongRow
from pendbench.report.columns import Table
from pendbench.report.names import grouped, in_order, is_ok, scene_of
from pendbench.report.numbers import NOTHING, number_text
from pendbench.report.text import Safe, grid, markdown

#: A slope that moves the energy by less than this share of its band is none.
NO_TREND: Final = 0.1
_WIDE: Final = 0.01  # of the energy scale: who strays that far has kept little
#: Bands of two stretches of one chaotic motion differ by some factor, and mean nothing by it. This is none of those.
ALIKE: Final = 10.0

_NAMES: Final = (
    "scene", "engine", "method", "dt", "steps", "energy_drift_max", "energy_drift_band", "energy_slope_share",
    "energy_band_first_tenth", "energy_band_last_tenth",
)  # fmt: skip


def long_table(table: Table) -> Safe:
    """A row for each long run, with what its energy does."""
    rows = [row for own in grouped(table.rows, scene_of).values() for row in in_order(own)]
    columns = [table.column(name) for name in _NAMES]
    lines = [[*(markdown(column.text(row)) for column in columns), _told(row)] for row in rows]
    return grid([*(column.heading for column in columns), "its energy"], lines, range(3, len(_NAMES)))


def _told(row: LongRow) -> str:
    verdict = verdict_of(row)
    return verdict if is_ok(row) else f"**{markdown(verdict, 300)}**"


def verdict_of(row: LongRow) -> str:
    """What the energy of a long run does."""
    run = row.run
    if not is_ok(row):
        after = "" if run.steps is None else f" after {number_text(run.steps, 'd')} steps"
        return f"{run.status}{after}: {run.reason or 'no reason given'}"
    if run.energy_drift_band == 0.0:
        return "no drift: the energy does not change at all"
    if math.isnan(run.energy_slope_share):
        return NOTHING
    if run.energy_drift_max < run.energy_floor:
        return f"no drift to be told: the work is known to {number_text(run.energy_floor, '.1e')} of the energy's scale"
    return _trend(row) if run.energy_slope_share >= NO_TREND else _band(row)


def _trend(row: LongRow) -> str:
    does = "gains" if row.run.energy_drift_slope_per_s > 0 else "loses"
    return f"{does} energy, up to {number_text(row.run.energy_drift_max, '.1e')} of its scale"


def _band(row: LongRow) -> str:
    run = row.run
    if run.energy_band_last_tenth > ALIKE * run.energy_band_first_tenth:
        return "no trend, but a band that grows"
    if run.energy_band_first_tenth > ALIKE * run.energy_band_last_tenth:
        return f"leaves its energy early, by {number_text(run.energy_drift_max, '.1e')} of its scale"
    if run.energy_drift_band > _WIDE:
        return f"no trend, but a band of {number_text(run.energy_drift_band, '.1e')} of its scale"
    return "no drift"


def failed(rows: Sequence[LongRow]) -> list[LongRow]:
    """Those that did not end well."""
    return [row for row in rows if not is_ok(row)]
