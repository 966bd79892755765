"""The kind of study `effects`: how well each engine simulates each effect, and what the effect costs it.

It finds the truth of each scene; runs every case against it, with the balance of its energy; then, alone on the
machine, measures the cost of a step of one chain with one effect at a time against that of the bare chain.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.ranges import Step
from pendbench.base.strict import input_error, show
from pendbench.engines.registry import engine
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import Task, task
from pendbench.kinds.effects.work import EffectRun, Price, Prices, compared_times, measure_effect, measure_prices
from pendbench.scene.scene import Scene
from pendbench.study.ask import refused
from pendbench.study.case import Case
from pendbench.study.kernels import compile_kernels
from pendbench.study.plan import Plan
from pendbench.study.study_file import StudyFile
from pendbench.study.truths import KeptTruth, measure_truth

#: The chain with nothing but gravity, and with all effects of the scene at once, in the tables of prices.
BARE: Final = "bare"
ALL: Final = "all"
#: The bare chain with what the engine has on by itself, where that can be asked for.
DEFAULTS: Final = "bare, default flags"

_NOISY: Final = 0.25


class Options(StudyFile):
    """What a study of kind `effects` asks besides."""

    STEPS: ClassVar[tuple[float, ...]] = (2e-3, 1e-3, 5e-4)
    ABOUT_SCENES: ClassVar[tuple[str, ...]] = ("priced",)

    priced: str | None = None
    """the name of one of the scenes, whose effects are priced one at a time; the first that has any by default"""
    price_step: Annotated[float, Step(1e-6, 1.0, "s")] = 1e-4
    """with which step, s"""


@dataclass(frozen=True)
class Priced:
    """The price of one effect with an engine's method: the case that was timed, how that went, and what it costs."""

    case: Case
    effect: str
    status: str
    reason: str
    price: Price

    @property
    def measured(self) -> bool:
        """Whether there is a price."""
        return self.status == "ok" and self.price.ratio > 0

    @property
    def noisy(self) -> bool:
        """Whether its rounds differ by more than a quarter of it: then it is not worth its digits."""
        return self.price.spread > _NOISY * self.price.ratio


@dataclass(frozen=True)
class Found:
    """truths: by scene. runs: by case, those that were refused among them."""

    scenes: tuple[Scene, ...]
    truths: Mapping[str, KeptTruth]
    runs: Mapping[Case, EffectRun]
    prices: tuple[Priced, ...]


def check(plan: Plan) -> None:
    """Raise InputError where the scene to price is none of the study's, or has no effect to price."""
    allowed = list(_with_effects(plan.scenes))
    one = f"one of its scenes with more than gravity ({', '.join(allowed) or 'there is none'})"
    if not allowed:
        raise input_error(plan.where, f"scenes has none with an effect to price; allowed: at least {one}")
    if plan.options.priced not in (*allowed, None):
        raise input_error(plan.where, f"priced is {show(plan.options.priced)}; allowed: {one}")


def _with_effects(scenes: Sequence[Scene]) -> dict[str, Scene]:
    """The scenes with more than gravity, by name."""
    return {scene.name: scene for scene in scenes if not scene.terms.keys() <= {"gravity"}}


def measure(plan: Plan, runner: Runner) -> Found:
    """Run the study."""
    refusals = refused(runner, plan.cases)
    accepted = [case for case in plan.cases if case not in refusals]
    compile_kernels(runner, plan.scenes, accepted)
    truths = {scene.name: task(measure_truth, scene, _truth_times(plan, scene)) for scene in plan.scenes}
    known = runner.run("the truth", truths)
    runs = runner.run(
        "cases", {case: task(measure_effect, case, needs=(truths[case.scene.name],)) for case in accepted}
    )
    runs |= {case: EffectRun(*fault) for case, fault in refusals.items()}
    return Found(plan.scenes, known, {case: runs[case] for case in plan.cases}, tuple(_prices(plan, runner)))


def _truth_times(plan: Plan, scene: Scene) -> FloatArray:
    """The very times at which the scene's cases are compared."""
    steps = {case.dt for case in plan.cases if case.scene is scene}
    return np.unique(np.concatenate([compared_times(scene, dt) for dt in steps | {None}]))


def _prices(plan: Plan, runner: Runner) -> Iterator[Priced]:
    """Of each engine and method, in one task that measures all chains in turn."""
    priced = _with_effects(plan.scenes)
    scene = priced[plan.options.priced or next(iter(priced))]
    chains = {
        (name, method): dict(_priced_cases(scene, plan.options.price_step, name, method))
        for name, method in dict.fromkeys((case.engine, case.method) for case in plan.cases)
        if not engine(name).methods[method].adaptive
    }
    refusals = refused(runner, [case for cases in chains.values() for case in cases.values()])
    tasks: dict[tuple[str, str], Task[Prices]] = {}
    for pair, cases in chains.items():
        able = {label: case for label, case in cases.items() if case not in refusals}
        if not set(able) <= {BARE, DEFAULTS} and BARE in able:  # something to measure, and the bare chain to do it by
            tasks[pair] = task(measure_prices, able, BARE, share=4.0)
    found = runner.run("prices, one at a time", tasks, alone=True)
    for pair, cases in chains.items():
        for label, case in cases.items():
            if case in refusals:
                yield Priced(case, label, *refusals[case], Price())
            elif pair in found:
                yield Priced(
                    case, label, found[pair].status, found[pair].reason, found[pair].prices.get(label, Price())
                )


def _priced_cases(scene: Scene, step: float, name: str, method: str) -> Iterator[tuple[str, Case]]:
    """The chain with each of its effects alone, with all, and bare; masses of 0 are never without their rods."""
    always = ("gravity",) if scene.masses.all() else ("gravity", "rod_mass")
    bare = replace(scene, effects=scene.effects.only(*always))
    yield BARE, Case(bare, name, method, step)
    others = [effect for effect in scene.effects.named() if effect in scene.terms and effect not in always]
    for effect in others:
        alone = replace(scene, effects=scene.effects.only(*always, effect))
        yield effect, Case(alone, name, method, step)
    if len(others) > 1:
        yield ALL, Case(scene, name, method, step)
    if "default_flags" in engine(name).methods[method].settings:
        yield DEFAULTS, Case(bare, name, method, step, (("default_flags", 1),))
