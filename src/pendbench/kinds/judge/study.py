"""The kind of study `judge`: how far can an engine be trusted with this chain, and what should be set?

Its stages, in order: how long chaos lets anybody follow the scene; the truth until then; what engines refuse; every
method with finer and finer steps, until its error is what is asked for or that is out of reach; whether each engine
simulates the same system; and what the steps that are recommended cost.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from pendbench.base.arrays import FloatArray
from pendbench.base.faults import Fault
from pendbench.base.strict import input_error
from pendbench.engines.protocol import Method
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import Task, task
from pendbench.kinds.judge import ladder
from pendbench.kinds.judge.work import (
    SEED,
    File,
    Span,
    Try,
    compared_times,
    file_times,
    measure_file,
    measure_file_model,
    measure_span,
    measure_try,
    read_file,
    within_truth,
)
from pendbench.scene.scene import Scene
from pendbench.study.ask import refused
from pendbench.study.case import TOLERANCE, Case
from pendbench.study.kernels import compile_kernels
from pendbench.study.models import Model, measure_model
from pendbench.study.plan import Plan
from pendbench.study.study_file import StudyFile
from pendbench.study.timing import Timed, measure_timing
from pendbench.study.truths import KeptTruth, measure_truth


class Options(StudyFile):
    """What a study of kind `judge` asks besides. The steps of its engines are chosen by the study."""

    STEPS: ClassVar[tuple[float, ...]] = (1e-6,)  # one for each method, which stands for all that are tried

    error: Annotated[float, Field(ge=1e-12, le=0.5)] = 1e-3
    """the error that is asked for, in lengths of the chain"""
    until: Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)] | None = None
    """up to when, s; by default to the scene's end, or to where chaos has made small errors a thousand times larger"""
    file: str | None = None
    """a MuJoCo or URDF file that is run as it stands besides: the one that the study's only scene is from"""


@dataclass(frozen=True)
class Ladder:
    """A method of an engine for a scene, and what its runs over a span showed, by rung; coarse to fine."""

    method: Case
    span: Span
    goal: float
    tries: Mapping[int, Try] = field(default_factory=dict)

    @property
    def recommended(self) -> Case | None:
        """The coarsest step, or the loosest tolerance, that is good enough."""
        rung = ladder.recommended(self._errors, self.goal, self._last)
        return None if rung is None else self.case(rung)

    @property
    def next_rung(self) -> int | None:
        """What to try next; None where nothing is left to try."""
        if self.tries and self.tries[max(self.tries)].status in ("timed out", "out of memory"):
            return None  # a finer one would be stopped, too
        return ladder.next_rung(self._errors, self.goal, self._last)

    def case(self, rung: int) -> Case:
        """The case that a rung stands for."""
        if not self._method.adaptive:
            return replace(self.method, dt=ladder.step(self.span.interval, rung))
        if TOLERANCE not in self._method.settings:
            return self.method
        settings = (*self.method.settings, (TOLERANCE, ladder.tolerance(rung)))
        return replace(self.method, settings=tuple(sorted(settings)))

    @property
    def cases(self) -> dict[Case, Try]:
        """All that was run."""
        return {self.case(rung): found for rung, found in self.tries.items()}

    @property
    def _method(self) -> Method:
        return self.method.its_method

    @property
    def _errors(self) -> dict[int, float]:
        return {rung: found.error_max for rung, found in self.tries.items()}

    @property
    def _last(self) -> int:
        if not self._method.adaptive:
            return ladder.last_rung(self.method.scene.n, self.span.until, self.span.interval)
        return ladder.last_tolerance() if TOLERANCE in self._method.settings else 0


@dataclass(frozen=True)
class Stands:
    """A model file as it stands: how its run went, and whether it is the same system."""

    file: File
    scene: Scene
    run: Try
    model: Model


