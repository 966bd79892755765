"""The plots of a study of kind `chaos`: error and energy against time, and what time on the true path costs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from pendbench.report.columns import is_missing, shown
from pendbench.report.plots import GREY, Colour, Picture, bounds, dashes, draw, hue, logarithmic, panels, shades
from pendbench.report.rows import Row, distinct, finite, is_ok, method_name, number, of, records, word
from pendbench.report.text import file_name, label
from pendbench.study.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: The name of the plot that is about all scenes.
COST: Final = "cost"

_THRESHOLDS: Final = (1e-3, 1e-2, 1e-1)
_MARKERS: Final = "osD^vPhp*"
_ENDED: Final[dict[str, Any]] = {
    "marker": "X",
    "markersize": 11,
    "markeredgecolor": "white",
    "linestyle": "none",
}
_NOT_REACHED: Final[dict[str, Any]] = {
    "marker": ">",
    "markersize": 10,
    "markerfacecolor": "none",
    "markeredgewidth": 1.5,
    "linestyle": "none",
}
_LOWEST: Final = 1e-17
_HIGHEST_ENERGY: Final = 1e2


@dataclass(frozen=True)
class Look:
    """How each engine, method and step of a study is drawn, the same in every plot."""

    engines: list[str]
    methods: dict[str, list[str]]
    steps: list[float]

    @classmethod
    def of(cls, rows: Sequence[Row]) -> Look:
        """The look of a study with these cases."""
        engines = distinct(rows, "engine")
        methods = {name: sorted({method_name(row) for row in of(rows, engine=name)}) for name in engines}
        steps = sorted({dt for row in rows if math.isfinite(dt := number(row, "dt"))}, reverse=True)
        return cls(engines, methods, steps)

    def colour(self, engine: str, method: str) -> Colour:
        """The engine's hue in the method's shade."""
        names = self.methods[engine]
        return shades(hue(self.engines.index(engine)), len(names))[names.index(method)]

    def stroke(self, row: Row) -> Any:
        """The step's dashes; methods that choose their own step are drawn through."""
        dt = number(row, "dt")
        return "-" if math.isnan(dt) else dashes(self.steps.index(dt))

    def width(self, engine: str, method: str) -> float:
        """Wider lines below, so that a line that lies upon another leaves its rim to be seen."""
        names = self.methods[engine]
        return 1.6 + 0.9 * (len(names) - 1 - names.index(method))

    def marker(self, engine: str, method: str) -> str:
        """The method's marker."""
        return _MARKERS[self.methods[engine].index(method) % len(_MARKERS)]


@dataclass(frozen=True)
class _Line:
    """A curve of one case: its row of `cases`, and what is drawn."""

    row: Row
    t: list[float]
    y: list[float]
    ended_badly: bool


def pictures(results: Results) -> Iterator[Picture]:
    """Every plot that the tables allow."""
    cases = records(results.cases)
    look = Look.of(cases)
    curves = records(results.tables.get("curves"))
    names = {COST}
    for scene in records(results.tables.get("scenes")):
        own = of(curves, scene=word(scene, "scene"))
        for column, picture_of in (("error", _error_picture), ("energy_error", _energy_picture)):
            until = number(scene, "horizon_s") if column == "error" else math.inf
            lines = _lines(own, column, records(results.tables.get("starts")), until)
            if lines:
                name = file_name(f"{column}_{word(scene, 'scene')}", names)
                names.add(name)
                yield picture_of(name, scene, look, lines)
    if cost := _cost_picture(cases, look):
        yield cost


def _lines(curves: Sequence[Row], column: str, starts: Sequence[Row], until: float) -> list[_Line]:
    """The curves in one column, one for each case, without what a logarithm cannot show.

    A run has ended badly where it says so and stopped before `until`, s.
    """
    groups: dict[tuple[object, ...], list[Row]] = {}
    for row in curves:
        groups.setdefault(_key(row), []).append(row)
    failed = {_key(row) for row in starts if number(row, "start") == 0 and not is_ok(row)}
    lines = []
    for key, rows in groups.items():
        points = [(number(row, "t_s"), abs(number(row, column))) for row in rows]
        seen = [(t, y) for t, y in points if math.isfinite(t) and 0 < y < math.inf]
        if seen:
            t, y = (list(values) for values in zip(*seen, strict=True))
            lines.append(_Line(rows[0], t, y, key in failed and not number(rows[-1], "t_s") > until))
    return lines


def _key(row: Row) -> tuple[object, ...]:
    return tuple(
        "" if is_missing(row.get(name)) else row[name] for name in ("scene", "engine", "method", "dt", "settings")
    )


