"""The plots of a study of kind `cost`: error against cost and against step, and the energy of long runs.

Each has a panel for an engine, in its colour; its methods differ in shade, marker and dashes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendbench.kinds.cost.columns import LongRow
from pendbench.kinds.cost.series import Measured, Series
from pendbench.kinds.cost.study import Found
from pendbench.report.columns import Table
from pendbench.report.names import distinct, engine_of, finite, grouped, is_ok, method_name, scene_of
from pendbench.report.numbers import number_text
from pendbench.report.plots import GREY, Drawn, Picture, bounds, logarithmic, named_panels
from pendbench.report.styles import ENDED, Styles, name_missing
from pendbench.report.text import file_name, label
from pendbench.study.case import Case
from pendbench.study.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: The beginnings of the names of the plots' files.
WORK, STEPS, LONG = "work", "steps", "long"

#: What is drawn of errors: from below rounding to beyond the largest one there can be.
_ERRORS: Final = (1e-17, 10.0)
_ERROR: Final = "largest error, in lengths of the chain"
_DASHES: Final[tuple[Any, ...]] = ("-", (0, (5, 1.5)), (0, (1.5, 1.5)), (0, (6, 1.5, 1.5, 1.5)))
_CAPTIONS: Final = {
    WORK: "the largest error against the cost of a simulated second: further left is cheaper, further down is more "
    "accurate. Grey: the other engines. Black stairs: the cheapest way to each error, of all engines. Crosses along "
    "the top: steps with which the run failed, at what they would have cost.",
    STEPS: "the largest error against the step (the mean step of a method that chooses its own). Dashed grey: the "
    "orders that the methods claim. Crosses along the top: steps with which the run failed.",
    LONG: "the largest energy error so far in long runs. Flat: the method keeps the energy in a band. Rising: it "
    "drifts. Crosses: the run ended there, not well.",
}


def pictures(results: Results[Found], tables: dict[str, Table]) -> Iterator[Picture]:
    """Every plot that there is something for."""
    del results
    every = [row.series for row in tables["orders"]]
    styles, names = Styles.of_cases(series.case for series in every), set[str]()
    for scene, own in grouped(every, scene_of).items():
        if any(math.isfinite(row.run.error_max) for series in own for row in series.rows):
            yield _picture(WORK, scene, scene, names, Drawn(partial(work_figure, styles, scene, own)))
            yield _picture(STEPS, scene, scene, names, Drawn(partial(steps_figure, styles, scene, own)))
    for scene, rows in grouped(tables["long_runs"].rows, scene_of).items():
        if any(_energies(row)[0] for row in rows):
            yield _picture(LONG, scene, "", names, Drawn(partial(long_figure, scene, rows)))


def _picture(kind: str, scene: str, section: str, names: set[str], drawn: Drawn) -> Picture:
    file = file_name(f"{kind}_{scene}", names)
    names.add(file)
    return Picture(file, section, f"{scene}: {_CAPTIONS[kind]}", drawn)


def work_figure(styles: Styles, scene: str, every: Sequence[Series]) -> Figure:
    """Error against the cost of a simulated second, of every case of one scene."""
    places = {series: [_cost(row, series) for row in series.rows] for series in every}
    figure, panes, limits = _error_panels(styles, every, f"{label(scene)}: what accuracy costs")
    across = bounds([x for own in places.values() for x in own], 1e-9, 1e9)
    front = _front([(_cost(row, series), row.run.error_max) for series in every for row in series.timed])
    for engine, axes in panes.items():
        logarithmic(axes, *across, "x")
        axes.set_xlabel("ms of computing per simulated second")
        _draw_front(axes, front)
        for series, own in places.items():
            if engine_of(series) == engine:
                _draw_series(axes, styles, series, own, limits)
            else:
                axes.plot(*_points(series, own, limits), color="0.85", linewidth=1.0, zorder=1.5)
        rows = [(row, x) for series, own in places.items() if engine_of(series) == engine
                for row, x in zip(series.rows, own, strict=True)]  # fmt: skip
        name_missing(axes, [row for row, x in rows if math.isnan(x)])
    _explain(figure, every, "cheapest way to each error", color="black", linewidth=1.0)
    return figure


def steps_figure(styles: Styles, scene: str, every: Sequence[Series]) -> Figure:
    """Error against step, of every case of one scene."""
    figure, panes, limits = _error_panels(styles, every, f"{label(scene)}: error against step")
    across = bounds([_mean_step(row) for series in every for row in series.rows], 1e-9, 1e4)
    for engine, axes in panes.items():
        own = [series for series in every if engine_of(series) == engine]
        logarithmic(axes, *across, "x")
        axes.set_xlabel("step, s")
        _draw_orders(axes, own)
        for series in own:
            _draw_series(axes, styles, series, [_mean_step(row) for row in series.rows], limits)
        rows = [row for series in own for row in series.rows]
        name_missing(axes, [row for row in rows if math.isnan(_mean_step(row)) or not (is_ok(row) or _has_failed(row))])
    _explain(figure, every, "claimed order", color=GREY, linewidth=0.9, linestyle="--")
    return figure


def long_figure(scene: str, rows: Sequence[LongRow]) -> Figure:
    """The largest energy error so far in long runs. What swings through zero has no logarithm."""
    styles = Styles.of_cases(row.case for row in rows)
    steps = number_text(max((row.run.steps or 0 for row in rows), default=0), "d")
    figure, panes = _panels(
        styles.engines, f"{label(scene)}: energy over {steps} steps", "energy error so far, energy scale"
    )
    limits = bounds([y for row in rows for y in _energies(row)[1]], 1e-17, 1e2)
    for engine, axes in panes.items():
        logarithmic(axes, *limits)
        axes.set_xlabel("t, s")
        own = [row for row in rows if engine_of(row) == engine]
        drawn = [row for row in own if _energies(row)[0]]
        for place, row in enumerate(drawn):
            _draw_energies(axes, _style(styles, row.case), row, place)
        _name_methods(axes, styles, [row.case for row in drawn])
        name_missing(axes, [row for row in own if row not in drawn])
    return figure


def _draw_energies(axes: Axes, style: dict[str, Any], row: LongRow, place: int) -> None:
    """Where one curve lies upon another, their markers stand apart."""
    t, y = _energies(row)
    y = [min(value, axes.get_ylim()[1]) for value in y]
    axes.plot(t, y, **style, markevery=(7 * place, 60))
    if not is_ok(row):
        axes.plot(t[-1:], y[-1:], color=style["color"], gid=style["gid"], clip_on=False, zorder=5, **ENDED)


def _energies(row: LongRow) -> tuple[list[float], list[float]]:
    """Times and the largest energy errors so far, without what a logarithm cannot show."""
    so_far = accumulate(np.abs(row.run.energy_error).tolist(), max)
    seen = [(t, y) for t, y in zip(row.run.t.tolist(), so_far, strict=True) if 0 < y < math.inf]
    return [t for t, _ in seen], [y for _, y in seen]


def _panels(engines: Sequence[str], title: str, quantity: str) -> tuple[Figure, dict[str, Axes]]:
    """A panel for each engine."""
    return named_panels(engines, title, quantity, 2 if len(engines) in (2, 4) else 3, 4.6, 5.0)


def _error_panels(
    styles: Styles, every: Sequence[Series], title: str
) -> tuple[Figure, dict[str, Axes], tuple[float, float]]:
    """The panels of those engines that have a series, their axis of errors, and its limits."""
    figure, panes = _panels(distinct(every, engine_of), title, _ERROR)
    limits = bounds([row.run.error_max for series in every for row in series.rows], *_ERRORS)
    for engine, axes in panes.items():
        logarithmic(axes, *limits)
        _name_methods(axes, styles, [series.case for series in every if engine_of(series) == engine])
    return figure, panes, limits


def _style(styles: Styles, case: Case) -> dict[str, Any]:
    """How the line of a method is drawn."""
    place = styles.methods[case.engine].index(method_name(case))
    dashes = _DASHES[place % len(_DASHES)]
    return {"color": styles.colour(case), "marker": styles.marker(case), "linestyle": dashes, "linewidth": 1.2,
            "markersize": 5, **styles.tag(case, of_method=True)}  # fmt: skip


def _name_methods(axes: Axes, styles: Styles, cases: Sequence[Case]) -> None:
    """Name them below the panel."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **_style(styles, case)) for case in cases]
    names = [label(method_name(case), 28) for case in cases]
    if names:
        columns = 2 if max(map(len, names)) < 24 else 1
        axes.legend(handles, names, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=columns, fontsize=9,
                    frameon=False, handlelength=3.0)  # fmt: skip