@dataclass(frozen=True)
class Found:
    """spans, truths: by scene. ladders: of every method that was not refused. models: by method. timings: by the case
    that is recommended. stands: of the file, where there is one.
    """

    scenes: tuple[Scene, ...]
    goal: float
    spans: Mapping[str, Span]
    truths: Mapping[str, KeptTruth]
    refusals: Mapping[Case, Fault]
    ladders: tuple[Ladder, ...]
    models: Mapping[Case, Model]
    timings: Mapping[Case, Timed]
    stands: Stands | None = None


def check(plan: Plan) -> None:
    """Raise InputError where a file is to be run as it stands beside several scenes."""
    if plan.options.file is not None and len(plan.scenes) != 1:
        raise input_error(plan.where, "file is given with several scenes; allowed: the one scene that it is read as")


def measure(plan: Plan, runner: Runner) -> Found:
    """Run the study."""
    goal = plan.options.error
    asked = {scene.name: task(measure_span, scene, plan.options.until) for scene in plan.scenes}
    spans = runner.run("how long it can be followed", asked)
    methods = tuple(dict.fromkeys(case.without_tolerance.without_step for case in plan.cases))
    refusals = refused(runner, methods)
    followed = [scene for scene in plan.scenes if spans[scene.name].until > 0]
    accepted = [case for case in methods if case not in refusals and case.scene in followed]
    compile_kernels(runner, followed, accepted)
    file = None if plan.options.file is None else read_file(plan.options.file)
    truths = {scene.name: task(measure_truth, scene, _truth_times(spans[scene.name], file)) for scene in followed}
    known = runner.run("the truth", truths)
    spans.update({name: within_truth(spans[name], truth) for name, truth in known.items()})
    stands = None
    if file is not None and (own := plan.scenes[0].name) in known and spans[own].until > 0:
        stands = _measure_stands(plan, runner, file, spans[own], truths[own])
    tried = [case for case in accepted if _tells(spans[case.scene.name], known[case.scene.name])]
    models = runner.run("whether it is the same system", {case: task(measure_model, case, SEED) for case in tried})
    ladders = _climbed(runner, [Ladder(case, spans[case.scene.name], goal) for case in tried], truths)
    best = {own.recommended: own.span.until for own in ladders if own.recommended}
    clock = {case: task(measure_timing, case, until) for case, until in best.items()}
    timings = runner.run("the clock, one at a time", clock, alone=True)
    return Found(plan.scenes, goal, spans, known, refusals, tuple(ladders), models, timings, stands)


def _tells(span: Span, truth: KeptTruth) -> bool:
    """Whether an error says anything: there is a truth, and it moves."""
    return span.until > 0 and not truth.is_still


def _truth_times(span: Span, file: File | None) -> FloatArray:
    times = compared_times(span)
    return times if file is None else np.union1d(times, file_times(span, file.timestep))


def _measure_stands(plan: Plan, runner: Runner, file: File, span: Span, truth: Task[KeptTruth]) -> Stands:
    """The file as it stands."""
    scene = plan.scenes[0]
    run = task(measure_file, file, scene, file_times(span, file.timestep), plan.options.error, needs=(truth,))
    found: dict[str, Any] = runner.run(
        "the file as it stands", {"run": run, "model": task(measure_file_model, file, scene)}
    )
    return Stands(file, scene, found["run"], found["model"])


def _climbed(runner: Runner, ladders: list[Ladder], truths: Mapping[str, Task[KeptTruth]]) -> list[Ladder]:
    """Every method with a finer step in each round, until there is nothing left to try."""
    number = 0
    while rungs := {at: own.next_rung for at, own in enumerate(ladders) if own.next_rung is not None}:
        number += 1
        tasks = {at: _try(ladders[at], rung, truths) for at, rung in rungs.items()}
        for at, found in runner.run(f"steps, round {number}", tasks).items():
            own = ladders[at]
            ladders[at] = replace(own, tries={**own.tries, rungs[at]: found})
    return ladders


def _try(own: Ladder, rung: int, truths: Mapping[str, Task[KeptTruth]]) -> Task[Try]:
    needs = (truths[own.method.scene.name],)
    return task(measure_try, own.case(rung), compared_times(own.span), own.goal, needs=needs)