def _error_picture(name: str, scene: Row, look: Look, lines: list[_Line]) -> Picture:
    shown_errors = [y for line in lines for y in line.y]
    low, high = bounds(shown_errors, _LOWEST, 10.0)

    def finish(axes: Axes) -> None:
        for threshold in _THRESHOLDS:
            axes.axhline(threshold, color="0.6", linewidth=0.8, zorder=0)
        _mark_horizon(axes, scene)

    figure = _curves(look, lines, (low, high), "e, in lengths of the chain", _title(scene, "error"), finish)
    return Picture(
        name,
        word(scene, "scene"),
        f"{word(scene, 'scene')}: the error e(t) against time, up to the horizon.",
        draw(figure),
    )


def _energy_picture(name: str, scene: Row, look: Look, lines: list[_Line]) -> Picture:
    largest = [_Line(line.row, line.t, _running_maximum(line.y), line.ended_badly) for line in lines]
    limits = bounds([y for line in largest for y in line.y], _LOWEST, _HIGHEST_ENERGY)
    figure = _curves(look, largest, limits, "energy error so far, energy scale", _title(scene, "energy error"),
                     lambda axes: _mark_horizon(axes, scene))  # fmt: skip
    return Picture(
        name,
        word(scene, "scene"),
        f"{word(scene, 'scene')}: the largest energy error so far against time.",
        draw(figure),
    )


def _running_maximum(values: Sequence[float]) -> list[float]:
    from itertools import accumulate

    return list(accumulate(values, max))


def _title(scene: Row, what: str) -> str:
    return f"{label(word(scene, 'scene'))}: {what} against time"


def _curves(
    look: Look,
    lines: list[_Line],
    limits: tuple[float, float],
    quantity: str,
    title: str,
    finish: Callable[[Axes], None],
) -> Callable[[], Figure]:
    """What makes the figure: a panel for each engine that has a curve."""
    lines = [_Line(line.row, line.t, [min(y, limits[1]) for y in line.y], line.ended_badly) for line in lines]

    def figure_of() -> Figure:
        engines = [name for name in look.engines if any(word(line.row, "engine") == name for line in lines)]
        figure, axes = panels(len(engines), 3, 4.3, 4.6)
        figure.suptitle(title, fontsize=12)
        for engine, its in zip(engines, axes, strict=True):
            _panel(its, look, engine, [line for line in lines if word(line.row, "engine") == engine])
            logarithmic(its, *limits)
            finish(its)
        figure.supylabel(quantity, fontsize=10)
        _explain_strokes(figure, look, lines)
        return figure

    return figure_of


def _panel(axes: Axes, look: Look, engine: str, lines: list[_Line]) -> None:
    from matplotlib.lines import Line2D

    axes.set_title(label(engine), fontsize=11)
    axes.set_xlabel("t, s")
    methods = [name for name in look.methods[engine] if any(method_name(line.row) == name for line in lines)]
    for line in sorted(lines, key=lambda line: look.methods[engine].index(method_name(line.row))):
        method = method_name(line.row)
        style = {"color": look.colour(engine, method), "linewidth": look.width(engine, method)}
        axes.plot(line.t, line.y, linestyle=look.stroke(line.row), **style)
        if line.ended_badly:
            axes.plot(line.t[-1:], line.y[-1:], color=style["color"], clip_on=False, zorder=5, **_ENDED)
    handles = [Line2D([], [], color=look.colour(engine, name), linewidth=3) for name in methods]
    axes.legend(handles, [label(name, 28) for name in methods], loc="upper center", bbox_to_anchor=(0.5, -0.13),
                ncols=2 if max(map(len, methods)) < 18 else 1, fontsize=9, frameon=False)  # fmt: skip


def _mark_horizon(axes: Axes, scene: Row) -> None:
    horizon = number(scene, "horizon_s")
    if not math.isfinite(horizon):
        return
    axes.axvline(horizon, color="black", linewidth=1.0)
    axes.annotate("horizon", (horizon, 0.02), xycoords=("data", "axes fraction"), xytext=(-3, 0),
                  textcoords="offset points", rotation=90, ha="right", va="bottom", fontsize=8)  # fmt: skip


