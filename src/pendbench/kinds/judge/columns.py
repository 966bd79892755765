"""The tables of a study of kind `judge`: a row's values and its columns."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pendbench.engines.protocol import setting_line
from pendbench.engines.registry import engine
from pendbench.kinds.judge.study import Found, Ladder
from pendbench.kinds.judge.work import MAGNIFIED, File, Span, Try
from pendbench.report import columns as common
from pendbench.report.columns import Column, Table, tables_of, text_column, within
from pendbench.report.names import OfRun, OfTruth, engine_of, grouped, scene_of
from pendbench.report.numbers import number_text
from pendbench.scene.scene import Scene
from pendbench.study.case import Case
from pendbench.study.models import Model
from pendbench.study.results import Results
from pendbench.study.timing import UNTIMED, Timed
from pendbench.study.truths import KeptTruth

SUMMARY: Final = ("scene", "engine", "method", "dt", "status", "error_max", "follows_s", "recommended")

#: A small error that grows by more than this is chaos's doing.
_MUCH: Final = 100.0
#: Accelerations that differ by less are the same: less than studies allow, since an error far below theirs may be asked
#: for.
_SAME: Final = 1e-9


@dataclass(frozen=True)
class SceneRow(OfTruth):
    """A scene, how long it is followed, and its truth."""

    scene: Scene
    span: Span
    truth: KeptTruth

    @property
    def until(self) -> float:
        """Up to when runs are compared with the truth, s."""
        return self.span.until

    @property
    def called_for(self) -> str:
        """The effects that act."""
        return ", ".join(self.scene.terms)


@dataclass(frozen=True)
class CaseRow(OfRun):
    """A run, and whether its step is the one that is recommended for its method. timing: only of such."""

    case: Case
    run: Try
    horizon_s: float
    recommended: bool
    timing: Timed


@dataclass(frozen=True)
class MethodRow:
    """What became of a method: the step, or tolerance, that is recommended, with its run and cost; else the best run.

    model: whether its engine simulates the same system. reached: whether something is recommended.
    """

    case: Case
    reached: bool
    run: Try
    timing: Timed
    model: Model
    goal: float

    @property
    def status(self) -> str:
        """How its run ended."""
        return self.run.status

    @property
    def cost_s_per_s(self) -> float:
        """Seconds of one processor for a second of the scene."""
        return 1.0 / self.timing.simulated_s_per_s

    @property
    def verdict(self) -> str:
        """What it is good for, in a few words."""
        if self.run.status == "refused":
            return "refused"
        if self.reached:
            return "good enough"
        return "another system" if self.model.is_another(_SAME) else "not reached"

    @property
    def reason(self) -> str:
        """What stands in the way, where something does."""
        if self.reached or self.run.status != "ok":
            return self.run.reason
        if self.model.is_another(_SAME):
            return f"its accelerations differ from the equations' by {number_text(self.model.error)}"
        return f"its error is {number_text(self.run.error_max)} with the finest step that was tried"

    @property
    def setting(self) -> str:
        """The line that sets this."""
        its = engine(self.case.engine)
        return setting_line(its, self.case.method, self.case.dt, dict(self.case.settings)) if self.reached else ""


@dataclass(frozen=True)
class StandsRow(OfRun):
    """A model file as it stands."""

    file: File
    run: Try
    model: Model
    span: Span

    def pasted(self, line: str) -> str:
        """A line of MuJoCo's own files as this file takes it."""
        return f"<mujoco>{line}</mujoco>" if self.file.path.lower().endswith(".urdf") else line

    @property
    def parted_by(self) -> str:
        """What parts it from the truth."""
        if self.run.stays:
            return ""
        if self.model.is_another(_SAME):
            return "the model"
        return "the step" if self.span.magnified < _MUCH else "the step, and chaos that makes its errors grow"


