"""The pictures of a study of kind `ensemble`: the map, where others differ from it, and exponents over energies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from pendbench.kinds.ensemble.columns import EnergyRow, PixelRow, StartRow
from pendbench.report.names import case_name, grouped
from pendbench.report.numbers import number_text
from pendbench.report.plots import DPI, GREY, hue, panels
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS: Final = "viridis_r"  # even to the eye; late flips are dark, and what never flips is white
_FAILED: Final = "#D55E00"
_SHOWN: Final = 1000  # the map's side, in the picture's pixels
_MARGINS: Final = (80, 70, 150, 40)  # left, bottom, right, top: as well
_FIRST: Final = 0.02  # of the colours, as a share of the duration
_PI_TICKS: Final = ([-math.pi, -math.pi / 2, 0.0, math.pi / 2, math.pi], ["\u2212π", "\u2212π/2", "0", "π/2", "π"])

Map = npt.NDArray[np.float64]


def map_figure(flips: Map, duration: float) -> Figure:
    """Flip times (k, k), s: a pixel of the picture for each of a thousand by a thousand."""
    from matplotlib.figure import Figure

    left, bottom, right, top = _MARGINS
    width, height = left + _SHOWN + right, bottom + _SHOWN + top
    figure = Figure(figsize=(width / DPI, height / DPI))
    axes = figure.add_axes((left / width, bottom / height, _SHOWN / width, _SHOWN / height))
    drawn = _draw_map(axes, flips, duration)
    _angles(axes)
    beside = figure.add_axes(((left + _SHOWN + 25) / width, bottom / height, 25 / width, _SHOWN / height))
    bar = figure.colorbar(drawn, cax=beside, extend="min")
    ticks = [duration * share for share in (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)]
    bar.set_ticks(ticks, labels=[number_text(tick) for tick in ticks])
    bar.minorticks_off()
    bar.set_label("time until a rod first goes over the top, s (white: never)")
    return figure


def _draw_map(axes: Axes, flips: Map, duration: float, **style: Any) -> Any:
    """The map as an image: theta_1 to the right, theta_2 upwards."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    colours = colormaps[_COLOURS].with_extremes(bad=_FAILED, over="white")
    shown = np.where(np.isinf(flips), 10.0 * duration, flips)  # a logarithm knows no infinity
    return axes.imshow(
        shown.T,
        origin="lower",
        extent=(-math.pi, math.pi, -math.pi, math.pi),
        interpolation="nearest",
        cmap=colours,
        norm=LogNorm(_FIRST * duration, duration),
        **style,
    )


def _angles(axes: Axes) -> None:
    axes.set(xlabel="first angle θ1 at release, rad", ylabel="second angle θ2 at release, rad")
    axes.set_xticks(*_PI_TICKS)
    axes.set_yticks(*_PI_TICKS)


def differences_figure(
    flips: Map, duration: float, edge: npt.NDArray[np.bool_], cases: Sequence[Sequence[PixelRow]]
) -> Figure:
    """A panel for each case, from its pixels: those that differ from the map, at its edge and away from it.

    edge (k, k): the map's edge, which is shaded.
    """
    figure, axes = panels(len(cases), 2, 5.2, 5.4)
    for panel, rows in zip(axes, cases, strict=True):
        _draw_map(panel, flips, duration, alpha=0.25)
        panel.imshow(
            np.where(edge.T, 0.6, np.nan), origin="lower", extent=(-math.pi, math.pi, -math.pi, math.pi),
            interpolation="nearest", cmap="Greys", vmin=0.0, vmax=1.0, alpha=0.45,
        )  # fmt: skip
        _mark(panel, rows)
        panel.set_title(label(case_name(rows[0].case, with_scene=False), 60), fontsize=10)
        _angles(panel)
    marks = {name: mark for panel in axes for mark, name in zip(*panel.get_legend_handles_labels(), strict=True)}
    figure.legend(marks.values(), marks.keys(), loc="outside lower center", ncols=2, frameon=False, fontsize=9)
    return figure


def _mark(axes: Axes, rows: Sequence[PixelRow]) -> None:
    groups = grouped(rows, _group)
    styles: dict[str, tuple[str, dict[str, Any]]] = {
        "same": ("the same time", {"s": 3, "color": GREY, "linewidths": 0}),
        "edge": ("another time, at the map's edge (shaded)", {"s": 22, "color": hue(0), "marker": "o"}),
        "away": ("another time, away from the edge", {"s": 45, "color": hue(1), "marker": "X"}),
        "failed": ("not known", {"s": 20, "color": "black", "marker": "+"}),
    }
    for name, (text, style) in styles.items():
        if own := groups.get(name):
            axes.scatter([row.theta1_rad for row in own], [row.theta2_rad for row in own], label=text, **style)


def _group(row: PixelRow) -> str:
    if math.isnan(row.flip_s) or math.isnan(row.expected_flip_s):
        return "failed"
    if not row.is_changed:
        return "same"
    return "edge" if row.is_at_edge else "away"


def exponents_figure(energies: Sequence[EnergyRow], starts: Sequence[StartRow]) -> Figure:
    """The exponents of all starts against energy, with quartiles; below, the share that is regular."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 6.2), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    for regular, colour, text in ((False, hue(0), "chaotic start"), (True, hue(4), "regular start")):
        own = [row for row in starts if row.is_regular is regular]
        x, y = [row.energy_share for row in own], [row.lyapunov_per_s for row in own]
        above.scatter(x, y, s=7, alpha=0.5, linewidths=0, color=colour, label=text)
    _draw_quartiles(above, energies)
    above.set(xlim=(0, 1), ylabel="largest Lyapunov exponent, 1/s")
    above.legend(frameon=False, fontsize=9, loc="upper left")
    left = [row.energies.low for row in energies]
    widths = [row.energies.high - row.energies.low for row in energies]
    below.bar(left, [row.regular_share for row in energies], widths, align="edge", color=hue(4),
              edgecolor="white")  # fmt: skip
    below.set(ylim=(0, 1), ylabel="regular share", xlabel="energy: 0 hanging, 1 upright")
    for axes in (above, below):
        axes.grid(color="0.92", linewidth=0.6)
        axes.set_axisbelow(True)
    return figure


def _draw_quartiles(axes: Axes, energies: Sequence[EnergyRow]) -> None:
    middles = [0.5 * (row.energies.low + row.energies.high) for row in energies]
    low, mid, high = np.array([row.quartiles for row in energies]).T
    axes.errorbar(
        middles, mid, yerr=[mid - low, high - mid], fmt="D-", color="black", markersize=5, capsize=4, linewidth=1.2,
        label="median and quartiles",
    )  # fmt: skip
