"""The pictures of a study of kind `scaling`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pendbench.report.columns import number_text
from pendbench.report.look import Look
from pendbench.report.plots import bounds, logarithmic
from pendbench.report.rows import Row, method_name, number, word
from pendbench.report.stability_map import pair_name, pairs
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def longest_figure(look: Look, rows: Sequence[Row]) -> Figure:
    """A bar for each engine and method: the longest chain in real time."""
    from matplotlib.figure import Figure

    known = sorted((row for row in rows if number(row, "longest_n") > 0), key=lambda row: number(row, "longest_n"))
    figure = Figure(figsize=(7.5, 1.2 + 0.34 * len(known)), layout="constrained")
    axes = figure.subplots()
    lengths = [number(row, "longest_n") for row in known]
    colours = [look.colour(word(row, "engine"), method_name(row)) for row in known]
    axes.barh(range(len(known)), lengths, color=colours, height=0.7)
    for place, length in enumerate(lengths):
        axes.annotate(number_text(length, "d"), (length, place), xytext=(4, 0), textcoords="offset points", va="center")
    axes.set_yticks(range(len(known)), [label(pair_name(row)) for row in known])
    logarithmic(axes, 1.0, 10.0 * max(lengths), "x")
    axes.set_xlabel("links of the longest chain in real time")
    return figure


def cost_figure(look: Look, rows: Sequence[Row]) -> Figure:
    """The cost of a step for each link, against the number of links."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 5.0), layout="constrained")
    axes = figure.subplots()
    for name in pairs(rows):
        own = sorted((row for row in rows if pair_name(row) == name), key=lambda row: number(row, "n"))
        engine, method = word(own[0], "engine"), method_name(own[0])
        axes.plot(
            [number(row, "n") for row in own],
            [number(row, "step_per_link_ns") for row in own],
            color=look.colour(engine, method),
            marker=look.marker(engine, method),
            markersize=5,
            linewidth=1.4,
            label=label(name),
        )
    logarithmic(axes, *bounds([number(row, "step_per_link_ns") for row in rows], 1e-1, 1e9))
    logarithmic(axes, *bounds([number(row, "n") for row in rows], 0.5, 1e7), "x")
    axes.set(xlabel="links n", ylabel="cost of a step for each link, ns")
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure
