"""The picture of an engine's history: what each release is worth, scene by scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from pendbench.report.names import distinct
from pendbench.report.plots import bounds, logarithmic
from pendbench.report.styles import Styles
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What is drawn, a row of panels each, and the range that it may have.
_QUANTITIES: Final = (
    ("error, lengths of the chain", 1e-17, 1e3),
    ("energy error over its scale", 1e-17, 1e3),
    ("largest stable step, s", 1e-6, 1e2),
    ("cost of a step, µs", 1e-3, 1e9),
)


@dataclass(frozen=True)
class Point:
    """What a method of a release is worth in a scene. values: in the order of the panels' rows; nan where unknown."""

    version: str
    scene: str
    method: str
    values: tuple[float, ...]


def history_figure(engine: str, versions: Sequence[str], points: Sequence[Point]) -> Figure:
    """A row of panels for each quantity, a column for each scene, a line for each method, over the releases."""
    from matplotlib.figure import Figure

    scenes, methods = distinct(points, lambda p: p.scene), distinct(points, lambda p: p.method)
    looks = Styles.of_names(engine, methods)
    figure = Figure(figsize=(3.6 * len(scenes) + 1.6, 10.5), layout="constrained")
    panels = figure.subplots(len(_QUANTITIES), len(scenes), squeeze=False, sharex=True, sharey="row")
    for row, (quantity, lowest, highest) in enumerate(_QUANTITIES):
        for column, scene in enumerate(scenes):
            axes = panels[row][column]
            for method in methods:
                own = {p.version: p.values[row] for p in points if (p.scene, p.method) == (scene, method)}
                values = [own.get(version, float("nan")) for version in versions]
                axes.plot(range(len(versions)), values, label=label(method), markersize=5, **looks[method])
            axes.set_xticks(range(len(versions)), [label(each) for each in versions], rotation=60, fontsize=8)
            axes.set_xlim(-0.5, len(versions) - 0.5)
            axes.tick_params(labelbottom=True)
            axes.set_ylabel(quantity if column == 0 else "")
            axes.set_title(label(scene) if row == 0 else "")
        logarithmic(panels[row][0], *bounds([p.values[row] for p in points], lowest, highest))
        for axes in panels[row][1:]:
            axes.grid(axis="y", color="0.9", linewidth=0.6)
    handles, names = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=min(6, len(names)), frameon=False, fontsize=9)
    return figure
