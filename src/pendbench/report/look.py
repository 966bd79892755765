"""How each engine, method and step of a study looks: the same in every plot."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from pendbench.report.plots import GREY, Colour, hue, shades
from pendbench.report.rows import Row, distinct, finite, method_name, number, of, word
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Where a run that did not end well ended.
ENDED: Final[dict[str, Any]] = {"marker": "X", "markersize": 11, "markeredgecolor": "white", "linestyle": "none"}

_MARKERS: Final = "osD^vPhp*"
_DASHES: Final[tuple[Any, ...]] = ("-", (0, (5, 1.5)), (0, (1.5, 1.5)), (0, (6, 1.5, 1.5, 1.5)), (0, (10, 3)))


@dataclass(frozen=True)
class Look:
    """engines: in the order of their hues. methods: of each engine, in the order of their shades. steps: s, coarse
    to fine, in the order of their strokes.
    """

    engines: list[str]
    methods: dict[str, list[str]]
    steps: list[float]

    @classmethod
    def of_cases(cls, rows: Sequence[Row]) -> Look:
        """The look of a study with these cases."""
        engines = distinct(rows, "engine")
        methods = {name: sorted({method_name(row) for row in of(rows, engine=name)}) for name in engines}
        return cls(engines, methods, sorted(set(finite(rows, "dt")), reverse=True))

    def colour(self, engine: str, method: str) -> Colour:
        """The engine's hue in the method's shade."""
        names = self.methods[engine]
        return shades(hue(self.engines.index(engine)), len(names))[names.index(method)]

    def stroke(self, dt: float) -> Any:
        """The step's dashes; a method that chooses its own step is drawn through."""
        return "-" if math.isnan(dt) else _DASHES[self.steps.index(dt) % len(_DASHES)]

    def width(self, engine: str, method: str) -> float:
        """Wider lines below, so that a line that lies upon another leaves its rim to be seen."""
        names = self.methods[engine]
        return 1.6 + 0.9 * (len(names) - 1 - names.index(method))

    def marker(self, engine: str, method: str) -> str:
        """The method's marker."""
        return _MARKERS[self.methods[engine].index(method) % len(_MARKERS)]

    def line(self, row: Row) -> dict[str, Any]:
        """How the curve of a case is drawn."""
        engine, method = str(row["engine"]), method_name(row)
        return {
            "color": self.colour(engine, method),
            "linewidth": self.width(engine, method),
            "linestyle": self.stroke(number(row, "dt")),
        }


def name_missing(axes: Axes, rows: Sequence[Row]) -> None:
    """Say in a panel how many cases it cannot show, and what became of them."""
    statuses = Counter(word(row, "status") or "without a status" for row in rows)
    if statuses:
        text = ", ".join(f"{count} {label(status)}" for status, count in statuses.items())
        axes.annotate(f"not drawn: {text}", (0.02, 0.02), xycoords="axes fraction", fontsize=8, color=GREY)
