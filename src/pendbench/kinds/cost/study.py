"""The kind of study `cost`: what accuracy costs in time.

It finds the truth of each scene; runs every case against it; follows the energy in long runs, for what drifts; and,
alone on the machine, measures what each case costs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final

import numpy as np
from pydantic import Field

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import choose, printable
from pendbench.base.ranges import Step
from pendbench.base.strict import input_error
from pendbench.engines.arguments import on_steps
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import task
from pendbench.kinds.cost.work import ErrorRun, LongRun, measure_error, measure_long_run
from pendbench.scene.scene import Scene
from pendbench.scene.toml_file import Table
from pendbench.study.ask import refused
from pendbench.study.case import Case
from pendbench.study.kernels import compile_kernels
from pendbench.study.plan import Plan
from pendbench.study.study_file import StudyFile
from pendbench.study.timing import UNTIMED, Timed, measure_timing_with_states
from pendbench.study.truths import KeptTruth, measure_truth

_ACCURACIES: Final = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
# Of a scene without a window: where its horizon is looked for, what share of it is the window, its samples; s.
_HORIZON_TIMES: Final = 200
_SHARE: Final = 0.2
_SAMPLES: Final = 50
_LONGEST: Final = 1e6


class Window(Table):
    """[windows.NAME]: over what the errors of a scene are compared."""

    time: Annotated[float, Field(gt=0, le=_LONGEST, allow_inf_nan=False)]
    """up to when, s"""
    samples: Annotated[int, Field(ge=1, le=100_000)]
    """so many evenly spaced times, each on a whole step of the case"""


class LongRuns(Table):
    """[long_runs]: the energy over many steps, of every method with a fixed step."""

    scenes: Annotated[list[str], Field(min_length=1)]
    """in which scenes"""
    steps: Annotated[int, Field(ge=1000, le=10**9)]
    """how many steps"""
    dt: Annotated[float, Step(1e-6, 1e3, "s")]
    """of what length, s"""


class Options(StudyFile):
    """What a study of kind `cost` asks besides."""

    STEPS: ClassVar[tuple[float, ...]] = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4)
    TOLERANCES: ClassVar[tuple[float, ...]] = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
    ABOUT_SCENES: ClassVar[tuple[str, ...]] = ("windows", "long_runs")

    windows: dict[str, Window] = {}
    """for each scene a table; 50 samples up to a fifth of the scene's horizon where it has none"""
    accuracies: Annotated[list[Annotated[float, Field(gt=0, lt=1)]], Field(min_length=1)] = list(_ACCURACIES)
    """the errors, in lengths of the chain, whose price is asked for"""
    long_runs: LongRuns | None = None
    """long runs, where they are asked for"""


def check(plan: Plan) -> None:
    """Raise InputError where a window is longer than its scene, or shorter than a step."""
    names = [scene.name for scene in plan.scenes]
    windows, long_runs = plan.options.windows, plan.options.long_runs
    for scene in plan.scenes:
        if scene.name in windows and windows[scene.name].time > scene.duration:
            found, most = windows[scene.name].time, scene.duration
            raise input_error(f"{plan.where} [windows.{scene.name}]", f"time is {found:g}; allowed: up to {most:g} s")
    for case in plan.cases:
        most = windows[case.scene.name].time if case.scene.name in windows else case.scene.duration
        if case.dt is not None and case.dt > most:
            raise input_error(plan.where, f"{case}: allowed: dt up to {most:g} s, the time that is compared")
    for name in long_runs.scenes if long_runs else ():
        if name not in names:
            raise input_error(f"{plan.where} [long_runs]", f"scenes: {choose('scene', printable(name), names)}")


@dataclass(frozen=True)
class Found:
    """windows, truths: by scene. runs, timings: by case, those that were refused among them. long_runs: by case."""

    scenes: tuple[Scene, ...]
    windows: Mapping[str, Window]
    accuracies: tuple[float, ...]
    truths: Mapping[str, KeptTruth]
    runs: Mapping[Case, ErrorRun]
    timings: Mapping[Case, Timed]
    long_runs: Mapping[Case, LongRun]


def measure(plan: Plan, runner: Runner) -> Found:
    """Run the study."""
    options = plan.options
    refusals = refused(runner, plan.cases)
    accepted = [case for case in plan.cases if case not in refusals]
    compile_kernels(runner, plan.scenes, accepted)
    windows = _windows(plan, runner)
    truths = {
        scene.name: task(measure_truth, scene, _truth_times(plan, scene, windows[scene.name])) for scene in plan.scenes
    }
    known = runner.run("the truth", truths)
    times = {case: times_of(case, windows[case.scene.name]) for case in accepted}
    runs = runner.run(
        "the errors", {case: task(measure_error, case, times[case], needs=(truths[case.scene.name],)) for case in times}
    )
    long = {case: task(measure_long_run, case, options.long_runs.steps) for case in _long_cases(accepted, options)}
    long_runs = runner.run("long runs", long)
    timings = _timings(windows, runner, runs)
    runs |= {case: ErrorRun(*fault) for case, fault in refusals.items()}
    return Found(
        plan.scenes,
        windows,
        tuple(options.accuracies),
        known,
        {case: runs[case] for case in plan.cases},
        {case: timings.get(case, UNTIMED) for case in plan.cases},
        long_runs,
    )


def times_of(case: Case, window: Window) -> FloatArray:
    """The times at which a case is compared: the window's samples, each on a whole step of the case."""
    times = np.linspace(0.0, window.time, window.samples + 1)
    return times if case.dt is None else on_steps(times, case.dt, case.scene.duration)


def _windows(plan: Plan, runner: Runner) -> dict[str, Window]:
    """The windows by scene. Where the study has none, errors grow so little in a fifth of the horizon that the best
    methods can be told apart.
    """
    missing = [scene for scene in plan.scenes if scene.name not in plan.options.windows]
    times = {scene.name: np.linspace(0.0, scene.duration, _HORIZON_TIMES + 1) for scene in missing}
    tasks = {scene.name: task(measure_truth, scene, times[scene.name]) for scene in missing}
    truths = runner.run("the horizons", tasks) if tasks else {}
    windows = dict(plan.options.windows)
    for scene in missing:
        coarsest = max((case.dt for case in plan.cases if case.scene is scene and case.dt is not None), default=0.0)
        horizon = truths[scene.name].horizon if truths[scene.name].horizon > 0 else scene.duration
        windows[scene.name] = Window(time=min(max(_SHARE * horizon, coarsest), _LONGEST), samples=_SAMPLES)
    return windows


def _truth_times(plan: Plan, scene: Scene, window: Window) -> FloatArray:
    """The very times at which the scene's cases are compared."""
    own = [times_of(case, window) for case in plan.cases if case.scene is scene]
    return np.unique(np.concatenate([[0.0, window.time], *own]))


def _long_cases(accepted: Sequence[Case], options: Options) -> Iterator[Case]:
    """Each method with a fixed step that the study names, with its default settings."""
    asked = options.long_runs
    for case in accepted:
        if asked is not None and case.dt is not None and case.scene.name in asked.scenes:
            yield Case(case.scene, case.engine, case.method, asked.dt)


def _timings(windows: Mapping[str, Window], runner: Runner, runs: Mapping[Case, ErrorRun]) -> dict[Case, Timed]:
    """What the cases cost that ended well: how quickly a run fails is not what it costs."""
    tasks = {}
    for case, run in runs.items():
        if run.status == "ok":
            window = windows[case.scene.name]
            tasks[case] = task(measure_timing_with_states, case, window.time, window.time / window.samples)
    return runner.run("the clock, one at a time", tasks, alone=True)
