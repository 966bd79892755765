"""The pictures of a study of kind `effects`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pendbench.kinds.effects.columns import CaseRow
from pendbench.kinds.effects.study import Priced
from pendbench.report.names import distinct, grouped, pair_of
from pendbench.report.plots import bounds, logarithmic
from pendbench.report.styles import Styles
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def price_figure(rows: Sequence[Priced]) -> Figure:
    """For each effect a mark for each method, at its price; hollow where that is noisy."""
    from matplotlib.figure import Figure

    shown = [replace(row, case=replace(row.case, settings=())) for row in rows]  # default flags: the effect says so
    styles, effects = Styles.of_cases(row.case for row in shown), distinct(shown, lambda row: row.effect)[::-1]
    groups = grouped(shown, pair_of)
    figure = Figure(figsize=(9.0, 1.4 + 0.55 * len(effects)), layout="constrained")
    axes = figure.subplots()
    for order, (name, own) in enumerate(groups.items()):
        shift = 0.3 * (order / max(1, len(groups) - 1) - 0.5)
        for row in own:
            hollow: dict[str, Any] = {"fillstyle": "none"} if row.noisy else {}
            axes.plot(row.price.ratio, effects.index(row.effect) - shift, **styles.mark(row.case), **hollow)
        axes.plot([], [], label=label(name), **styles.mark(own[0].case))
    axes.axvline(1.0, color="0.6", linewidth=1)
    axes.set_yticks(range(len(effects)), [label(effect) for effect in effects])
    axes.grid(axis="y", color="0.93")
    ratios = [row.price.ratio for row in shown]
    logarithmic(axes, 0.8 * min(0.8, *ratios), 1.5 * max(2.0, *ratios), "x")
    axes.set_xlabel("cost of a step, over that of the bare chain")
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure


def balance_figure(styles: Styles, rows: Sequence[CaseRow]) -> Figure:
    """The balance of energy against the error."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 5.0), layout="constrained")
    axes = figure.subplots()
    for name, own in grouped(rows, pair_of).items():
        errors, balances = [row.run.error_max for row in own], [row.run.balance_error for row in own]
        rings = 5 + 3 * styles.engines[::-1].index(own[0].case.engine)  # such that what lies upon another hides nothing
        style = styles.mark(own[0].case) | {"markersize": rings, "fillstyle": "none"}
        axes.plot(errors, balances, label=label(name), **style)
    logarithmic(axes, *bounds([row.run.balance_error for row in rows], 1e-17, 1e6))
    logarithmic(axes, *bounds([row.run.error_max for row in rows], 1e-17, 10), "x")
    axes.set(xlabel="largest error e", ylabel="energy balance")
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure
