"""The pictures of a study of kind `effects`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pendbench.report.look import Look
from pendbench.report.plots import bounds, logarithmic
from pendbench.report.rows import Row, distinct, method_name, number, word
from pendbench.report.stability_map import pair_name, pairs
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def price_figure(look: Look, rows: Sequence[Row]) -> Figure:
    """For each effect a mark for each method, at its price."""
    from matplotlib.figure import Figure

    effects = distinct(rows, "effect")[::-1]
    names = pairs(rows)
    figure = Figure(figsize=(9.0, 1.4 + 0.55 * len(effects)), layout="constrained")
    axes = figure.subplots()
    for order, name in enumerate(names):
        own = [row for row in rows if pair_name(row) == name]
        engine, method = word(own[0], "engine"), method_name(own[0])
        shift = 0.3 * (order / max(1, len(names) - 1) - 0.5)
        axes.plot(
            [number(row, "step_price") for row in own],
            [effects.index(word(row, "effect")) - shift for row in own],
            color=look.colour(engine, method),
            marker=look.marker(engine, method),
            linestyle="none",
            label=label(name),
        )
    axes.axvline(1.0, color="0.6", linewidth=1)
    axes.set_yticks(range(len(effects)), [label(effect) for effect in effects])
    axes.grid(axis="y", color="0.93")
    logarithmic(axes, 0.5, 2.0 * max(number(row, "step_price") for row in rows), "x")
    axes.set_xlabel("cost of a step, over that of the bare chain")
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure


def balance_figure(look: Look, rows: Sequence[Row]) -> Figure:
    """The balance of energy against the error."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 5.0), layout="constrained")
    axes = figure.subplots()
    for name in pairs(rows):
        own = [row for row in rows if pair_name(row) == name]
        engine, method = word(own[0], "engine"), method_name(own[0])
        axes.plot(
            [number(row, "error_max") for row in own],
            [number(row, "balance_error") for row in own],
            color=look.colour(engine, method),
            marker=look.marker(engine, method),
            markersize=5,
            linestyle="none",
            label=label(name),
        )
    logarithmic(axes, *bounds([number(row, "balance_error") for row in rows], 1e-17, 1e6))
    logarithmic(axes, *bounds([number(row, "error_max") for row in rows], 1e-17, 10), "x")
    axes.set(xlabel="largest error e", ylabel="energy balance")
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure
