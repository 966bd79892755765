"""The plot of what time on the true path costs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from pendbench.report.look import ENDED, Look, name_missing
from pendbench.report.plots import GREY, bounds, logarithmic, panels
from pendbench.report.rows import Row, distinct, finite, is_ok, method_name, number, of, stays_until, word
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STAYED: Final[dict[str, Any]] = {
    "marker": ">", "markersize": 10, "markerfacecolor": "none", "markeredgewidth": 1.5, "linestyle": "none",
}  # fmt: skip


def is_priced(row: Row) -> bool:
    """Whether it is known what a case costs."""
    return 0 < number(row, "simulated_s_per_s") < math.inf


def cost_figure(look: Look, cases: Sequence[Row]) -> Figure:
    """A panel for each scene: the cost of a simulated second over the time to divergence."""
    scenes = distinct(cases, "scene")
    limits = bounds([_cost(row) for row in cases if is_priced(row)], 1e-3, 1e12)
    figure, axes = panels(len(scenes), 3, 3.9, 3.5)
    figure.suptitle("what time on the true path costs", fontsize=12)
    figure.supylabel("µs of computing per simulated second", fontsize=10)
    for scene, panel in zip(scenes, axes, strict=True):
        logarithmic(panel, *limits)
        panel.set_title(label(scene), fontsize=11)
        panel.set_xlabel("time until e passes 1e-2, s")
        _draw_panel(panel, look, of(cases, scene=scene))
    _explain(figure, look)
    return figure


def _cost(row: Row) -> float:
    return 1e6 / number(row, "simulated_s_per_s")


def _stayed(row: Row) -> bool:
    return math.isnan(number(row, "t_1e-2_s")) and number(row, "t_1e-2_not_reached") > 0


def _draw_panel(axes: Axes, look: Look, rows: Sequence[Row]) -> None:
    for horizon in finite(rows, "horizon_s")[:1]:
        axes.axvline(horizon, color="black", linewidth=1.0, zorder=0)
    drawn = [row for row in rows if math.isfinite(stays_until(row)) and is_priced(row)]
    for engine in look.engines:
        for method in look.methods[engine]:
            own = [row for row in of(drawn, engine=engine) if method_name(row) == method]
            _draw_method(axes, look, sorted(own, key=_cost))
    name_missing(axes, [row for row in rows if row not in drawn])


def _draw_method(axes: Axes, look: Look, rows: Sequence[Row]) -> None:
    """The cases of one method, cheapest first, joined by a line."""
    if not rows:
        return
    engine, method = word(rows[0], "engine"), method_name(rows[0])
    colour = look.colour(engine, method)
    axes.plot([stays_until(row) for row in rows], [_cost(row) for row in rows], color=colour, linewidth=0.8)
    for row in rows:
        marker: dict[str, Any] = {"marker": look.marker(engine, method), "markersize": 6, "linestyle": "none"}
        if _stayed(row):
            marker = _STAYED
        if not is_ok(row):
            marker = {**ENDED, "zorder": 5}
        axes.plot([stays_until(row)], [_cost(row)], color=colour, clip_on=False, **marker)


def _explain(figure: Figure, look: Look) -> None:
    from matplotlib.lines import Line2D

    methods = [(engine, method) for engine in look.engines for method in look.methods[engine]]
    handles = [
        Line2D([], [], color=look.colour(*both), marker=look.marker(*both), linewidth=0.8, markersize=6)
        for both in methods
    ]
    names = [f"{label(engine, 20)} {label(method, 24)}" for engine, method in methods]
    handles += [Line2D([], [], color=GREY, **_STAYED), Line2D([], [], color=GREY, **ENDED)]
    names += ["not before the horizon", "did not end well"]
    figure.legend(handles, names, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
