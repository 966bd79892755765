"""The picture of a study of kind `league`: error against cost, as engines come and where they are accurate enough."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pendbench.kinds.league.rows import CaseRow
from pendbench.report.names import engine_of, grouped
from pendbench.report.plots import bounds, logarithmic, named_panels
from pendbench.report.styles import Styles
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def cost_figure(styles: Styles, scenes: Sequence[str], rows: Sequence[CaseRow], goal: float) -> Figure:
    """A panel for each scene, a colour for each engine."""
    title = "What accuracy costs, engine by engine"
    figure, panes = named_panels(scenes, title, "largest early error, in lengths of the chain", 3, 4.2, 3.4)
    across = bounds([row.cost_s_per_s for row in rows], 1e-9, 1e3)
    up = bounds([row.run.error_early for row in rows] + [goal], 1e-17, 10.0)
    named: set[str] = set()
    for scene, axes in panes.items():
        logarithmic(axes, *across, "x")
        logarithmic(axes, *up)
        axes.set_xlabel("s of computing per simulated second")
        axes.axhline(goal, color="0.4", linewidth=1.0, linestyle="--")
        for name, own in grouped((row for row in rows if row.case.scene.name == scene), engine_of).items():
            _draw(axes, styles, own, None if name in named else label(name))
            named.add(name)
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return figure


def _draw(axes: Axes, styles: Styles, rows: Sequence[CaseRow], name: str | None) -> None:
    for row in rows:
        look = styles.mark(row.case) | ({"marker": "X", "markersize": 8} if row.as_it_comes else {"markersize": 5})
        axes.plot(row.cost_s_per_s, row.run.error_early, **look, label=name)
        name = None
