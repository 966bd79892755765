"""The kind of study `stability`: where each engine and method holds, drifts or breaks, and up to which step it holds.

It runs every case; then, for each scene and method, steps between the coarsest that holds and the next one, until the
largest stable step is known to a tenth.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Final

from pydantic import Field

from pendbench.base.errors import choose, printable
from pendbench.base.ranges import Step
from pendbench.base.strict import input_error
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import task
from pendbench.kinds.stability.search import Bounds, Tried, next_step
from pendbench.kinds.stability.work import StabilityRun, measure_stability
from pendbench.scene.scene import Scene
from pendbench.study.ask import refused
from pendbench.study.case import Case
from pendbench.study.kernels import compile_kernels
from pendbench.study.plan import Plan
from pendbench.study.study_file import StudyFile

_FEWEST_STEPS: Final = 20  # a run of fewer says nothing about stability


class Options(StudyFile):
    """What a study of kind `stability` asks besides."""

    STEPS: ClassVar[tuple[float, ...]] = (2e-2, 1 / 240, 1e-3)
    ABOUT_SCENES: ClassVar[tuple[str, ...]] = ("durations", "lengths")

    finest: Annotated[float, Step(1e-6, 1.0, "s")] = 1e-5
    """the search for a step that holds goes no further down, s"""
    work: Annotated[float, Field(ge=1e3, le=1e12)] = 1e7
    """nor to runs of more than so many links times steps"""
    durations: dict[str, Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)]] = {}
    """how long a scene is run, s, where that is not its own duration"""
    lengths: list[str] = []
    """scenes that differ in n alone, over which the growth of the largest stable step is fitted"""

    def duration_of(self, scene: Scene) -> float:
        """How long a scene is run, s."""
        return self.durations.get(scene.name, scene.duration)

    def bounds_of(self, scene: Scene) -> Bounds:
        """The steps that may be tried with a scene, were there no limit of work."""
        return Bounds(self.duration_of(scene) / _FEWEST_STEPS, self.finest)

    def allowed(self, scene: Scene) -> Bounds:
        """The steps that the search may try."""
        bounds = self.bounds_of(scene)
        return replace(bounds, finest=max(bounds.finest, scene.n * self.duration_of(scene) / self.work))


@dataclass(frozen=True)
class Found:
    """runs: by case, those that were refused among them. searched: of the search."""

    scenes: tuple[Scene, ...]
    runs: Mapping[Case, StabilityRun]
    searched: Mapping[Case, StabilityRun]


def check(plan: Plan) -> None:
    """Raise InputError where a duration is of no scene of the study or longer than the scene."""
    known = {scene.name: scene for scene in plan.scenes}
    where = f"{plan.where} [durations]"
    for name, duration in plan.options.durations.items():
        if name not in known:
            raise input_error(where, choose("scene", printable(name), known))
        if duration > known[name].duration:
            raise input_error(where, f"{name} is {duration:g}; allowed: up to {known[name].duration:g} s")
    for case in plan.cases:
        most = plan.options.bounds_of(case.scene).coarsest
        if case.dt is not None and case.dt > most * (1 + 1e-9):
            raise input_error(plan.where, f"{case}: allowed: dt up to {most:g} s, for {_FEWEST_STEPS} steps")
    for name in plan.options.lengths:
        if name not in known:
            raise input_error(plan.where, f"lengths: {choose('scene', printable(name), known)}")


def measure(plan: Plan, runner: Runner) -> Found:
    """Run the study."""
    refusals = refused(runner, plan.cases)
    accepted = [case for case in plan.cases if case not in refusals]
    compile_kernels(runner, (), accepted, truth=False)
    runs = _judged(runner, "cases", accepted, plan.options)
    searched = dict(_searched(runner, runs, plan.options))
    runs |= {case: StabilityRun(*fault) for case, fault in refusals.items()}
    return Found(plan.scenes, {case: runs[case] for case in plan.cases}, searched)


def _judged(runner: Runner, stage: str, cases: Iterable[Case], options: Options) -> dict[Case, StabilityRun]:
    """What cases do, the longest begun first: a long one begun last would leave workers idle."""

    def effort(case: Case) -> float:  # in links times steps; methods that choose their steps are quick
        return 0.0 if case.dt is None else case.scene.n * options.duration_of(case.scene) / case.dt

    ordered = sorted(cases, key=effort, reverse=True)
    return runner.run(stage, {case: task(measure_stability, case, options.duration_of(case.scene)) for case in ordered})


def _searched(
    runner: Runner, runs: Mapping[Case, StabilityRun], options: Options
) -> Iterator[tuple[Case, StabilityRun]]:
    """The runs of the search, one step of every scene and method at a time."""
    tried: dict[Case, dict[float, str]] = {}
    for case, run in runs.items():
        if case.dt is not None:
            tried.setdefault(case.without_step, {})[case.dt] = run.verdict
    number = 0
    while asked := list(_asked(tried, options)):
        number += 1
        for case, run in _judged(runner, f"search, round {number}", asked, options).items():
            tried[case.without_step][case.dt or 0.0] = run.verdict
            yield case, run


def _asked(tried: Mapping[Case, Tried], options: Options) -> Iterator[Case]:
    for method, own in tried.items():
        if (dt := next_step(own, options.allowed(method.scene))) is not None:
            yield replace(method, dt=dt)
