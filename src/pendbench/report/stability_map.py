"""The pictures of a study of kind `stability`: the map of verdicts, and how the largest stable step falls with n."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from pendbench.report.columns import number_text, shown
from pendbench.report.look import Look
from pendbench.report.plots import bounds, logarithmic
from pendbench.report.rows import Row, distinct, method_name, number, of, word
from pendbench.report.text import label
from pendbench.study.verdict import VERDICTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours again: what holds is green, what the engine says itself is blue, what it does not is red.
_COLOURS: Final = {
    "holds": "#8FD0B9",
    "drifts": "#F3D48A",
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


def pair_name(row: Row) -> str:
    """An engine and its method: ``mujoco rk4``."""
    return f"{word(row, 'engine')} {method_name(row)}"


def pairs(steps: Sequence[Row]) -> list[str]:
    """The engines and methods, in the study's order."""
    return list(dict.fromkeys(pair_name(row) for row in steps))


def is_true(row: Row, name: str) -> bool:
    """Whether a column of yes or no says yes, of a table or of a file."""
    return row.get(name) in (True, "true")


def cell_text(row: Row) -> str:
    """The largest stable step; ``its own`` for a method that chooses it; the verdict where none holds, with a question
    mark where finer steps took too long to tell.
    """
    if word(row, "best_verdict") != "holds":
        return f"{word(row, 'best_verdict')} ?" if is_true(row, "unsettled") else word(row, "best_verdict")
    if math.isnan(number(row, "stable_dt")):
        return "its own"
    return f"{'≥ ' if is_true(row, 'bound') else ''}{shown('stable_dt', row['stable_dt'])}"


def map_figure(steps: Sequence[Row]) -> Figure:
    """Scene by engine and method: coloured by the best verdict, with the largest stable step."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch, Rectangle

    scenes, columns = distinct(steps, "scene"), pairs(steps)
    width, height = _CELL[0] * len(columns) + _MARGIN[0], _CELL[1] * len(scenes) + _MARGIN[1]
    figure = Figure(figsize=(max(6.0, width), max(3.0, height)), layout="constrained")
    axes = figure.subplots()
    for row in steps:
        x, y, verdict = columns.index(pair_name(row)), scenes.index(word(row, "scene")), word(row, "best_verdict")
        axes.add_patch(Rectangle((x, y), 1, 1, facecolor=_COLOURS[verdict], edgecolor="white", linewidth=1.5))
        axes.text(x + 0.5, y + 0.5, label(cell_text(row).replace("≥", ">="), 14), ha="center", va="center", fontsize=7)
    axes.set(xlim=(0, len(columns)), ylim=(len(scenes), 0))
    axes.set_xticks([x + 0.5 for x in range(len(columns))], [_two_lines(name) for name in columns])
    axes.set_yticks([y + 0.5 for y in range(len(scenes))], [label(name) for name in scenes])
    axes.tick_params(length=0, labelsize=8, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.spines[:].set_visible(False)
    seen = [verdict for verdict in VERDICTS if of(steps, best_verdict=verdict)]
    patches = [Patch(facecolor=_COLOURS[verdict], label=verdict) for verdict in seen]
    figure.legend(handles=patches, loc="outside lower center", ncols=min(6, len(patches)), frameon=False, fontsize=8)
    return figure


def _two_lines(name: str) -> str:
    engine, _, method = name.partition(" ")
    return f"{label(engine)}\n{label(method)}"


def growth_figure(look: Look, steps: Sequence[Row]) -> Figure:
    """The largest stable step against n, a line for each method with a fixed step."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 5.0), layout="constrained")
    axes = figure.subplots()
    known = [row for row in steps if number(row, "stable_dt") > 0]
    for name in pairs(known):
        own = sorted((row for row in known if pair_name(row) == name), key=lambda row: number(row, "n"))
        _draw(axes, look, own)
    counts = sorted({number(row, "n") for row in known})
    logarithmic(axes, *bounds([number(row, "stable_dt") for row in known], 1e-6, 1.0))
    axes.set(xscale="log", xlabel="links n", ylabel="largest stable step, s")
    axes.set_xticks(counts, [number_text(n, "d") for n in counts], minor=False)
    axes.minorticks_off()
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure


def _draw(axes: Axes, look: Look, rows: Sequence[Row]) -> None:
    engine, method = word(rows[0], "engine"), method_name(rows[0])
    n, dt = [number(row, "n") for row in rows], [number(row, "stable_dt") for row in rows]
    # Wide and large below, narrow above: methods of two engines can be the same to the last step.
    depth = look.engines.index(engine)
    axes.plot(
        n,
        dt,
        color=look.colour(engine, method),
        marker=look.marker(engine, method),
        linewidth=max(1.2, 4.0 - 1.6 * depth),
        markersize=max(5.0, 10.0 - 3.0 * depth),
        label=label(pair_name(rows[0])),
    )
