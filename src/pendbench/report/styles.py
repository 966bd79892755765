"""How each engine, method and step looks: an engine's colour is the same in every plot of every study."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from pendbench.report.charts import Mark
from pendbench.report.names import Ended, grouped, method_name
from pendbench.report.numbers import number_text
from pendbench.report.plots import GREY, HUES, Colour, hue, shades
from pendbench.report.text import label
from pendbench.study.case import Case

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Where a run that did not end well ended.
ENDED: Final[dict[str, Any]] = {"marker": "X", "markersize": 11, "markeredgecolor": "white", "linestyle": "none"}

_MARKERS: Final = "osD^vPhp*"
_DASHES: Final[tuple[Any, ...]] = ("-", (0, (5, 1.5)), (0, (1.5, 1.5)), (0, (6, 1.5, 1.5, 1.5)), (0, (10, 3)))
#: The looks of the engines that people know: the hues of `report.plots`, and from the ninth on the same again, hollow.
#: Any other engine has the look that its name falls on.
_PLACES: Final = {
    "analytic": 0, "mujoco": 1, "pymunk": 2, "heyoka": 3, "pinocchio": 4, "scipy": 5, "xpbd": 6, "drake": 7,
    "dart": 8, "mjx": 9, "box2d": 10, "rapier": 11, "pybullet": 12, "newton": 13, "exudyn": 14,
}  # fmt: skip
_LOOKS: Final = 2 * HUES
_RIM: Final[dict[str, Any]] = {"markeredgecolor": "black", "markeredgewidth": 1.1}


def _place(engine: str) -> int:
    return _PLACES.get(engine, zlib.crc32(engine.encode())) % _LOOKS


def engine_hue(engine: str) -> str:
    """The colour of an engine, wherever it is drawn."""
    return hue(_place(engine))


def is_hollow(engine: str) -> bool:
    """Whether an engine's lines have a light core and its marks a rim: it has its hue with another engine."""
    return _place(engine) >= HUES


def _core(width: float) -> list[Any]:
    """A line with a light core, as matplotlib draws it."""
    from matplotlib.patheffects import Stroke

    return [Stroke(linewidth=width + 1.4), Stroke(linewidth=max(0.7, 0.5 * width), foreground="white")]


@dataclass(frozen=True)
class Styles:
    """methods: of each engine, in the order of their shades. steps: s, in the order of their strokes, coarse first."""

    methods: dict[str, list[str]]
    steps: list[float]

    @classmethod
    def of_cases(cls, cases: Iterable[Case]) -> Styles:
        """The styles of a study with these cases."""
        groups = grouped(cases, lambda case: case.engine)
        methods = {name: sorted(set(map(method_name, own))) for name, own in groups.items()}
        steps = {case.dt for own in groups.values() for case in own if case.dt is not None}
        return cls(methods, sorted(steps, reverse=True))

    @staticmethod
    def of_names(engine: str, methods: Sequence[str]) -> dict[str, dict[str, Any]]:
        """How a line of each of an engine's methods is drawn that goes through all steps, by name."""
        colours = shades(engine_hue(engine), len(methods))
        return {
            name: {"color": colours[i], "marker": _MARKERS[i % len(_MARKERS)], "linestyle": _DASHES[i % len(_DASHES)]}
            for i, name in enumerate(methods)
        }

    @property
    def engines(self) -> list[str]:
        """The engines, in the study's order."""
        return list(self.methods)

    def colour(self, case: Case) -> Colour:
        """The engine's hue in the method's shade."""
        names = self.methods[case.engine]
        return shades(engine_hue(case.engine), len(names))[names.index(method_name(case))]

    def stroke(self, dt: float | None) -> Any:
        """The step's dashes; a method that chooses its own step is drawn through."""
        return "-" if dt is None else _DASHES[self.steps.index(dt) % len(_DASHES)]

    def width(self, case: Case) -> float:
        """Wider lines below, so that a line that lies upon another leaves its rim to be seen."""
        names = self.methods[case.engine]
        return 1.6 + 0.9 * (len(names) - 1 - names.index(method_name(case)))

    def marker(self, case: Case) -> str:
        """The method's marker."""
        return _MARKERS[self.methods[case.engine].index(method_name(case)) % len(_MARKERS)]

    def mark(self, case: Case) -> dict[str, Any]:
        """How the points of a method are drawn."""
        rim = _RIM if is_hollow(case.engine) else {}
        return {"color": self.colour(case), "marker": self.marker(case), "linestyle": "none", **self.tag(case), **rim}

    def line(self, case: Case) -> dict[str, Any]:
        """How the curve of a case is drawn."""
        width = self.width(case)
        core = {"path_effects": _core(width)} if is_hollow(case.engine) else {}
        return {
            "color": self.colour(case), "linewidth": width, "linestyle": self.stroke(case.dt), **self.tag(case), **core
        }  # fmt: skip

    def tag(self, case: Case, *, of_method: bool = False) -> dict[str, Any]:
        """What tells a page whose a line is; of_method: of a line through all steps."""
        stroke = "-" if of_method else self.stroke(case.dt)
        dashes = tuple(stroke[1]) if isinstance(stroke, tuple) else ()
        step = "" if of_method or case.dt is None else f"step {number_text(case.dt)} s"
        return {"gid": Mark(case.engine, method_name(case), step, dashes, is_hollow(case.engine)).gid}


def name_missing(axes: Axes, rows: Sequence[Ended]) -> None:
    """Say in a panel how many cases it cannot show, and what became of them."""
    statuses = Counter(row.status for row in rows)
    if statuses:
        text = ", ".join(f"{count} {label(status)}" for status, count in statuses.items())
        axes.annotate(f"not drawn: {text}", (0.02, 0.02), xycoords="axes fraction", fontsize=8, color=GREY)
