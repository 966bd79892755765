"""Plots as a page can draw them again, to be looked into: what matplotlib drew, read back from its figure.

A plot is declared once, in matplotlib's words. Its picture is for print and for Markdown; what is read here has the
same lines and axes. A figure of bars or of images has none, and stays a picture.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from pendbench.base.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis as DrawnAxis
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.text import Annotation

#: What an open mark is filled with: nothing, or the paper.
_OPEN: Final = ((0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 1.0))


@dataclass(frozen=True)
class Mark:
    """Whose a line is, which travels as the line's `gid`: an engine's method with its step, drawn with these dashes.

    step: as text, empty where a line is of all steps. dashes: in px. hollow: with a light core.
    """

    engine: str
    method: str
    step: str = ""
    dashes: tuple[float, ...] = ()
    hollow: bool = False

    @property
    def gid(self) -> str:
        """The mark as text."""
        return json.dumps(astuple(self))

    @classmethod
    def of(cls, gid: str | None) -> Mark | None:
        """The mark of a line; None where it is no case's."""
        if not gid:
            return None
        engine, method, step, dashes, hollow = json.loads(gid)
        return cls(engine, method, step, tuple(dashes), hollow)


@dataclass(frozen=True, eq=False)
class Line:
    """x, y (k,): its points, in the order in which they are joined where they are.

    marker: matplotlib's letter; size: of the marker, points.
    """

    x: FloatArray
    y: FloatArray
    colour: str
    width: float
    joined: bool
    dashed: bool
    stairs: bool
    marker: str
    size: float
    filled: bool
    mark: Mark | None


@dataclass(frozen=True)
class Axis:
    """ticks: of an axis whose ticks are text, by value."""

    label: str
    low: float
    high: float
    log: bool
    ticks: tuple[tuple[float, str], ...] = ()


@dataclass(frozen=True)
class Rule:
    """A line across a whole panel (`y`) or up (`x`), and what is written on it."""

    along: Literal["x", "y"]
    value: float
    text: str = ""


@dataclass(frozen=True, eq=False)
class Panel:
    """notes: what is said of the panel as a whole."""

    title: str
    x: Axis
    y: Axis
    lines: tuple[Line, ...]
    rules: tuple[Rule, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Chart:
    """A figure, as its panels."""

    title: str
    panels: tuple[Panel, ...]


def chart_of(figure: Figure) -> Chart | None:
    """The figure as lines; None where it shows anything else."""
    shown = figure.axes
    if not shown or any(axes.images or axes.patches or axes.collections for axes in shown):
        return None
    return Chart(_plain(figure.get_suptitle()), tuple(_panel(axes, _plain(figure.get_supylabel())) for axes in shown))


def _plain(text: str) -> str:
    return text.replace(r"\$", "$").strip()


def _panel(axes: Axes, quantity: str) -> Panel:
    own = [line for line in axes.lines if line.get_transform() == axes.transData and np.size(line.get_xdata())]
    ruled = [line for line in axes.lines if line.get_transform() != axes.transData]
    notes = [_plain(text.get_text()) for text in _annotations(axes) if text.xycoords == "axes fraction"]
    return Panel(
        _plain(axes.get_title()),
        _axis(axes.xaxis, axes.get_xlim(), axes.get_xlabel(), axes.get_xscale()),
        _axis(axes.yaxis, axes.get_ylim(), axes.get_ylabel() or quantity, axes.get_yscale()),
        tuple(_line(line) for line in sorted(own, key=lambda line: line.get_zorder())),
        tuple(_rules(axes, ruled)),
        tuple(notes),
    )


def _annotations(axes: Axes) -> list[Annotation]:
    from matplotlib.text import Annotation

    return [text for text in axes.texts if isinstance(text, Annotation)]


def _axis(axis: DrawnAxis, limits: tuple[float, float], label: str, scale: str) -> Axis:
    from matplotlib.ticker import FixedLocator

    ticks: tuple[tuple[float, str], ...] = ()
    if isinstance(axis.get_major_locator(), FixedLocator):
        places = np.asarray(axis.get_majorticklocs()).tolist()
        ticks = tuple(zip(places, (_plain(text.get_text()) for text in axis.get_ticklabels()), strict=True))
    return Axis(_plain(label), float(limits[0]), float(limits[1]), scale == "log", ticks)


def _line(line: Line2D) -> Line:
    from matplotlib.colors import to_hex, to_rgba

    x, y = (np.asarray(values, dtype=np.float64) for values in (line.get_xdata(), line.get_ydata()))
    known = np.isfinite(x) & np.isfinite(y)
    marker = line.get_marker()
    return Line(
        x[known],
        y[known],
        to_hex(line.get_color()),
        float(line.get_linewidth()),
        joined=line.get_linestyle() != "None",
        dashed=line.is_dashed(),
        stairs=str(line.get_drawstyle()).startswith("steps"),
        marker=marker if isinstance(marker, str) and marker != "None" else "",
        size=float(line.get_markersize()),
        filled=line.get_fillstyle() != "none" and to_rgba(line.get_markerfacecolor()) not in _OPEN,
        mark=Mark.of(line.get_gid()),
    )


def _rules(axes: Axes, lines: Sequence[Line2D]) -> Iterator[Rule]:
    """Lines across or up, with what is written beside them."""
    told = {_anchor(text): _plain(text.get_text()) for text in _annotations(axes) if isinstance(text.xycoords, tuple)}
    for line in lines:
        x, y = (np.asarray(values, dtype=np.float64) for values in (line.get_xdata(), line.get_ydata()))
        along: Literal["x", "y"] = "y" if y[0] == y[-1] else "x"
        value = float(y[0] if along == "y" else x[0])
        if math.isfinite(value):
            yield Rule(along, value, told.get((along, value), ""))


def _anchor(text: Any) -> tuple[str, float]:
    """Which axis an annotation is anchored to, and where."""
    along = "x" if text.xycoords[0] == "data" else "y"
    return along, float(text.xy[0] if along == "x" else text.xy[1])