def _explain_strokes(figure: Figure, look: Look, lines: list[_Line]) -> None:
    from matplotlib.lines import Line2D

    steps = [dt for dt in look.steps if any(number(line.row, "dt") == dt for line in lines)]
    handles = [Line2D([], [], color=GREY, linewidth=1.8, linestyle=dashes(look.steps.index(dt))) for dt in steps]
    names = [f"step {shown('dt', dt)} s" for dt in steps]
    if any(line.ended_badly for line in lines):
        handles.append(Line2D([], [], color=GREY, **_ENDED))
        names.append("the run ended")
    if handles:
        figure.legend(handles, names, loc="outside lower center", ncols=min(5, len(names)), fontsize=9, frameon=False,
                      handlelength=3.5)  # fmt: skip


def _cost_picture(cases: Sequence[Row], look: Look) -> Picture | None:
    priced = [row for row in cases if number(row, "simulated_s_per_s") > 0]
    if not priced:
        return None
    scenes = distinct(cases, "scene")

    def figure_of() -> Figure:
        figure, axes = panels(len(scenes), 3, 3.9, 3.5)
        figure.suptitle("what time on the true path costs", fontsize=12)
        costs = [_cost(row) for row in priced]
        for scene, its in zip(scenes, axes, strict=True):
            logarithmic(its, *bounds(costs, 1e-3, 1e12))
            _cost_panel(its, look, scene, of(cases, scene=scene))
            its.set_xlabel("time until e passes 1e-2, s")
        figure.supylabel("µs of computing per simulated second", fontsize=10)
        _explain_markers(figure, look, cases)
        return figure

    return Picture(
        COST,
        "",
        "Cost against time to divergence (e = 1e-2), a panel for each scene: right is longer, down is cheaper. A line joins "
        "the steps of one method, finer steps further up. Open arrows at the horizon (black line): the median start does "
        "not pass 1e-2 before it. Crosses: cases that did not end well, at the time they passed 1e-2 or ended.",
        draw(figure_of),
    )


def _cost(row: Row) -> float:
    return 1e6 / number(row, "simulated_s_per_s")


def _place(row: Row) -> float:
    """Where a case is on the axis of time: its time to divergence, or the horizon where it did not get there."""
    time = number(row, "t_1e-2_s")
    return number(row, "horizon_s") if math.isnan(time) and number(row, "t_1e-2_not_reached") > 0 else time


def _cost_panel(axes: Axes, look: Look, scene: str, rows: Sequence[Row]) -> None:
    axes.set_title(label(scene), fontsize=11)
    horizons = finite(rows, "horizon_s")
    if horizons:
        axes.axvline(horizons[0], color="black", linewidth=1.0, zorder=0)
    drawn = [row for row in rows if math.isfinite(_place(row)) and number(row, "simulated_s_per_s") > 0]
    for engine in look.engines:
        for method in look.methods[engine]:
            its = [row for row in of(drawn, engine=engine) if method_name(row) == method]
            _cost_line(axes, look.colour(engine, method), look.marker(engine, method), its)
    missing = [row for row in rows if row not in drawn]
    if missing:
        counts = {
            status: sum(word(row, "status") == status for row in missing) for status in distinct(missing, "status")
        }
        text = ", ".join(f"{count} {label(status) or 'without a status'}" for status, count in counts.items())
        axes.annotate(f"not drawn: {text}", (0.02, 0.02), xycoords="axes fraction", fontsize=8, color=GREY)


def _cost_line(axes: Axes, colour: Colour, marker: str, rows: Sequence[Row]) -> None:
    by_cost = sorted(rows, key=_cost)
    axes.plot([_place(row) for row in by_cost], [_cost(row) for row in by_cost], "-", color=colour, linewidth=0.8)
    for row in by_cost:
        if not is_ok(row):
            look = {**_ENDED, "zorder": 5}
        elif math.isnan(number(row, "t_1e-2_s")):
            look = _NOT_REACHED
        else:
            look = {"marker": marker, "markersize": 6, "linestyle": "none"}
        axes.plot([_place(row)], [_cost(row)], color=colour, clip_on=False, **look)


def _explain_markers(figure: Figure, look: Look, cases: Sequence[Row]) -> None:
    from matplotlib.lines import Line2D

    handles, names = [], []
    for engine in look.engines:
        for method in look.methods[engine]:
            colour, marker = look.colour(engine, method), look.marker(engine, method)
            handles.append(Line2D([], [], color=colour, marker=marker, linewidth=0.8, markersize=6))
            names.append(f"{label(engine, 20).strip()} {label(method, 24)}")
    handles += [Line2D([], [], color=GREY, **_NOT_REACHED), Line2D([], [], color=GREY, **_ENDED)]
    names += ["not before the horizon", "did not end well"]
    figure.legend(handles, names, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
