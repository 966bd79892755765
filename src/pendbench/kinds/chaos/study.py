"""The kind of study `chaos`: how long does each engine stay with the truth, and why does it leave it?

Its stages, in order: what engines refuse; the kernels; the truth of every start, and the scenes' Lyapunov exponents;
every case from every start against it; the causes; and, one at a time when nothing else runs, what each case costs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field

from pendbench.base.faults import Fault
from pendbench.base.strict import input_error
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import Task, task
from pendbench.kinds.chaos.work import (
    ChaosRun,
    KeptExponent,
    Neighbour,
    compared_times,
    measure_exponent,
    measure_neighbour,
    measure_run,
)
from pendbench.scene.scene import Scene
from pendbench.study.ask import refused
from pendbench.study.case import Case
from pendbench.study.kernels import compile_kernels
from pendbench.study.models import Model, measure_model
from pendbench.study.plan import Plan
from pendbench.study.study_file import StudyFile
from pendbench.study.timing import Timed, measure_timing
from pendbench.study.truths import KeptTruth, measure_truth

_MOST_SAMPLES: Final = 1e6


class Options(StudyFile):
    """What a study of kind `chaos` asks besides."""

    starts: Annotated[int, Field(ge=0, le=10_000)] = 8
    """how many perturbed starts beside the scene's own"""
    perturbation: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.01
    """the standard deviation of their angles, rad"""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    """of the random numbers"""
    sample: Annotated[float, Field(gt=0, le=1e3, allow_inf_nan=False)] = 0.01
    """about how far the times that are compared lie apart, s"""
    order_time: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)] = 0.5
    """up to when errors are taken that show an order, s"""
    lyapunov_time: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)] = 200.0
    """over how long the Lyapunov exponent is measured, s"""


@dataclass(frozen=True)
class Found:
    """truths: by scene, of each start; the first is the scene's own. exponents, neighbours: by scene. runs: by case,
    from each start. models, orders: by method, which is a case without its step; an order is the one claimed by its
    makers, None where the method chooses its steps. What was refused has no runs, no model and no timing.
    """

    cases: tuple[Case, ...]
    scenes: tuple[Scene, ...]
    truths: Mapping[str, Sequence[KeptTruth]]
    exponents: Mapping[str, KeptExponent]
    neighbours: Mapping[str, Neighbour]
    refusals: Mapping[Case, Fault]
    runs: Mapping[Case, Sequence[ChaosRun]]
    models: Mapping[Case, Model]
    orders: Mapping[Case, int | None]
    timings: Mapping[Case, Timed]


#: By scene: its starts. By scene and start: how to find the truth.
Starts = Mapping[str, Sequence[Scene]]
Truths = Mapping[tuple[str, int], Task[KeptTruth]]


def starts_of(scene: Scene, options: Options) -> list[Scene]:
    """The scene, and the scene from each perturbed start."""
    random = np.random.default_rng([options.seed, scene.n])
    changes = options.perturbation * random.standard_normal((options.starts, scene.n))
    return [scene, *(scene.with_start(scene.angles + change, scene.rates) for change in changes)]


def check(plan: Plan) -> None:
    """Raise InputError where the samples would be too many."""
    for scene in plan.scenes:
        sample, lasts = plan.options.sample, scene.duration
        if lasts / sample > _MOST_SAMPLES:
            allowed = f"from {lasts / _MOST_SAMPLES:.3g} s, for the {lasts:g} s of scene {scene.name!r}"
            other = f"or a scene of up to {sample * _MOST_SAMPLES:g} s"
            raise input_error(plan.where, f"sample is {sample:g}; allowed: {allowed}, {other}")


def measure(plan: Plan, runner: Runner) -> Found:
    """Run the study."""
    asked = {case.scene.name for case in plan.cases}  # where not all engines are, some scenes may not be
    scenes = tuple(scene for scene in plan.scenes if scene.name in asked)
    starts = {scene.name: starts_of(scene, plan.options) for scene in scenes}
    refusals = refused(runner, plan.cases)
    accepted = [case for case in plan.cases if case not in refusals]
    compile_kernels(runner, scenes, accepted)
    truths = _truths(plan, starts)
    known = _measure_truths(plan, runner, scenes, truths)
    runs = runner.run("the engines", _runs(plan, accepted, starts, truths))
    causes = _measure_causes(plan, runner, accepted, scenes, truths)
    timings = {case: task(measure_timing, case, _timed_until(case, known[case.scene.name, 0])) for case in accepted}
    return Found(
        cases=plan.cases,
        scenes=scenes,
        truths={name: [known[name, at] for at in range(len(own))] for name, own in starts.items()},
        exponents={scene.name: known[scene.name] for scene in scenes},
        neighbours={scene.name: causes[scene.name] for scene in scenes},
        refusals=refusals,
        runs={case: [runs[case, at] for at in range(len(starts[case.scene.name]))] for case in accepted},
        models={method: causes[method] for method in _methods(accepted)},
        orders={method: method.order_claimed for method in _methods(plan.cases)},
        timings=runner.run("the clock, one at a time", timings, alone=True),
    )


def _truths(plan: Plan, starts: Starts) -> Truths:
    """Of each start, at the very times at which the scene's cases are compared."""
    tasks: dict[tuple[str, int], Task[KeptTruth]] = {}
    for name, own in starts.items():
        cases = [case for case in plan.cases if case.scene.name == name]
        times = np.unique(np.concatenate([compared_times(case, plan.options.sample) for case in cases]))
        tasks |= {(name, at): task(measure_truth, start, times) for at, start in enumerate(own)}
    return tasks


def _measure_truths(plan: Plan, runner: Runner, scenes: Sequence[Scene], truths: Truths) -> dict[Any, Any]:
    """The truths by scene and start, and the exponents by scene: side by side, since both take long."""
    seconds = plan.options.lyapunov_time
    exponents = {scene.name: task(measure_exponent, scene, seconds) for scene in scenes}
    return runner.run("the truth", {**truths, **exponents})


def _runs(
    plan: Plan, accepted: Sequence[Case], starts: Starts, truths: Truths
) -> dict[tuple[Case, int], Task[ChaosRun]]:
    """Each case from each start; curves are kept of the first, the scene's own."""
    options, tasks = plan.options, {}
    for case in accepted:
        times = compared_times(case, options.sample)
        for at, start in enumerate(starts[case.scene.name]):
            needs = (truths[case.scene.name, at],)
            tasks[case, at] = task(measure_run, case, start, times, options.order_time, at == 0, needs=needs)
    return tasks


def _measure_causes(
    plan: Plan, runner: Runner, accepted: Sequence[Case], scenes: Sequence[Scene], truths: Truths
) -> dict[Any, Any]:
    """The models by method, and the neighbours by scene."""
    models = {method: task(measure_model, method, plan.options.seed) for method in _methods(accepted)}
    neighbours = {scene.name: task(measure_neighbour, scene, needs=(truths[scene.name, 0],)) for scene in scenes}
    return runner.run("the causes", {**models, **neighbours})


def _methods(cases: Sequence[Case]) -> list[Case]:
    """The methods of the cases, which are cases without a step."""
    return list(dict.fromkeys(case.without_step for case in cases))


def _timed_until(case: Case, truth: KeptTruth) -> float:
    """The horizon, s; the scene's end where there is none."""
    return truth.horizon if truth.horizon > 0 else case.scene.duration
