"""Figures of curves against time: a panel for each engine, a shade for each method, a stroke for each step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pendbench.report.columns import is_missing, shown
from pendbench.report.look import ENDED, Look, name_missing
from pendbench.report.plots import GREY, logarithmic, panels
from pendbench.report.rows import Row, is_ok, method_name, number, of, word
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CASE = ("scene", "engine", "method", "dt", "settings")


@dataclass(frozen=True)
class Curve:
    """What is drawn of one case: the first of its rows in `curves`, times (s), values, and whether it ended badly."""

    row: Row
    t: list[float]
    y: list[float]
    ended_badly: bool


@dataclass(frozen=True)
class Frame:
    """What a figure shows beside its curves.

    cases: every case that it is about, with a curve or without. limits: of the quantity. lines: faint ones across.
    horizon: s, or nan.
    """

    title: str
    quantity: str
    cases: Sequence[Row]
    limits: tuple[float, float]
    lines: Sequence[float] = ()
    horizon: float = math.nan


def curves_of(rows: Sequence[Row], column: str, starts: Sequence[Row], until: float = math.inf) -> list[Curve]:
    """The curves in one column, one for each case, without what a logarithm cannot show.

    starts: the rows that say how the runs ended. A run ended badly where it says so and stopped before `until`, s.
    """
    groups: dict[tuple[object, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(_key(row), []).append(row)
    failed = {_key(row) for row in starts if number(row, "start") == 0 and not is_ok(row)}
    curves = []
    for key, own in groups.items():
        points = [(number(row, "t_s"), abs(number(row, column))) for row in own]
        seen = [(t, y) for t, y in points if math.isfinite(t) and 0 < y < math.inf]
        ended = key in failed and number(own[-1], "t_s") <= until
        if seen:
            curves.append(Curve(own[0], [t for t, _ in seen], [y for _, y in seen], ended))
    return curves


def _key(row: Row) -> tuple[object, ...]:
    return tuple("" if is_missing(row.get(name)) else row[name] for name in _CASE)


def curves_figure(look: Look, curves: Sequence[Curve], frame: Frame) -> Figure:
    """A panel for each engine that has a case, and in it the curves there are."""
    engines = [name for name in look.engines if of(frame.cases, engine=name)]
    figure, axes = panels(len(engines), 3, 4.3, 4.6)
    figure.suptitle(frame.title, fontsize=12)
    figure.supylabel(frame.quantity, fontsize=10)
    for engine, panel in zip(engines, axes, strict=True):
        _draw_panel(panel, look, engine, [curve for curve in curves if word(curve.row, "engine") == engine], frame)
    _explain_strokes(figure, look, curves)
    return figure


def _draw_panel(axes: Axes, look: Look, engine: str, curves: Sequence[Curve], frame: Frame) -> None:
    logarithmic(axes, *frame.limits)
    axes.set_title(label(engine), fontsize=11)
    axes.set_xlabel("t, s")
    for height in frame.lines:
        axes.axhline(height, color="0.6", linewidth=0.8, zorder=0)
    _mark_horizon(axes, frame.horizon)
    present = {method_name(curve.row) for curve in curves}
    methods = [name for name in look.methods[engine] if name in present]
    for curve in sorted(curves, key=lambda curve: methods.index(method_name(curve.row))):
        _draw_curve(axes, look, replace(curve, y=[min(y, frame.limits[1]) for y in curve.y]))
    if methods:
        _name_methods(axes, look, engine, methods)
    drawn = {_key(curve.row) for curve in curves}
    name_missing(axes, [row for row in of(frame.cases, engine=engine) if _key(row) not in drawn])


def _draw_curve(axes: Axes, look: Look, curve: Curve) -> None:
    style = look.line(curve.row)
    axes.plot(curve.t, curve.y, **style)
    if curve.ended_badly:
        axes.plot(curve.t[-1:], curve.y[-1:], color=style["color"], clip_on=False, zorder=5, **ENDED)


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


def _name_methods(axes: Axes, look: Look, engine: str, methods: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=look.colour(engine, name), linewidth=3) for name in methods]
    names = [label(name, 28) for name in methods]
    columns = 2 if max(map(len, names)) < 18 else 1
    axes.legend(
        handles, names, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=columns, fontsize=9, frameon=False
    )


def _explain_strokes(figure: Figure, look: Look, curves: Sequence[Curve]) -> None:
    from matplotlib.lines import Line2D

    present = {number(curve.row, "dt") for curve in curves}
    steps = [dt for dt in look.steps if dt in present]
    handles = [Line2D([], [], color=GREY, linewidth=1.8, linestyle=look.stroke(dt)) for dt in steps]
    names = [f"step {shown('dt', dt)} s" for dt in steps]
    if any(curve.ended_badly for curve in curves):
        handles.append(Line2D([], [], color=GREY, **ENDED))
        names.append("the run ended")
    if handles:
        figure.legend(
            handles, names, loc="outside lower center", ncols=min(5, len(names)), fontsize=9, frameon=False,
            handlelength=3.5,
        )  # fmt: skip
