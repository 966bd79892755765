"""The pictures of a study of kind `stability`: the map of verdicts, and how the largest stable step falls with n."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from pendbench.kinds.stability.columns import STABLE_DT, StepRow
from pendbench.measures.verdict import VERDICTS, is_known
from pendbench.report.names import distinct, grouped, pair_of, scene_of
from pendbench.report.numbers import number_text
from pendbench.report.plots import bounds, logarithmic
from pendbench.report.styles import Styles
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours again: what holds is green, what the engine says itself is blue, what it does not is red.
_COLOURS: Final = {
    "holds": "#8FD0B9",
    "drifts": "#F3D48A",
    "not told": "#F7EBC8",
    "refused": "#E6E6E6",
    "gives up": "#A9CBE3",
    "warned": "#7FB2D6",
    "breaks": "#E39A73",
    "resets": "#D97F8F",
    "timed out": "#CDB6D8",
    "out of memory": "#B79CC6",
    "crashed": "#8C8C8C",
    "error": "#8C8C8C",
}
_CELL: Final = (0.82, 0.33)  # inches
_MARGIN: Final = (2.1, 1.9)


def cell_text(row: StepRow) -> str:
    """The largest stable step; ``its own`` for a method that chooses it; the verdict where none holds; with a question
    mark what runs that were stopped or not begun could change.
    """
    if not is_known(row.best_verdict):
        return "not known"
    if row.unsettled or not row.holds:
        return f"{row.best_verdict} ?" if row.unsettled else row.best_verdict
    if math.isnan(row.stable_dt):
        return "its own"
    return f"{'≥ ' if row.bound else ''}{STABLE_DT.text(row)}"


def map_figure(steps: Sequence[StepRow]) -> Figure:
    """Scene by engine and method: coloured by the best verdict, with the largest stable step."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    scenes, columns = distinct(steps, scene_of), distinct(steps, pair_of)
    width, height = _CELL[0] * len(columns) + _MARGIN[0], _CELL[1] * len(scenes) + _MARGIN[1]
    figure = Figure(figsize=(max(6.0, width), max(3.0, height)), layout="constrained")
    axes = figure.subplots()
    for row in steps:
        _draw_cell(axes, row, columns.index(pair_of(row)), scenes.index(scene_of(row)))
    axes.set(xlim=(0, len(columns)), ylim=(len(scenes), 0))
    axes.set_xticks([x + 0.5 for x in range(len(columns))], [_two_lines(name) for name in columns])
    axes.set_yticks([y + 0.5 for y in range(len(scenes))], [label(name) for name in scenes])
    axes.tick_params(length=0, labelsize=8, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.spines[:].set_visible(False)
    present = {row.best_verdict for row in steps}
    patches = [Patch(facecolor=_COLOURS[word], label=word) for word in VERDICTS if word in present]
    figure.legend(handles=patches, loc="outside lower center", ncols=min(6, len(patches)), frameon=False, fontsize=8)
    return figure


def _draw_cell(axes: Axes, row: StepRow, x: int, y: int) -> None:
    from matplotlib.patches import Rectangle

    axes.add_patch(Rectangle((x, y), 1, 1, facecolor=_COLOURS[row.best_verdict], edgecolor="white", linewidth=1.5))
    axes.text(x + 0.5, y + 0.5, label(cell_text(row).replace("≥", ">="), 14), ha="center", va="center", fontsize=7)


def _two_lines(name: str) -> str:
    engine, _, method = name.partition(" ")
    return f"{label(engine)}\n{label(method)}"


def growth_figure(styles: Styles, steps: Sequence[StepRow]) -> Figure:
    """The largest stable step against n, a line for each method with a fixed step; a hollow mark is a lower bound."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 5.0), layout="constrained")
    axes = figure.subplots()
    for own in grouped(steps, pair_of).values():
        _draw_growth(axes, styles, sorted(own, key=lambda row: row.case.scene.n))
    counts = sorted({row.case.scene.n for row in steps})
    logarithmic(axes, *bounds([row.stable_dt for row in steps], 1e-6, 1.0))
    axes.set(xscale="log", xlabel="links n", ylabel="largest stable step, s")
    axes.set_xticks(counts, [number_text(n, "d") for n in counts], minor=False)
    axes.minorticks_off()
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure


def _draw_growth(axes: Axes, styles: Styles, rows: Sequence[StepRow]) -> None:
    case = rows[0].case
    n, dt = [row.case.scene.n for row in rows], [row.stable_dt for row in rows]
    # Wide and large below, narrow above: methods of two engines can be the same to the last step.
    depth = styles.engines.index(case.engine)
    size = max(5.0, 10.0 - 3.0 * depth)
    colour, marker = styles.colour(case), styles.marker(case)
    width = max(1.2, 4.0 - 1.6 * depth)
    style = {"color": colour, "marker": marker, "markersize": size, **styles.tag(case, of_method=True)}
    axes.plot(n, dt, **style, linewidth=width, label=label(pair_of(rows[0])))
    least = [(row.case.scene.n, row.stable_dt) for row in rows if row.bound]
    if least:
        axes.plot(*zip(*least, strict=True), **style, linestyle="none", mfc="white")
