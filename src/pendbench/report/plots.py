"""What every plot has in common: colours, strokes, axes, and bytes that depend on nothing but what is drawn."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final, Literal

from pendbench.report.charts import Chart, chart_of
from pendbench.report.numbers import number_text
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Colour = tuple[float, float, float]

DPI: Final = 100
GREY: Final = "0.35"

# Six of Okabe and Ito's colours, which people who confuse red and green tell apart too (jfly.uni-koeln.de/color), and
# two that are as far from them in all kinds of sight, on white and on black.
_HUES: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8A2BE2", "#853D1F")
HUES: Final = len(_HUES)


@dataclass(frozen=True)
class Drawn:
    """What `figure_of` draws, when somebody first looks, in the library's own style whatever the user's is."""

    figure_of: Callable[[], Figure]

    @property
    def png(self) -> bytes:
        """The figure as a picture."""
        return self._both[0]

    @property
    def chart(self) -> Chart | None:
        """The figure as lines that a page draws again, where it has nothing but lines."""
        return self._both[1]

    @cached_property
    def _both(self) -> tuple[bytes, Chart | None]:
        import matplotlib.style

        with matplotlib.style.context("default"):
            figure, file = self.figure_of(), io.BytesIO()
            figure.savefig(file, format="png", dpi=DPI, metadata={"Software": None})
            return file.getvalue(), chart_of(figure)


@dataclass(frozen=True)
class Picture:
    """A plot: the name of its file in `plots/`, the scene it is about (or none), its caption, and what was drawn."""

    name: str
    scene: str
    caption: str
    drawn: Drawn

    @property
    def png(self) -> bytes:
        """The picture itself."""
        return self.drawn.png


def hue(index: int) -> str:
    """One of the project's colours; `report.styles` says which is whose."""
    return _HUES[index % len(_HUES)]


def shades(colour: str, count: int) -> list[Colour]:
    """`count` shades of a colour, from dark to light, none of them near black or white."""
    from matplotlib.colors import to_rgb

    base = to_rgb(colour)
    if count == 1:
        return [base]
    mixes = [-0.5 + 0.95 * i / (count - 1) for i in range(count)]
    return [_mixed(base, 0.0 if mix < 0 else 1.0, abs(mix)) for mix in mixes]


def blended(count: int) -> list[str]:
    """`count` colours (#rrggbb) from blue through pink to vermilion: neighbours look alike, and the ends do not."""
    from matplotlib.colors import LinearSegmentedColormap, to_hex

    blend = LinearSegmentedColormap.from_list("blend", [_HUES[0], _HUES[3], _HUES[1]])
    return [to_hex(blend(i / max(1, count - 1))) for i in range(count)]


def _mixed(base: Colour, other: float, share: float) -> Colour:
    red, green, blue = ((1 - share) * part + share * other for part in base)
    return red, green, blue


def panels(count: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """A figure with `count` panels of this size, inches, that share their axes, at most `columns` in a row."""
    from matplotlib.figure import Figure

    across = max(1, min(count, columns))
    down = math.ceil(count / across)
    figure = Figure(figsize=(max(6.0, width * across), height * down), layout="constrained")
    axes = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True).ravel().tolist()
    for spare in axes[count:]:
        spare.remove()
    for shown in axes[:count]:
        shown.tick_params(labelbottom=True)
    return figure, axes[:count]


def named_panels(
    names: Sequence[str], title: str, quantity: str, columns: int, width: float, height: float
) -> tuple[Figure, dict[str, Axes]]:
    """The same, a panel for each name. quantity: what all their vertical axes show."""
    figure, axes = panels(len(names), columns, width, height)
    figure.suptitle(title, fontsize=12)
    figure.supylabel(quantity, fontsize=10)
    for name, panel in zip(names, axes, strict=True):
        panel.set_title(label(name), fontsize=11)
    return figure, dict(zip(names, axes, strict=True))


def logarithmic(axes: Axes, low: float, high: float, which: Literal["x", "y"] = "y") -> None:
    """A logarithmic axis from low to high, the vertical one by default, labelled at whole decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axes.set(**{f"{which}scale": "log", f"{which}lim": (low, high)})
    its = axes.yaxis if which == "y" else axes.xaxis
    decades = max(1, math.ceil(math.log10(high / low) / 8))
    its.set_major_locator(LogLocator(base=10.0**decades, numticks=20))
    its.set_major_formatter(FuncFormatter(lambda value, _: number_text(value, ".0e")))
    its.set_minor_locator(NullLocator())
    its.set_minor_formatter(NullFormatter())
    axes.grid(axis=which, color="0.9", linewidth=0.6)


def bounds(values: Sequence[float], lowest: float, highest: float) -> tuple[float, float]:
    """Whole decades around the positive values, within `lowest` and `highest`."""
    seen = [value for value in values if 0 < value < math.inf]
    low, high = (min(seen), max(seen)) if seen else (lowest, highest)
    bottom = max(lowest, 10.0 ** math.floor(math.log10(low) - 0.05))
    top = min(highest, 10.0 ** math.ceil(math.log10(high) + 0.05))
    return (bottom, top) if top > 10 * bottom else (top / 100, top)