_FOLLOWS: Final = Column(
    "follows_s", "s", ".3g", "follows for, s",
    "how long the error stays below what is asked for; all of the time that is compared where it never passes it",
    lambda row: row.run.follows_s,
)  # fmt: skip
_ENERGY: Final = Column(
    "energy_error", "energy scale", ".1e", "energy error",
    "how far the energy is from where it should be, at most: from its first value, or, where something damps or "
    "drives, from what that leaves of it",
    lambda row: row.run.energy,
)  # fmt: skip
_COST: Final = Column(
    "cost_s_per_s", "s/s", ".2g", "cost, s per s", "time of one processor for a second of the scene", is_time=True
)
_CASES: Final = (
    *common.CASE,
    *common.ENDING,
    common.HORIZON,
    common.ERROR_MAX.at(lambda row: row.run.error_max, "the largest e(t) up to the end of what is compared"),
    _FOLLOWS,
    _ENERGY,
    *within("run", common.GAP_MAX, common.STEPS),
    text_column("recommended", "recommended", "whether this is what is recommended for its method"),
    *within("timing", common.STEP_US, common.RUN),
)
_METHODS: Final = (
    *common.CASE,
    text_column("verdict", "verdict", "whether it does what is asked for, and with which step at the coarsest"),
    text_column("reason", "reason", "what stands in the way"),
    common.ERROR_MAX.at(lambda row: row.run.error_max, "the largest e(t) with this step"),
    _FOLLOWS,
    _ENERGY,
    common.MODEL_ERROR,
    _COST,
    text_column("setting", "how to set it", "a line to paste: into the engine's own file where it has one"),
)
_SCENES: Final = (
    *common.SCENE,
    common.DURATION,
    common.TITLE,
    text_column("called_for", "effects", "what acts on the chain"),
    Column(
        "compared_s", "s", ".3g", "compared until, s", "up to when runs are compared with the truth",
        lambda row: row.until,
    ),
    Column(
        "magnified", "1", ".2g", "magnified", "how many times larger a small error becomes until then",
        lambda row: row.span.magnified,
    ),
    text_column(
        "why", "ends with",
        f"what ends the time that is compared: the scene, what was asked for, the truth, which is known no longer, or "
        f"chaos, once it has made small errors {MAGNIFIED:.0f} times larger",
        lambda row: row.span.why,
    ),
    common.REFERENCE_ERROR.at(lambda row: row.truth.error),
)  # fmt: skip
_STANDS: Final = (
    text_column("file", "file", "the model file", lambda row: Path(row.file.path).name),
    text_column("integrator", "integrator", "its integrator, as it stands", lambda row: row.file.integrator),
    Column("timestep", "s", ".3g", "step, s", "its step, as it stands", lambda row: row.file.timestep),
    *common.ENDING,
    common.ERROR_MAX.at(lambda row: row.run.error_max, "the largest e(t) up to the end of what is compared"),
    _FOLLOWS,
    _ENERGY,
    common.MODEL_ERROR,
    text_column("parted_by", "parted by", "what parts it from the truth, where it leaves that"),
)
#: The columns of every table, by its name.
COLUMNS: Final = {"cases": _CASES, "methods": _METHODS, "scenes": _SCENES, "as_it_stands": _STANDS}


def tables(results: Results[Found]) -> Sequence[Table]:
    """Every table of the study."""
    found = results.found
    return tables_of(
        COLUMNS,
        {
            "cases": _case_rows(found),
            "methods": sorted(_method_rows(found), key=_place),
            "scenes": _scene_rows(found),
            "as_it_stands": _stands_rows(found),
        },
    )


def _scene_rows(found: Found) -> Iterator[SceneRow]:
    for scene in found.scenes:
        span = found.spans[scene.name]
        yield SceneRow(scene, span, found.truths.get(scene.name, KeptTruth(span.status, span.reason)))


def _stands_rows(found: Found) -> Iterator[StandsRow]:
    if (stands := found.stands) is not None:
        yield StandsRow(stands.file, stands.run, stands.model, found.spans[stands.scene.name])


def _case_rows(found: Found) -> Iterator[CaseRow]:
    for own in found.ladders:
        horizon = found.truths[own.method.scene.name].horizon
        for case, run in own.cases.items():
            yield CaseRow(case, run, horizon, case == own.recommended, found.timings.get(case, UNTIMED))
    for case, fault in found.refusals.items():
        yield CaseRow(case, Try(*fault), math.nan, False, UNTIMED)


def _method_rows(found: Found) -> Iterator[MethodRow]:
    for own in found.ladders:
        case = own.recommended or _best(own)
        timing, model = found.timings.get(case, UNTIMED), found.models[own.method]
        yield MethodRow(case, own.recommended is not None, own.cases[case], timing, model, found.goal)
    for case, fault in found.refusals.items():
        yield MethodRow(case, False, Try(*fault), UNTIMED, Model(*fault), found.goal)


def _best(own: Ladder) -> Case:
    """The run with the smallest error; the last one where none has an error."""
    cases = own.cases
    known = [case for case, run in cases.items() if math.isfinite(run.error_max)]
    return min(known, key=lambda case: cases[case].error_max) if known else list(cases)[-1]


def _place(row: MethodRow) -> tuple[bool, float, float]:
    """The cheapest that is good enough first; then those with the smallest errors."""
    cost, error = row.cost_s_per_s, row.run.error_max
    return not row.reached, cost if row.reached and cost > 0 else math.inf, error if error >= 0 else math.inf


def best_of_engines(methods: Sequence[MethodRow]) -> Mapping[str, Sequence[MethodRow]]:
    """By scene: the best row of each engine that simulates it, the cheapest first."""
    by_scene = grouped((row for row in methods if row.verdict != "refused"), scene_of)
    return {name: [own[0] for own in grouped(rows, engine_of).values()] for name, rows in by_scene.items()}
