"""What the page of a study of kind `chaos` says; the sentences are in page.md.j2."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

from pendbench.kinds.chaos.answer import Standing, answer
from pendbench.kinds.chaos.causes import growths, summaries, twins
from pendbench.kinds.chaos.plots import ERROR, TIME, cost_figure, energy_curves, error_curves
from pendbench.kinds.chaos.prices import prices
from pendbench.kinds.chaos.rows import CaseRow, MethodRow, SceneRow
from pendbench.kinds.chaos.scenes import CASES, OVERVIEW
from pendbench.kinds.chaos.study import Found
from pendbench.measures.energy import conserves_energy
from pendbench.report.columns import Table
from pendbench.report.curves import curves_figure
from pendbench.report.names import in_one_scene, in_order, is_ok, scene_of
from pendbench.report.plots import Drawn, Picture
from pendbench.report.start import turns_at_start
from pendbench.report.styles import Styles
from pendbench.report.text import file_name
from pendbench.study.case import Case
from pendbench.study.results import Results
from pendbench.truth.proof.known import Proven, proven

_ERRORS: Final = "the error e(t) against time, up to the horizon."
_ENERGIES: Final = "the largest energy error so far against time."
_COST: Final = (
    "Cost against time with the truth, a panel for each chaotic scene: right is longer, down is cheaper. A line joins "
    "the steps of one method. Open arrows at the horizon (black line): the median start does not leave before it. "
    "Crosses: cases that did not end well, at the time they left."
)
_COST_REGULAR: Final = (
    "Cost against error where the motion is regular, and hardly anybody leaves the truth: left is nearer to it, down "
    "is cheaper. A line joins the steps of one method. Crosses: cases that did not end well."
)


@dataclass(frozen=True)
class ScenePart:
    """A scene with its cases, coarse steps first."""

    row: SceneRow
    cases: Sequence[CaseRow]


@dataclass(frozen=True)
class Facts:
    """Everything that the template says, beside what every page does. balanced: where energy is not conserved."""

    where: str
    best: Table
    first: Standing | None
    others: Sequence[Standing]
    shared: Sequence[str]
    lost: Sequence[str]
    still: Sequence[SceneRow]
    balanced: Sequence[str]
    overview: Table
    turned: Sequence[SceneRow]
    methods: Table
    alike: Sequence[Sequence[str]]
    growth: Table
    prices: Table
    parts: Sequence[ScenePart]
    shown: Table
    causes: Table
    timed_failures: int
    proven: Sequence[Proven]


def facts(results: Results[Found], tables: dict[str, Table]) -> Facts:
    """What the page says."""
    del results
    cases: list[CaseRow] = list(tables["cases"])
    scenes: list[SceneRow] = list(tables["scenes"])
    causes: list[MethodRow] = list(tables["causes"])
    told = answer(scenes, cases)
    return Facts(
        where=told.where,
        best=told.best,
        first=next(iter(told.best), None),
        others=list(told.best)[1:],
        shared=told.shared,
        lost=told.lost,
        still=told.still,
        balanced=[row.scene.name for row in scenes if not conserves_energy(row.scene)],
        overview=Table("overview", OVERVIEW, scenes),
        turned=[row for row in scenes if turns_at_start(row.scene)],
        methods=summaries(causes),
        alike=twins(cases),
        growth=growths(scenes, cases),
        prices=prices(scenes, cases),
        parts=list(_parts(scenes, cases)),
        shown=Table("cases", CASES, cases),
        causes=tables["causes"].of(row for part in scenes for row in in_order(causes) if row.scene is part),
        timed_failures=sum(not is_ok(row) and math.isfinite(row.timing.step_us) for row in cases),
        proven=proven(row.scene for row in scenes),
    )


def moving(results: Results[Found], tables: dict[str, Table]) -> list[Case]:
    """The best of each engine, in the scene where most of them can be seen, and of these the most chaotic."""
    del results
    rows = [row for standing in answer(list(tables["scenes"]), list(tables["cases"])).best for row in standing.rows]
    wildest = sorted(rows, key=lambda row: -row.scene.truth.horizon * row.scene.lyapunov)
    return in_one_scene(row.case for row in wildest)


def _parts(scenes: Sequence[SceneRow], cases: Sequence[CaseRow]) -> Iterator[ScenePart]:
    for row in scenes:
        yield ScenePart(row, in_order(case for case in cases if case.scene is row))


def pictures(results: Results[Found], tables: dict[str, Table]) -> Iterator[Picture]:
    """What staying with the truth costs; and for each scene, error and energy against time."""
    del results
    cases: list[CaseRow] = list(tables["cases"])
    styles, names = Styles.of_cases(row.case for row in cases), {"cost", "cost_regular"}
    moving = [row for row in cases if not row.scene.still]
    chaotic = [row for row in moving if row.scene.exponent.chaotic]
    regular = [row for row in moving if not row.scene.exponent.chaotic]
    for name, caption, own, gain in (("cost", _COST, chaotic, TIME), ("cost_regular", _COST_REGULAR, regular, ERROR)):
        if any(map(gain.is_drawn, own)):
            yield Picture(name, "", caption, Drawn(partial(cost_figure, styles, own, gain)))
    for part in _parts(list(tables["scenes"]), cases):
        scene = part.row.scene.name
        curves = [row for row in tables["curves"] if scene_of(row) == scene]
        for kind, of, caption in (("error", error_curves, _ERRORS), ("energy", energy_curves, _ENERGIES)):
            canvas, drawn = of(part.row, part.cases, curves)
            if drawn:
                names.add(name := file_name(f"{kind}_{scene}", names))
                image = Drawn(partial(curves_figure, styles, drawn, canvas))
                yield Picture(name, scene, f"{scene}: {caption}", image)