def _has_failed(row: Measured) -> bool:
    """Whether a run was begun and did not end well: a refusal is no matter of the step."""
    return not is_ok(row) and row.status != "refused"


def _cost(row: Measured, series: Series) -> float:
    """Ms for a simulated second; of a run that failed, what its steps would have cost at the price of the others."""
    if row.is_timed:
        return 1e3 * row.timing.run_s / row.window.time
    prices, dt = finite(own.timing.step_us for own in series.timed), row.case.dt
    return 1e-3 * float(np.median(prices)) / dt if _has_failed(row) and prices and dt else math.nan


def _mean_step(row: Measured) -> float:
    """The step, s, or the mean of those that the method chose."""
    if row.case.dt is not None:
        return row.case.dt
    return row.window.time / row.run.steps if row.run.steps else math.nan


def _front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Those points that nothing cheaper is as accurate as."""
    front: list[tuple[float, float]] = []
    for cost, error in sorted(points):
        if error > 0 and (not front or error < front[-1][1]):
            front.append((cost, error))
    return front


def _draw_front(axes: Axes, front: Sequence[tuple[float, float]]) -> None:
    if front:
        ends = [(front[0][0], axes.get_ylim()[1]), *front, (axes.get_xlim()[1], front[-1][1])]
        axes.plot(*zip(*ends, strict=True), color="black", linewidth=1.0, zorder=1.7, drawstyle="steps-post")


def _points(series: Series, places: Sequence[float], limits: tuple[float, float]) -> tuple[list[float], list[float]]:
    """The places along the axis, and the errors there, of those cases that have both."""
    known = [(x, min(max(row.run.error_max, limits[0]), limits[1])) for x, row in zip(places, series.rows, strict=True)
             if math.isfinite(x) and math.isfinite(row.run.error_max)]  # fmt: skip
    return [x for x, _ in known], [y for _, y in known]


def _draw_series(
    axes: Axes, styles: Styles, series: Series, places: Sequence[float], limits: tuple[float, float]
) -> None:
    """The cases of a series at their places along the axis, joined by a line; those that failed along the top."""
    style, (x, y) = _style(styles, series.case), _points(series, places, limits)
    if x:
        axes.plot(x, y, **style)
    bad = [x for x, row in zip(places, series.rows, strict=True) if _has_failed(row) and math.isfinite(x)]
    if bad:
        top = [limits[1]] * len(bad)
        axes.plot(bad, top, color=style["color"], gid=style["gid"], clip_on=False, zorder=5, **ENDED)


def _draw_orders(axes: Axes, every: Sequence[Series]) -> None:
    """For each order claimed, a line of its slope through the step at which one of the methods shows it."""
    drawn = set[int]()
    for series in every:
        claimed, dt = series.order_claimed, series.fit.fine
        errors = [row.run.error_max for row in series.timed if row.case.dt == dt]
        if claimed and claimed not in drawn and math.isfinite(series.fit.order) and errors and errors[0] > 0:
            drawn.add(claimed)
            _draw_slope(axes, claimed, dt, errors[0])


def _draw_slope(axes: Axes, order: int, step: float, error: float) -> None:
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    first = max(left, step * (bottom / error) ** (1 / order))
    last = min(right, step * (top / error) ** (1 / order))
    ends = [first, last]
    axes.plot(ends, [error * (x / step) ** order for x in ends], color=GREY, linewidth=0.9, linestyle="--", zorder=1.6)
    below = (5, -9) if first == left else (7, 2)  # of the line, but not of the panel
    lowest = first, error * (first / step) ** order
    axes.annotate(f"order {order}", lowest, xytext=below, textcoords="offset points", fontsize=8, color=GREY)


def _explain(figure: Figure, every: Sequence[Series], name: str, **style: Any) -> None:
    """Below the figure, what is no method."""
    from matplotlib.lines import Line2D

    handles, names = [Line2D([], [], **style)], [name]
    if any(_has_failed(row) for series in every for row in series.rows):
        handles.append(Line2D([], [], color=GREY, **ENDED))
        names.append("failed with this step")
    figure.legend(handles, names, loc="outside lower center", ncols=2, fontsize=9, frameon=False)
