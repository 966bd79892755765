"""The picture of a study of kind `judge`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pendbench.kinds.judge.columns import CaseRow
from pendbench.report.names import grouped, pair_of
from pendbench.report.plots import bounds, logarithmic
from pendbench.report.styles import Styles
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def error_figure(styles: Styles, rows: Sequence[CaseRow], goal: float) -> Figure:
    """The largest error against the step, a line for each method, and the error that is asked for."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 5.0), layout="constrained")
    axes = figure.subplots()
    for name, own in grouped(rows, pair_of).items():
        ordered = sorted(own, key=lambda row: row.case.dt or 0.0)
        steps, errors = [row.case.dt or 0.0 for row in ordered], [row.run.error_max for row in ordered]
        colour, marker = styles.colour(own[0].case), styles.marker(own[0].case)
        style = {"color": colour, "marker": marker, "markersize": 4, **styles.tag(own[0].case, of_method=True)}
        axes.plot(steps, errors, **style, linewidth=1.3, label=label(name))
        for row in own:
            if row.recommended:
                ring = {"color": colour, "markersize": 12, "fillstyle": "none", **styles.tag(row.case)}
                axes.plot(row.case.dt or 0.0, row.run.error_max, "o", **ring)
    axes.axhline(goal, color="0.4", linewidth=1.0, linestyle="--")
    axes.annotate("asked for", (1.0, goal), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8)
    logarithmic(axes, *bounds([*(row.run.error_max for row in rows), goal], 1e-17, 10))
    logarithmic(axes, *bounds([row.case.dt or 0.0 for row in rows], 1e-12, 1e6), "x")
    axes.set(xlabel="step, s", ylabel="largest error e, lengths of the chain")
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure
