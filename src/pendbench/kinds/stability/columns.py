"""The tables of a study of kind `stability`: a row's values and its columns."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np

from pendbench.kinds.stability.search import is_bound, is_open, largest
from pendbench.kinds.stability.study import Found, Options
from pendbench.kinds.stability.work import StabilityRun
from pendbench.measures.orders import Growth, growth_exponent
from pendbench.measures.stiffest import stiffest
from pendbench.measures.verdict import is_known, rank
from pendbench.report import columns as common
from pendbench.report.columns import Column, Table, energy_drift, tables_of, text_column, within
from pendbench.report.names import OfRun, grouped, pair_of
from pendbench.scene.scene import Scene
from pendbench.study.case import Case
from pendbench.study.results import Results

SUMMARY: Final = ("scene", "engine", "method", "dt", "verdict", "energy_drift_max", "gap_max", "stable_dt")


@dataclass(frozen=True)
class SceneRow:
    """A scene and how long it is run, s."""

    scene: Scene
    duration_s: float

    @property
    def stiffest_rad_per_s(self) -> float:
        """The fastest small oscillation about the hanging chain."""
        return _stiffest(self.scene)

    @property
    def fastest_rad_per_s(self) -> float:
        """The largest angular rate at the start."""
        return float(np.abs(self.scene.rates).max())


@dataclass(frozen=True)
class CaseRow(OfRun):
    """A case, what it did in `duration_s`, and the largest step with which its method holds the scene."""

    case: Case
    run: StabilityRun
    duration_s: float
    stable_dt: float


@dataclass(frozen=True)
class StepRow:
    """What all steps of a method do with a scene. case: the first of them.

    unsettled: whether runs that were stopped or not begun could tell more. bound: whether no larger step was tried that
    could have failed. stable_dt_ratio: over that of the scene's best method.
    """

    case: Case
    adaptive: bool
    substeps: bool
    best_verdict: str
    reason: str
    stable_dt: float
    unbroken_dt: float
    unsettled: bool
    bound: bool
    stable_dt_ratio: float = math.nan

    @property
    def stable_dt_stiffest(self) -> float:
        """The largest stable step times the scene's stiffest frequency, rad."""
        return self.stable_dt * _stiffest(self.case.scene)

    @property
    def holds(self) -> bool:
        """Whether some step holds."""
        return self.best_verdict == "holds"

    @property
    def is_refused(self) -> bool:
        """Whether the engine refuses the scene."""
        return self.best_verdict == "refused"

    @property
    def is_unknown(self) -> bool:
        """Whether it is not known if any step holds."""
        return not self.holds and not self.is_refused and self.unsettled


@dataclass(frozen=True)
class GrowthRow:
    """How a method's largest stable step falls with n over scenes that differ in n alone. case: one of them."""

    case: Case
    n_from: float
    n_to: float
    growth: Growth
    scenes_held: int
    scenes: int


_CASE_VERDICT: Final = text_column("verdict", "verdict", "whether the run was stable", lambda row: row.run.verdict)
_BROKE: Final = Column(
    "broke_s", "s", ".3g", "broke at, s", "when the energy was first astray by more than its scale",
    lambda row: row.run.broke_s,
)  # fmt: skip
_STAYS: Final = Column(
    "stays_s", "s", ".3g", "stays for, s",
    "for a chain released at rest where nothing pulls it: when it had first moved by 0.1 rad, or how long it was run "
    "where it never had",
    lambda row: row.run.stays_s,
)  # fmt: skip
STABLE_DT: Final = Column(
    "stable_dt", "s", ".2g", "largest stable step, s",
    "the largest step that holds, of those tried: known to a tenth; empty where none holds, or where a run with a "
    "larger one was stopped by the study's limits",
)  # fmt: skip
_UNBROKEN: Final = Column(
    "unbroken_dt", "s", ".2g", "largest unbroken step, s",
    "the largest step, of those tried, that holds or drifts, but does not break",
)  # fmt: skip
_STIFFEST: Final = Column(
    "stiffest_rad_per_s", "rad/s", ".3g", "stiffest, rad/s", "the fastest small oscillation about the hanging chain"
)
_FASTEST: Final = Column(
    "fastest_rad_per_s", "rad/s", ".3g", "fastest at the start, rad/s", "the largest angular rate at the start"
)
STABLE_DT_STIFFEST: Final = Column(
    "stable_dt_stiffest", "rad", ".2g", "step times frequency",
    "the largest stable step times stiffest_rad_per_s: near a method's stability limit (2.8 for RK4, 2 for "
    "semi-implicit Euler) where stiffness is what limits the step",
)  # fmt: skip
_RATIO: Final = Column(
    "stable_dt_ratio", "1", ".2g", "of the best", "the largest stable step over that of the scene's best method"
)
EXPONENT: Final = Column(
    "stable_dt_exponent", "1", ".2f", "exponent",
    "p in: largest stable step ~ n^p, by least squares over scenes that differ in n alone",
    lambda row: row.growth.exponent,
)  # fmt: skip
EXPONENT_ERROR: Final = Column(
    "stable_dt_exponent_error", "1", ".2f", "its error", "the standard error of that fit",
    lambda row: row.growth.error,
)  # fmt: skip

_CASES: Final = (
    *common.CASE,
    *common.ENDING,
    common.DURATION.at(lambda row: row.duration_s, "how long the scene is run"),
    # Every kind has these; here energy and rods stand for the first two, and nothing is timed.
    common.HORIZON.without("nothing is compared with a reference"),
    common.ERROR_MAX.without("nothing is compared with a reference"),
    *energy_drift("run"),
    *within("run", common.GAP_MAX),
    _CASE_VERDICT,
    _BROKE,
    _STAYS,
    STABLE_DT,
    *within("run", common.STEPS),
    common.STEP_US.without("nothing is timed"),
    common.RUN.without("nothing is timed"),
)
_SCENES: Final = (*common.SCENE, common.DURATION.at(lambda row: row.duration_s), common.TITLE, _STIFFEST, _FASTEST)
_STEPS: Final = (
    common.SCENE_NAME,
    common.N,
    common.ENGINE,
    common.METHOD,
    common.SETTINGS,
    common.ENDING[1],
    text_column("best_verdict", "best verdict", "the verdict with the best step of all that were tried"),
    STABLE_DT,
    _UNBROKEN,
    text_column(
        "unsettled", "unsettled", "whether runs that the study's limits stopped, or ruled out, could tell more"
    ),
    text_column("substeps", "substeps", "whether the method divides its step as it sees fit"),
    _RATIO,
    STABLE_DT_STIFFEST,
    text_column("adaptive", "adaptive", "whether the method chooses its own steps"),
    text_column("bound", "bound", "whether no larger step was tried that could have failed: the step is a lower bound"),
)
_GROWTH: Final = (
    common.ENGINE,
    common.METHOD,
    common.SETTINGS,
    EXPONENT,
    EXPONENT_ERROR,
    common.N_FROM,
    common.N_TO,
    Column("scenes_held", "1", "d", "scenes held", "of these scenes, those that some step holds"),
    Column("scenes", "1", "d", "scenes", "how many scenes these are"),
)
#: The columns of every table, by its name.
COLUMNS: Final = {
    "cases": _CASES,
    "scenes": _SCENES,
    "stable_steps": _STEPS,
    "growth": _GROWTH,
    "search": _CASES,
}


def tables(results: Results[Found]) -> Sequence[Table]:
    """Every table of the study."""
    found, options = results.found, results.options
    steps = list(step_rows(found, options))
    stable = {row.case.without_step: row.stable_dt for row in steps}

    def rows(runs: Mapping[Case, StabilityRun]) -> Iterator[CaseRow]:
        for case, run in runs.items():
            yield CaseRow(case, run, options.duration_of(case.scene), stable[case.without_step])

    return tables_of(
        COLUMNS,
        {
            "cases": rows(found.runs),
            "scenes": (SceneRow(scene, options.duration_of(scene)) for scene in found.scenes),
            "stable_steps": steps,
            "growth": growth_rows(steps, options.lengths),
            "search": rows(found.searched),
        },
    )


def step_rows(found: Found, options: Options) -> Iterator[StepRow]:
    """A row for each scene and method, in the study's order."""
    runs = [*found.runs.items(), *found.searched.items()]
    rows = [_step_row(own, options) for own in grouped(runs, lambda pair: pair[0].without_step).values()]
    compared = grouped((row for row in rows if row.stable_dt > 0 and not row.substeps), lambda row: row.case.scene.name)
    best = {scene: max(row.stable_dt for row in own) for scene, own in compared.items()}
    for row in rows:
        yield replace(row, stable_dt_ratio=row.stable_dt / best.get(row.case.scene.name, math.nan))


def _step_row(runs: Sequence[tuple[Case, StabilityRun]], options: Options) -> StepRow:
    first, _ = runs[0]
    best = min(runs, key=_goodness)[1]
    tried = {case.dt: run.verdict for case, run in runs if case.dt is not None}
    return StepRow(
        case=first,
        adaptive=first.its_method.adaptive,
        substeps=first.its_method.substeps,
        best_verdict=best.verdict,
        reason=best.reason,
        stable_dt=largest(tried),
        unbroken_dt=largest(tried, ("holds", "drifts")),
        unsettled=not is_known(best.verdict) or is_open(tried, options.bounds_of(first.scene)),
        bound=is_bound(tried),
    )


def _goodness(run: tuple[Case, StabilityRun]) -> tuple[int, float]:
    """Places good verdicts before bad ones, and large steps before small ones."""
    case, found = run
    return rank(found.verdict), -(case.dt or 0.0)


def growth_rows(steps: Sequence[StepRow], lengths: Sequence[str]) -> Iterator[GrowthRow]:
    """A row for each method with a fixed step. A lower bound is no step to fit."""
    over = [row for row in steps if row.case.scene.name in lengths and not row.adaptive]
    for own in grouped(over, pair_of).values():
        known = sorted((row.case.scene.n, row.stable_dt) for row in own if row.stable_dt > 0 and not row.bound)
        n, dt = np.array(known, dtype=np.float64).reshape(-1, 2).T
        low, high = (n[0], n[-1]) if len(n) else (math.nan, math.nan)
        yield GrowthRow(own[0].case, low, high, growth_exponent(n, dt), sum(row.holds for row in own), len(own))


_stiffest = cache(stiffest)
