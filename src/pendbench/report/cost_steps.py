"""The figure of error against step: a panel for each engine, with the slopes of the orders that its methods claim."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pendbench.report.columns import shown
from pendbench.report.cost_series import series
from pendbench.report.cost_work import ERRORS, draw_series, explain, has_failed
from pendbench.report.look import Look, name_missing
from pendbench.report.plots import GREY, bounds, logarithmic, panels
from pendbench.report.rows import Row, finite, is_ok, method_name, number, of
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def steps_figure(look: Look, scene: str, cases: Sequence[Row], orders: Sequence[Row]) -> Figure:
    """Error against step, of every case of one scene. orders: the scene's rows of that table."""
    engines = [engine for engine in look.engines if of(cases, engine=engine)]
    figure, panes = panels(len(engines), 3, 4.0, 4.8)
    figure.suptitle(f"{label(scene)}: error against step", fontsize=12)
    figure.supylabel("largest error, in lengths of the chain", fontsize=10)
    limits = bounds(finite(cases, "error_max"), *ERRORS)
    across = bounds([_place(row) for row in cases], 1e-9, 1e4)
    for engine, axes in zip(engines, panes, strict=True):
        own = of(cases, engine=engine)
        logarithmic(axes, *limits)
        logarithmic(axes, *across, "x")
        axes.set_title(label(engine), fontsize=11)
        axes.set_xlabel("step, s")
        _draw_orders(axes, own, of(orders, engine=engine))
        for rows in series(own):
            draw_series(axes, look, rows, [_place(row) for row in rows], limits)
        name_missing(axes, [row for row in own if math.isnan(_place(row)) or not (is_ok(row) or has_failed(row))])
    explain(figure, look, series(cases), extra=("order",))
    return figure


def _place(row: Row) -> float:
    """The step, or the mean of the steps that the method chose."""
    dt, steps = number(row, "dt"), number(row, "steps")
    if math.isfinite(dt):
        return dt
    return number(row, "compare_s") / steps if steps > 0 else math.nan


def _draw_orders(axes: Axes, cases: Sequence[Row], orders: Sequence[Row]) -> None:
    """For each order claimed, a line of its slope through the step at which one of its methods shows it."""
    drawn = set[float]()
    for row in orders:
        claimed, dt = number(row, "order_claimed"), number(row, "order_dt_fine")
        errors = [number(case, "error_max") for case in cases
                  if number(case, "dt") == dt and method_name(case) == method_name(row)]  # fmt: skip
        if claimed in drawn or not errors or math.isnan(number(row, "order_observed")) or not errors[0] > 0:
            continue
        drawn.add(claimed)
        _draw_slope(axes, claimed, dt, errors[0])


def _draw_slope(axes: Axes, order: float, step: float, error: float) -> None:
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    first = max(left, step * (bottom / error) ** (1 / order))
    last = min(right, step * (top / error) ** (1 / order))
    ends = [first, last]
    axes.plot(ends, [error * (x / step) ** order for x in ends], color=GREY, linewidth=0.9, linestyle="--", zorder=1.6)
    name, lowest = f"order {shown('order_claimed', order)}", (first, error * (first / step) ** order)
    below = (5, -9) if first == left else (7, 2)  # of the line, but not of the panel
    axes.annotate(name, lowest, xytext=below, textcoords="offset points", fontsize=8, color=GREY)
