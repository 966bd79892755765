"""The figure of error against time: what each method gives for its cost, and the cheapest way to each error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendbench.report.cost_series import is_measured, series
from pendbench.report.look import ENDED, Look, name_missing
from pendbench.report.plots import GREY, bounds, logarithmic, panels
from pendbench.report.rows import Row, finite, is_ok, method_name, number, word
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: What is drawn of errors: from below rounding to beyond the largest one there can be.
ERRORS: Final = (1e-17, 10.0)


def work_figure(look: Look, scene: str, cases: Sequence[Row]) -> Figure:
    """Error against the cost of a simulated second, of every case of one scene."""
    figure, (axes,) = panels(1, 1, 9.0, 7.2)
    figure.suptitle(f"{label(scene)}: what accuracy costs", fontsize=12)
    figure.supylabel("largest error, in lengths of the chain", fontsize=10)
    axes.set_xlabel("ms of computing per simulated second")
    groups = series(cases)
    costs = {id(row): _cost(row, rows) for rows in groups for row in rows}
    limits = bounds(finite(cases, "error_max"), *ERRORS)
    logarithmic(axes, *limits)
    logarithmic(axes, *bounds(list(costs.values()), 1e-9, 1e9), "x")
    _draw_front(axes, [(costs[id(row)], _error(row)) for rows in groups for row in rows if is_measured(row)], limits[1])
    for rows in groups:
        draw_series(axes, look, rows, [costs[id(row)] for row in rows], limits)
    name_missing(axes, [row for rows in groups for row in rows if math.isnan(costs[id(row)])])
    explain(figure, look, groups, extra=("cheapest",))
    return figure


def has_failed(row: Row) -> bool:
    """Whether a run was begun and did not end well: a refusal is no matter of the step."""
    return not is_ok(row) and word(row, "status") != "refused"


def _error(row: Row) -> float:
    return number(row, "error_max")


def _cost(row: Row, its_series: Sequence[Row]) -> float:
    """Ms for a simulated second; of a run that failed, what its steps would have cost at the price of the others."""
    if is_measured(row):
        return 1e3 * number(row, "run_s") / number(row, "compare_s")
    prices, dt = finite(filter(is_measured, its_series), "step_us"), number(row, "dt")
    known = has_failed(row) and prices and math.isfinite(dt)
    return 1e-3 * float(np.median(prices)) / dt if known else math.nan


def _draw_front(axes: Axes, points: Sequence[tuple[float, float]], top: float) -> None:
    """Stairs along the points that nothing cheaper is as accurate as."""
    front: list[tuple[float, float]] = []
    for cost, error in sorted(points):
        if error > 0 and (not front or error < front[-1][1]):
            front.append((cost, error))
    if front:
        ends = [(front[0][0], top), *front, (axes.get_xlim()[1], front[-1][1])]
        style: dict[str, Any] = {"color": "black", "linewidth": 1.0, "zorder": 1.7, "drawstyle": "steps-post"}
        axes.plot(*zip(*ends, strict=True), **style)


def draw_series(
    axes: Axes, look: Look, rows: Sequence[Row], places: Sequence[float], limits: tuple[float, float]
) -> None:
    """The cases of a series at their places along the axis, joined by a line; those that failed along the top."""
    engine, method = word(rows[0], "engine"), method_name(rows[0])
    colour = look.colour(engine, method)
    good = [(x, min(max(_error(row), limits[0]), limits[1])) for x, row in zip(places, rows, strict=True)
            if is_ok(row) and math.isfinite(x) and math.isfinite(_error(row))]  # fmt: skip
    if good:
        marker = look.marker(engine, method)
        axes.plot(*zip(*good, strict=True), color=colour, linewidth=1.0, marker=marker, markersize=5)
    bad = [x for x, row in zip(places, rows, strict=True) if has_failed(row) and math.isfinite(x)]
    if bad:
        axes.plot(bad, [limits[1]] * len(bad), color=colour, clip_on=False, zorder=5, **ENDED)


def explain(figure: Figure, look: Look, groups: Sequence[Sequence[Row]], extra: Sequence[str] = ()) -> None:
    """The legend below a figure: its methods, and what the other strokes mean."""
    from matplotlib.lines import Line2D

    methods = sorted({(word(rows[0], "engine"), method_name(rows[0])) for rows in groups})
    handles = [Line2D([], [], color=look.colour(*both), marker=look.marker(*both), linewidth=1.0, markersize=5)
               for both in methods]  # fmt: skip
    names = [f"{label(engine, 20)} {label(method, 24)}" for engine, method in methods]
    if "cheapest" in extra:
        handles.append(Line2D([], [], color="black", linewidth=1.0))
        names.append("cheapest way to each error")
    if "order" in extra:
        handles.append(Line2D([], [], color=GREY, linewidth=0.9, linestyle="--"))
        names.append("claimed order")
    if any(has_failed(row) for rows in groups for row in rows):
        handles.append(Line2D([], [], color=GREY, **ENDED))
        names.append("failed with this step")
    figure.legend(handles, names, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
