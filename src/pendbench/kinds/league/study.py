"""The kind of study `league`: all engines on the same few scenes, as they come and at their best.

Its stages, in order: what engines refuse; the kernels; the truth of each scene; every method with every step that is
affordable; and, one at a time, what it costs as it comes, and with the coarsest step of each method that is accurate
enough.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, Final

import numpy as np
from pydantic import Field

from pendbench.base.errors import choose, printable
from pendbench.base.strict import input_error
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import Task, task
from pendbench.kinds.league.settings import LeagueTable, league_tables
from pendbench.kinds.league.work import LeagueRun, compared_times, measure_run
from pendbench.scene.scene import Scene
from pendbench.study.ask import refused
from pendbench.study.case import Case
from pendbench.study.kernels import compile_kernels
from pendbench.study.plan import Plan
from pendbench.study.study_file import EngineTable, StudyFile
from pendbench.study.timing import Timed, measure_timing
from pendbench.study.truths import KeptTruth, measure_truth

#: The error at which a run has left the truth, in lengths of the chain.
LEAVES: Final = 0.01
#: How many times a run's limit of processor time a truth may take: all engines are judged by it.
TRUTH_SHARE: Final = 10.0
#: This project's own engine: a host should not be its own contestant, so there is a table without it.
OWN: Final = "analytic"


class Options(StudyFile):
    """What a study of kind `league` asks besides. Where it names no engines, the files in studies/league/ do."""

    STEPS: ClassVar[tuple[float, ...]] = tuple(1 / 20 / 2**i for i in range(10))
    ABOUT_SCENES: ClassVar[tuple[str, ...]] = ("durations", "challenge")
    LOADED_APART: ClassVar[bool] = True

    engines: Annotated[list[LeagueTable], Field(min_length=1)] | None = None  # type: ignore[assignment]
    """what is run in each scene: see [[engines]]"""
    error: Annotated[float, Field(ge=1e-12, le=0.5)] = 1e-3
    """the accuracy whose cost is asked for, in lengths of the chain"""
    early: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)] = 1.0
    """for how long it is asked for, s; to the scene's end where that is sooner"""
    sample: Annotated[float, Field(gt=0, le=1e3, allow_inf_nan=False)] = 0.05
    """about how far the times that are compared lie apart, s"""
    work: Annotated[float, Field(ge=1e2, le=1e12)] = 2e5
    """a run of more links times steps is not tried at all"""
    durations: dict[str, Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)]] = {}
    """how long a scene is run, s, where that is not its own duration"""
    challenge: list[str] = []
    """scenes of the Pendulum Challenge, of which the page has a section"""

    @classmethod
    def default_engines(cls, named: Sequence[str]) -> Sequence[EngineTable]:
        """What the files of the engines say; `named` adds nothing."""
        del named
        return list(league_tables())

    def duration_of(self, scene: Scene) -> float:
        """How long a scene is run, s."""
        return self.durations.get(scene.name, scene.duration)

    def early_of(self, scene: Scene) -> float:
        """Up to when the accuracy is asked for, s."""
        return min(self.early, self.duration_of(scene))

    def affords(self, case: Case) -> bool:
        """Whether a case is no more work than allowed."""
        return case.dt is None or case.scene.n * self.duration_of(case.scene) / case.dt <= self.work * (1 + 1e-9)


@dataclass(frozen=True)
class Found:
    """truths: by scene. standard: the cases that are run as they come. runs: by case, those refused among them.
    timings: of those as they come, and of the coarsest of each method that is accurate enough. absent: engines that
    were left out, and why.
    """

    scenes: tuple[Scene, ...]
    truths: Mapping[str, KeptTruth]
    standard: frozenset[Case]
    runs: Mapping[Case, LeagueRun]
    timings: Mapping[Case, Timed]
    absent: Mapping[str, str] = field(default_factory=dict)


def check(plan: Plan) -> None:
    """Raise InputError where a key names no scene, a duration is too long, or an engine comes in two ways."""
    known = {scene.name: scene for scene in plan.scenes}
    for key in ("durations", "challenge"):
        for name in getattr(plan.options, key):
            if name not in known:
                raise input_error(plan.where, f"{key}: {choose('scene', printable(name), known)}")
    for name, duration in plan.options.durations.items():
        if duration > known[name].duration:
            where = f"{plan.where} [durations]"
            raise input_error(where, f"{name} is {duration:g}; allowed: up to {known[name].duration:g} s")
    seen: set[str] = set()
    for number, table in enumerate(plan.options.engines, 1):
        if not table.as_it_comes:
            continue
        if table.name in seen or len(table.methods or ()) != 1 or len(table.dt or (0.0,)) != 1:
            said = "as_it_comes is true; allowed: for one table of an engine, of one method with one step"
            raise input_error(table.place(plan.where, number), said)
        seen.add(table.name)


