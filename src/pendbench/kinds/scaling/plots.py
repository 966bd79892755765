"""The pictures of a study of kind `scaling`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pendbench.kinds.scaling.columns import LONGEST, CaseRow, LongestRow
from pendbench.report.names import grouped, pair_of
from pendbench.report.plots import bounds, logarithmic
from pendbench.report.styles import Styles
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def longest_figure(styles: Styles, rows: Sequence[LongestRow]) -> Figure:
    """A panel for each title, with a bar for each engine and method that won it: the longest chain. What is a lower
    bound is hatched.
    """
    from matplotlib.figure import Figure

    titles = grouped(rows, lambda row: row.title)
    sizes = [1.0 + len(own) for own in titles.values()]
    figure = Figure(figsize=(7.5, 1.2 + 0.3 * sum(sizes)), layout="constrained")
    panels = figure.subplots(len(titles), 1, sharex=True, squeeze=False, height_ratios=sizes)[:, 0]
    for axes, (title, own) in zip(panels, titles.items(), strict=True):
        _bars(axes, styles, sorted(own, key=lambda row: row.longest_n))
        axes.set_title(label(title), fontsize=10)
        logarithmic(axes, 1.0, 10.0 * max(row.longest_n for row in rows), "x")
    panels[-1].set_xlabel("links of the longest chain in real time")
    return figure


def _bars(axes: Axes, styles: Styles, rows: Sequence[LongestRow]) -> None:
    for place, row in enumerate(rows):
        hatch = "//" if row.bound else None
        axes.barh(place, row.longest_n, color=styles.colour(row.case), height=0.7, hatch=hatch, edgecolor="white")
        told = f"{'at least ' if row.bound else ''}{LONGEST.text(row)}"
        axes.annotate(told, (row.longest_n, place), xytext=(4, 0), textcoords="offset points", va="center")
    axes.set_yticks(range(len(rows)), [label(pair_of(row)) for row in rows])


def cost_figure(styles: Styles, rows: Sequence[CaseRow]) -> Figure:
    """The cost of a step for each link, against the number of links."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 5.0), layout="constrained")
    axes = figure.subplots()
    for name, own in grouped(rows, pair_of).items():
        ordered = sorted(own, key=lambda row: row.case.scene.n)
        n, cost = [row.case.scene.n for row in ordered], [row.step_per_link_ns for row in ordered]
        style = styles.mark(own[0].case) | {"linestyle": "-", "linewidth": 1.4, "markersize": 5}
        axes.plot(n, cost, label=label(name), **style)
    logarithmic(axes, *bounds([row.step_per_link_ns for row in rows], 1e-1, 1e9))
    logarithmic(axes, *bounds([row.case.scene.n for row in rows], 0.5, 1e7), "x")
    axes.set(xlabel="links n", ylabel="cost of a step for each link, ns")
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure
