"""The plots of a study of kind `chaos`: error and energy against time, and what time on the true path costs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate
from typing import Final

from pendbench.report.chaos_cost import cost_figure, is_priced
from pendbench.report.curves import Curve, Frame, curves_figure, curves_of
from pendbench.report.look import Look
from pendbench.report.plots import Picture, bounds, draw
from pendbench.report.rows import Row, number, of, records, word
from pendbench.report.text import file_name, label
from pendbench.study.results import Results

#: The name of the plot that is about all scenes.
COST: Final = "cost"

_THRESHOLDS: Final = (1e-3, 1e-2, 1e-1)
_LOWEST: Final = 1e-17  # below rounding
_HIGHEST_ERROR: Final = 10.0
_HIGHEST_ENERGY: Final = 1e2
_CAPTIONS: Final = {
    "error": "the error e(t) against time, up to the horizon.",
    "energy": "the largest energy error so far against time.",
    COST: "Cost against time to divergence (e = 1e-2), a panel for each scene: right is longer, down is cheaper. A "
    "line joins the steps of one method, finer steps further up. Open arrows at the horizon (black line): the median "
    "start does not pass 1e-2 before it. Crosses: cases that did not end well, at the time they passed 1e-2 or ended.",
}


def pictures(results: Results) -> Iterator[Picture]:
    """Every plot that the tables allow."""
    cases, starts = records(results.cases), records(results.tables.get("starts"))
    curves = records(results.tables.get("curves"))
    look = Look.of_cases(cases)
    names = {COST}
    for scene in records(results.tables.get("scenes")):
        name = word(scene, "scene")
        its = _Scene(scene, of(cases, scene=name), of(curves, scene=name), starts)
        for kind, frame, drawn in (_errors(its), _energies(its)):
            if drawn:
                file = file_name(f"{kind}_{name}", names)
                names.add(file)
                yield Picture(
                    file, name, f"{name}: {_CAPTIONS[kind]}", draw(partial(curves_figure, look, drawn, frame))
                )
    if any(is_priced(row) for row in cases):
        yield Picture(COST, "", _CAPTIONS[COST], draw(partial(cost_figure, look, cases)))


@dataclass(frozen=True)
class _Scene:
    """One scene: its row of `scenes`, and its rows of `cases`, of `curves` and (among others') of `starts`."""

    row: Row
    cases: Sequence[Row]
    curves: Sequence[Row]
    starts: Sequence[Row]


def _errors(scene: _Scene) -> tuple[str, Frame, list[Curve]]:
    horizon = number(scene.row, "horizon_s")
    curves = curves_of(scene.curves, "error", scene.starts, math.inf if math.isnan(horizon) else horizon)
    limits = bounds([y for curve in curves for y in curve.y], _LOWEST, _HIGHEST_ERROR)
    title = f"{label(word(scene.row, 'scene'))}: error against time"
    return "error", Frame(title, "e, in lengths of the chain", scene.cases, limits, _THRESHOLDS, horizon), curves


def _energies(scene: _Scene) -> tuple[str, Frame, list[Curve]]:
    """The largest energy error so far: what swings through zero has no logarithm that can be read."""
    found = curves_of(scene.curves, "energy_error", scene.starts)
    curves = [replace(curve, y=list(accumulate(curve.y, max))) for curve in found]
    limits = bounds([y for curve in curves for y in curve.y], _LOWEST, _HIGHEST_ENERGY)
    title, horizon = f"{label(word(scene.row, 'scene'))}: energy error against time", number(scene.row, "horizon_s")
    return "energy", Frame(title, "energy error so far, energy scale", scene.cases, limits, (), horizon), curves
