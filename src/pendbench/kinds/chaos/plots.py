"""The pictures of a study of kind `chaos`: error and energy against time, and what staying with the truth costs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Final

from pendbench.kinds.chaos.rows import CaseRow, CurveRow, SceneRow
from pendbench.kinds.chaos.work import THRESHOLDS
from pendbench.report.curves import Canvas, Curve, drawable
from pendbench.report.names import distinct, grouped, is_ok, pair_name, pair_of, scene_of
from pendbench.report.plots import GREY, bounds, logarithmic, named_panels
from pendbench.report.styles import ENDED, Styles, name_missing
from pendbench.report.text import label
from pendbench.study.case import Case

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOWEST: Final = 1e-17  # below rounding
_HIGHEST_ERROR: Final = 10.0
_HIGHEST_ENERGY: Final = 1e2
_ENTRY_WIDTH, _ENTRY_HEIGHT = 2.0, 0.2  # inches, of a legend's entry
_STAYED: Final[dict[str, Any]] = {
    "marker": ">", "markersize": 10, "markerfacecolor": "none", "markeredgewidth": 1.5, "linestyle": "none",
}  # fmt: skip


def error_curves(scene: SceneRow, cases: Sequence[CaseRow], curves: Sequence[CurveRow]) -> tuple[Canvas, list[Curve]]:
    """The error of each case against time, up to the horizon."""
    horizon = scene.truth.horizon
    found = _curves(cases, curves, lambda row: row.error, math.inf if math.isnan(horizon) else horizon)
    limits = bounds([y for curve in found for y in curve.y], _LOWEST, _HIGHEST_ERROR)
    title = f"{label(scene.scene.name)}: error against time"
    return Canvas(title, "e, in lengths of the chain", cases, limits, THRESHOLDS, horizon), found


def energy_curves(scene: SceneRow, cases: Sequence[CaseRow], curves: Sequence[CurveRow]) -> tuple[Canvas, list[Curve]]:
    """The largest energy error so far: what swings through zero has no logarithm that can be read."""
    found = _curves(cases, curves, lambda row: row.energy_error, math.inf)
    found = [replace(curve, y=list(accumulate(curve.y, max))) for curve in found]
    limits = bounds([y for curve in found for y in curve.y], _LOWEST, _HIGHEST_ENERGY)
    title = f"{label(scene.scene.name)}: energy error against time"
    return Canvas(title, "energy error so far, energy scale", cases, limits, (), scene.truth.horizon), found


def _curves(
    cases: Sequence[CaseRow], rows: Sequence[CurveRow], value: Callable[[CurveRow], float], until: float
) -> list[Curve]:
    """A curve for each case that has one. It is crossed at its end where it ended badly, before `until` (s)."""
    failed = {row.case for row in cases if not is_ok(row.own)}
    made = []
    for case, own in grouped(rows, lambda row: row.case).items():
        ended = case in failed and own[-1].t_s <= until
        made.append(drawable(case, [row.t_s for row in own], [value(row) for row in own], ended_badly=ended))
    return [curve for curve in made if curve.t]


@dataclass(frozen=True)
class Gain:
    """What a case has for its cost: the horizontal axis of a picture of costs."""

    title: str
    name: str
    of: Callable[[CaseRow], float]
    errors: bool = False

    def is_drawn(self, row: CaseRow) -> bool:
        """Whether both the cost and what there is for it are known."""
        return math.isfinite(self.of(row)) and math.isfinite(row.cost_ms) and (self.of(row) > 0 or not self.errors)


TIME: Final = Gain("what time on the true path costs", "time until e passes 1e-2, s", lambda row: row.stays_until)
ERROR: Final = Gain("what a small error costs", "largest e up to half of the horizon", lambda row: row.own.error_half,
                    errors=True)  # fmt: skip


def cost_figure(styles: Styles, cases: Sequence[CaseRow], gain: Gain) -> Figure:
    """A panel for each scene: the cost of a simulated second over what there is for it."""
    drawn = list(filter(gain.is_drawn, cases))
    figure, axes = named_panels(distinct(cases, scene_of), gain.title, "ms per simulated second", 3, 3.9, 3.5)
    for scene, panel in axes.items():
        logarithmic(panel, *bounds([row.cost_ms for row in drawn], 1e-6, 1e9))
        if gain.errors:
            logarithmic(panel, *bounds([gain.of(row) for row in drawn], _LOWEST, _HIGHEST_ERROR), "x")
        panel.set_xlabel(gain.name)
        _draw_panel(panel, styles, [row for row in cases if scene_of(row) == scene], gain)
    _explain(figure, styles, drawn, gain)
    return figure


def _draw_panel(axes: Axes, styles: Styles, rows: Sequence[CaseRow], gain: Gain) -> None:
    horizon = rows[0].scene.truth.horizon
    if not gain.errors and math.isfinite(horizon):
        axes.axvline(horizon, color="black", linewidth=1.0, zorder=0)
    drawn = list(filter(gain.is_drawn, rows))
    for own in grouped(drawn, pair_of).values():
        _draw_method(axes, styles, sorted(own, key=lambda row: row.cost_ms), gain)
    name_missing(axes, [row for row in rows if row not in drawn])


def _draw_method(axes: Axes, styles: Styles, rows: Sequence[CaseRow], gain: Gain) -> None:
    """The cases of one method, cheapest first, joined by a line."""
    places, costs = [gain.of(row) for row in rows], [row.cost_ms for row in rows]
    case = rows[0].case
    axes.plot(places, costs, color=styles.colour(case), linewidth=0.8, **styles.tag(case, of_method=True))
    for row, place, cost in zip(rows, places, costs, strict=True):
        mark = {"markersize": 6, **styles.mark(row.case)}
        if not is_ok(row):
            mark |= {**ENDED, "zorder": 5}
        elif not gain.errors and row.left.median_is_later:
            mark |= _STAYED
        axes.plot([place], [cost], clip_on=False, **mark)


def _explain(figure: Figure, styles: Styles, rows: Sequence[CaseRow], gain: Gain) -> None:
    from matplotlib.lines import Line2D

    methods: dict[str, Case] = {pair_name(row.case): row.case for row in rows}
    handles = [Line2D([], [], **{**styles.mark(case), "linestyle": "-", "linewidth": 0.8}) for case in methods.values()]
    names = [label(name, 44) for name in methods]
    if not gain.errors and any(row.left.median_is_later for row in rows):
        handles.append(Line2D([], [], color=GREY, **_STAYED))
        names.append("not before the horizon")
    if not all(map(is_ok, rows)):
        handles.append(Line2D([], [], color=GREY, **ENDED))
        names.append("did not end well")
    columns = max(1, int(figure.get_figwidth() / _ENTRY_WIDTH))
    figure.set_figheight(figure.get_figheight() + _ENTRY_HEIGHT * math.ceil(len(names) / columns))
    figure.legend(handles, names, loc="outside lower center", ncols=columns, fontsize=9, frameon=False)
