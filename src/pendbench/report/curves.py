"""Figures of curves against time: a panel for each engine, a shade for each method, a stroke for each step."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pendbench.report.names import CaseRow, engine_of, method_name
from pendbench.report.numbers import number_text
from pendbench.report.plots import GREY, logarithmic, named_panels
from pendbench.report.styles import ENDED, Styles, name_missing
from pendbench.report.text import label
from pendbench.study.case import Case

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Curve:
    """What is drawn of one case: times (s), values, and whether it ended badly within what is drawn."""

    case: Case
    t: Sequence[float]
    y: Sequence[float]
    ended_badly: bool = False


@dataclass(frozen=True)
class Canvas:
    """What a figure shows beside its curves.

    rows: of every case that it is about, with a curve or without. limits: of the quantity. lines: faint ones across.
    horizon: s, or nan.
    """

    title: str
    quantity: str
    rows: Sequence[CaseRow]
    limits: tuple[float, float]
    lines: Sequence[float] = ()
    horizon: float = math.nan


def drawable(case: Case, t: Iterable[float], y: Iterable[float], *, ended_badly: bool = False) -> Curve:
    """The curve of a case without what a logarithm cannot show."""
    seen = [(time, abs(value)) for time, value in zip(t, y, strict=True) if 0 < abs(value) < math.inf]
    return Curve(case, [time for time, _ in seen], [value for _, value in seen], ended_badly)


def curves_figure(styles: Styles, curves: Sequence[Curve], canvas: Canvas) -> Figure:
    """A panel for each engine that has a case, and in it the curves there are."""
    drawn = set(map(engine_of, canvas.rows))
    engines = [name for name in styles.engines if name in drawn]
    figure, axes = named_panels(engines, canvas.title, canvas.quantity, 3, 4.3, 4.6)
    for engine, panel in axes.items():
        _draw_panel(panel, styles, engine, [curve for curve in curves if curve.case.engine == engine], canvas)
    _explain_strokes(figure, styles, curves)
    return figure


def _draw_panel(axes: Axes, styles: Styles, engine: str, curves: Sequence[Curve], canvas: Canvas) -> None:
    logarithmic(axes, *canvas.limits)
    axes.set_xlabel("t, s")
    for height in canvas.lines:
        axes.axhline(height, color="0.6", linewidth=0.8, zorder=0)
    _mark_horizon(axes, canvas.horizon)
    present = {method_name(curve.case) for curve in curves}
    methods = [name for name in styles.methods[engine] if name in present]
    for curve in sorted(curves, key=lambda curve: methods.index(method_name(curve.case))):
        _draw_curve(axes, styles, replace(curve, y=[min(y, canvas.limits[1]) for y in curve.y]))
    if methods:
        _name_methods(axes, styles, [curve.case for curve in curves], methods)
    drawn = {curve.case for curve in curves}
    name_missing(axes, [row for row in canvas.rows if row.case.engine == engine and row.case not in drawn])


def _draw_curve(axes: Axes, styles: Styles, curve: Curve) -> None:
    style = styles.line(curve.case)
    axes.plot(curve.t, curve.y, **style)
    if curve.ended_badly:
        end = {"color": style["color"], "gid": style["gid"], "clip_on": False, "zorder": 5, **ENDED}
        axes.plot(curve.t[-1:], curve.y[-1:], **end)


def _mark_horizon(axes: Axes, horizon: float) -> None:
    if math.isnan(horizon):
        return
    axes.axvline(horizon, color="black", linewidth=1.0)
    axes.annotate(
        "horizon",
        (horizon, 0.02),
        xycoords=("data", "axes fraction"),
        xytext=(-3, 0),
        textcoords="offset points",
        rotation=90,
        ha="right",
        va="bottom",
        fontsize=8,
    )


def _name_methods(axes: Axes, styles: Styles, cases: Sequence[Case], methods: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    its = {method_name(case): case for case in cases}
    handles = [Line2D([], [], color=styles.colour(its[name]), linewidth=3) for name in methods]
    names = [label(name, 28) for name in methods]
    columns = 2 if max(map(len, names)) < 18 else 1
    axes.legend(
        handles, names, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=columns, fontsize=9, frameon=False
    )


def _explain_strokes(figure: Figure, styles: Styles, curves: Sequence[Curve]) -> None:
    from matplotlib.lines import Line2D

    present = {curve.case.dt for curve in curves}
    steps = [dt for dt in styles.steps if dt in present]
    handles = [Line2D([], [], color=GREY, linewidth=1.8, linestyle=styles.stroke(dt)) for dt in steps]
    names = [f"step {number_text(dt)} s" for dt in steps]
    if any(curve.ended_badly for curve in curves):
        handles.append(Line2D([], [], color=GREY, **ENDED))
        names.append("the run ended")
    if handles:
        figure.legend(
            handles, names, loc="outside lower center", ncols=min(5, len(names)), fontsize=9, frameon=False,
            handlelength=3.5,
        )  # fmt: skip