def measure(plan: Plan, runner: Runner) -> Found:
    """Run the study."""
    options = plan.options
    standard = frozenset(_standard(plan))
    cases = [case for case in plan.cases if case in standard or options.affords(case)]
    refusals = refused(runner, cases)
    accepted = sorted((case for case in cases if case not in refusals), key=lambda case: _effort(case, options))
    compile_kernels(runner, plan.scenes, accepted)
    truths = {
        scene.name: task(measure_truth, *_truth_of(scene, cases, options), share=TRUTH_SHARE) for scene in plan.scenes
    }
    known = runner.run("the truth", truths)
    ran = runner.run("the engines", {case: _run(case, options, truths) for case in accepted})
    runs = ran | {case: LeagueRun(*fault) for case, fault in refusals.items()}
    timed = _to_time(ran, standard, options.error)
    clock = {case: task(measure_timing, case, options.early_of(case.scene)) for case in timed}
    timings = runner.run("the clock, one at a time", clock, alone=True)
    return Found(plan.scenes, known, standard, {case: runs[case] for case in cases}, timings, plan.absent)


def _standard(plan: Plan) -> Iterator[Case]:
    """The cases that are run as they come. Where no table says which, an engine's first."""
    told = [table for table in plan.options.engines if table.as_it_comes]
    first: dict[tuple[str, str], Case] = {}
    for case in plan.cases:
        first.setdefault((case.scene.name, case.engine), case)
        if any(_is_of(case, table) for table in told):
            yield case
    yield from (case for case in first.values() if case.engine not in {table.name for table in told})


def _is_of(case: Case, table: LeagueTable) -> bool:
    [method] = table.methods or [""]
    told = (table.name, method, table.dt[0] if table.dt else None, tuple(sorted((table.model_extra or {}).items())))
    return (case.engine, case.method, case.dt, case.settings) == told


def _effort(case: Case, options: Options) -> float:
    """Long runs are begun first: one begun last would leave workers idle. Methods that choose their steps are quick."""
    return 0.0 if case.dt is None else -case.scene.n * options.duration_of(case.scene) / case.dt


def _truth_of(scene: Scene, cases: Sequence[Case], options: Options) -> tuple[Scene, np.ndarray]:
    """The scene as long as it is run, and the very times at which its cases are compared."""
    own = {case.dt for case in cases if case.scene.name == scene.name} | {None}
    duration = options.duration_of(scene)
    times = [compared_times(dt, duration, options.sample) for dt in sorted(own, key=lambda dt: dt or 0.0)]
    return replace(scene, duration=duration), np.unique(np.concatenate(times))


def _run(case: Case, options: Options, truths: Mapping[str, Task[KeptTruth]]) -> Task[LeagueRun]:
    times = compared_times(case.dt, options.duration_of(case.scene), options.sample)
    early = options.early_of(case.scene)
    return task(measure_run, case, times, early, LEAVES, needs=(truths[case.scene.name],))


def _to_time(runs: Mapping[Case, LeagueRun], standard: frozenset[Case], goal: float) -> Iterator[Case]:
    """What is run as it comes, and of each method the coarsest that is accurate enough."""
    methods: dict[Case, list[Case]] = {}
    for case in runs:
        methods.setdefault(case.without_step.without_tolerance, []).append(case)
    chosen = {case for case in runs if case in standard}
    for own in methods.values():
        if (enough := coarsest_enough({case: runs[case] for case in own}, goal)) is not None:
            chosen.add(enough)
    return (case for case in runs if case in chosen)


def coarsest_enough(runs: Mapping[Case, LeagueRun], goal: float) -> Case | None:
    """Of the cases of a method, the coarsest that is accurate enough as are all finer ones that were tried.

    A coarse step can be good by chance: two errors cancel.
    """
    found = None
    for case in sorted(runs, key=lambda case: case.dt or case.tolerance or 0.0):
        if not runs[case].error_early <= goal:
            break
        found = case
    return found
