"""The kind of study `scaling`: what a step costs as links are added, and the longest chain that runs in real time.

The study's scene is a pattern: its mass and its length are divided among any number of links. It measures the cost of a
step for each number of links, from few to many until one takes too long; then it tries longer and longer chains against
the clock, for each title with the coarsest step that wins it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Final

import numpy as np
from pydantic import Field

from pendbench.base.errors import InputError
from pendbench.base.ranges import Step
from pendbench.base.strict import input_error
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import task
from pendbench.kinds.scaling.search import Ladder, Trial, best_of, next_trial, trial_of
from pendbench.kinds.scaling.work import RaceRun, StepCost, measure_race, measure_step_cost
from pendbench.measures.energy import conserves_energy, is_driven
from pendbench.measures.known_motion import measure_known
from pendbench.measures.titles import TITLES, Title
from pendbench.physics import dense
from pendbench.scene.links import Links
from pendbench.scene.scene import MAX_LINKS, Effects, Scene
from pendbench.study.ask import refused
from pendbench.study.case import Case
from pendbench.study.kernels import compile_kernels
from pendbench.study.plan import Plan
from pendbench.study.study_file import StudyFile

_LINKS: Final = (1, 2, 5, 10, 20, 50, 100, 200)
_FRAME: Final = 1 / 240  # s
_KNOWN_SHARE: Final = 3.0  # of the time limit: a motion is known once, and compared with many times
_ALIKE: Final = ("masses", "lengths", "angles", "rates")


class Options(StudyFile):
    """What a study of kind `scaling` asks besides."""

    STEPS: ClassVar[tuple[float, ...]] = (1e-3,)

    links: Annotated[list[Annotated[int, Field(ge=1, le=MAX_LINKS)]], Field(min_length=1)] = list(_LINKS)
    """how many, for the cost of a step"""
    fit_from: Annotated[int, Field(ge=1)] = 100
    """growth is fitted over this many and more, or over the last decade where fewer than three lengths get there"""
    step: Annotated[float, Step(1e-6, 1.0, "s")] = 1e-2
    """s, of a chain of one link, with which cost and error are measured: n links get an n-th, as their fastest swing"""
    steps: Annotated[int, Field(ge=10, le=100_000)] = 100
    """so many of these steps"""
    duration: Annotated[float, Field(gt=0, le=1000)] = 10.0
    """how long a chain has to keep up with the clock, s"""
    coarsest: Annotated[float, Step(1e-6, 1.0, "s")] = 1 / 240
    """the coarsest step of the trials, s; all others are whole parts of it"""
    finest: Annotated[float, Step(1e-6, 1.0, "s")] = 1e-5
    """and the finest"""

    def ladder(self, case: Case, title: Title) -> Ladder:
        """The steps of a case's trials for a title."""
        fixed, divides = case.dt is not None, case.its_method.substeps
        return Ladder(self.coarsest, self.finest, fixed=fixed, shrinks=not title.afar, divides=divides)

    @property
    def every(self) -> float:
        """How often trials are looked at, s: at every coarsest step, or as many of them as a frame has."""
        return self.coarsest * max(1, round(_FRAME / self.coarsest))


@dataclass(frozen=True)
class Racer:
    """What the study found of one engine and method. pattern: the case of the study. costs: by number of links, as far
    as it got. trials: against the clock, in their order, by title.
    """

    pattern: Case
    costs: Mapping[Case, StepCost]
    trials: Mapping[str, Sequence[Trial]]


Found = tuple[Racer, ...]


def check(plan: Plan) -> None:
    """Raise InputError where the study has more than one scene, or one whose links are not alike."""
    if len(plan.scenes) != 1:
        raise input_error(plan.where, f"scenes has {len(plan.scenes)} entries; allowed: 1, the pattern of all chains")
    [scene] = plan.scenes
    parts = {name: getattr(scene, name) for name in _ALIKE} | ({} if scene.links is None else vars(scene.links))
    for name, values in parts.items():
        if np.ptp(values) > 1e-12 * np.abs(values).max(initial=1.0):
            raise input_error(plan.where, f"scene {scene.name!r}: {name} differ; allowed: links that are alike")
    for n in sorted({1, 2, *plan.options.links}):
        try:
            chain_of(scene, n, scene.duration)
        except InputError as error:
            allowed = "effects with one number for all joints"
            raise input_error(plan.where, f"scene {scene.name!r} with {n} links: {error}; allowed: {allowed}") from None
    if _rests(scene):
        raise input_error(plan.where, f"scene {scene.name!r} is at rest and nothing pulls it; allowed: one that moves")
    if plan.options.coarsest < plan.options.finest:
        said = f"coarsest is {plan.options.coarsest:g}; allowed: finest = {plan.options.finest:g} or more"
        raise input_error(plan.where, said)


def _rests(scene: Scene) -> bool:
    """Whether its links are at rest, and nothing pulls or drives them."""
    if scene.rates.any() or is_driven(scene):
        return False
    two = chain_of(scene, 2, scene.duration)  # links are alike: any number of them tells
    swing = (scene.effects.gravity or 0.0) / float(two.lengths[0])
    return bool(np.abs(dense.accelerations(two, two.angles, two.rates)).max() <= 1e-9 * swing)


def measure(plan: Plan, runner: Runner) -> Found:
    """Run the study."""
    patterns = list({(case.engine, case.method, case.settings): case for case in plan.cases}.values())
    compared = Case(patterns[0].scene, "analytic", "adaptive", None)  # computes most motions that are compared with
    compile_kernels(runner, (), [*patterns, compared], truth=False)
    costs = _costs(patterns, plan.options, runner)
    claims = [(pattern, title) for pattern in patterns for title in titles_of(pattern.scene)]
    trials = _trials(claims, plan.options, runner)
    return tuple(
        Racer(pattern, costs[pattern], {title.name: its for (of, title), its in trials.items() if of is pattern})
        for pattern in patterns
    )


def titles_of(scene: Scene) -> tuple[Title, ...]:
    """The titles that chains like a scene can win: none may gain energy, which says nothing where something works."""
    return tuple(title for title in TITLES if title.name != "moves well" or conserves_energy(scene))


def chain_of(pattern: Scene, n: int, duration: float) -> Scene:
    """The pattern's mass and length in n links, for `duration` s; its rods' mass, too, and its masses' drag.

    What acts in joints is that of each joint, as the pattern has it. Raises InputError where each has its own number.
    """
    return replace(
        pattern,
        duration=duration,
        masses=np.full(n, pattern.masses.sum() / n),
        lengths=np.full(n, pattern.lengths.sum() / n),
        angles=np.full(n, pattern.angles[0]),
        rates=np.full(n, pattern.rates[0]),
        effects=_divided(pattern.effects, pattern.n / n),
        links=None if pattern.links is None else _shorter(pattern.links, n),
    )


def _shorter(links: Links, n: int) -> Links:
    """Rigid links that are alike, n instead of them."""
    share = len(links.mass) / n
    sizes = (share * links.mass[0], share * links.centre[0], share**3 * links.inertia[0])
    return Links(*(np.full(n, size) for size in sizes))


def _divided(effects: Effects, share: float) -> Effects:
    """The effects of a link that is such a share of one of the pattern's."""
    rods, air = effects.rod_mass, effects.air_drag
    if rods is not None:
        effects = replace(effects, rod_mass=_part(rods, share))
    if air is not None:
        parts = {name: _part(getattr(air, name), share) for name in ("linear", "quadratic")}
        effects = replace(effects, air_drag=replace(air, **parts))
    return effects


def _part(value: float | tuple[float, ...], share: float) -> float | tuple[float, ...]:
    """A share of what each link has; where each has its own, the chain says that it does not fit."""
    return share * value if isinstance(value, float) else value


def _with_links(pattern: Case, n: int, dt: float, options: Options) -> Case:
    """The pattern's case with n links, and with the step `dt` (s) where its method takes one."""
    scene = chain_of(pattern.scene, n, options.duration)
    return replace(pattern, scene=scene, dt=None if pattern.dt is None else dt)


def _costs(patterns: Sequence[Case], options: Options, runner: Runner) -> dict[Case, dict[Case, StepCost]]:
    """What a step costs, from few links to many; one that did not end well is the method's last."""
    found: dict[Case, dict[Case, StepCost]] = {pattern: {} for pattern in patterns}
    for n in sorted(set(options.links)):
        step = options.step / n
        going = [pattern for pattern in patterns if all(cost.status == "ok" for cost in found[pattern].values())]
        cases = {pattern: _with_links(pattern, n, step, options) for pattern in going}
        refusals = refused(runner, list(cases.values()))
        tasks = {
            pattern: task(measure_step_cost, case, step, options.steps)
            for pattern, case in cases.items()
            if case not in refusals
        }
        costs = runner.run(f"{n} links, one at a time", tasks, alone=True)
        for pattern, case in cases.items():
            found[pattern][case] = costs[pattern] if pattern in costs else StepCost(*refusals[case])
    return found


Claim = tuple[Case, Title]
Chain = tuple[Case, int, float]


def _trials(claims: Sequence[Claim], options: Options, runner: Runner) -> dict[Claim, list[Trial]]:
    """Longer and longer chains against the clock; a run counts for whatever title it wins, whichever asked for it."""
    found: dict[Claim, list[Trial]] = {claim: [] for claim in claims}
    runs: dict[Chain, RaceRun] = {}
    asked, number = _asked(found, options), 0
    while asked:
        number += 1
        runs |= _raced(_open(asked, runs), f"real time, round {number}", options, runner)
        for (pattern, title), (n, dt) in asked.items():
            found[pattern, title].append(trial_of(title, n, dt, runs[pattern, n, dt]))
        asked = _asked(found, options)
        if not asked:
            _add_wins(found, runs)
            asked = _asked(found, options)
    return found


def _add_wins(found: Mapping[Claim, list[Trial]], runs: Mapping[Chain, RaceRun]) -> None:
    """Runs that another title asked for, and that win one with a longer chain than any of its own.

    Its search had ended below a chain that lost with every step, though longer ones win; it goes on from those.
    """
    for (pattern, title), trials in found.items():
        for (_, n, dt), run in [each for each in runs.items() if each[0][0] == pattern]:
            trial, best = trial_of(title, n, dt, run), best_of(trials)
            if trial.held and (best is None or n > best.n):
                trials.append(trial)


def _asked(found: Mapping[Claim, Sequence[Trial]], options: Options) -> dict[Claim, tuple[int, float]]:
    wanted = {claim: next_trial(trials, options.ladder(*claim)) for claim, trials in found.items()}
    return {claim: trial for claim, trial in wanted.items() if trial is not None}


def _open(asked: Mapping[Claim, tuple[int, float]], runs: Mapping[Chain, RaceRun]) -> dict[Chain, list[Title]]:
    """What has to be run, and for which titles: a run may have ended before it could win what is asked now."""
    needed: dict[Chain, list[Title]] = {}
    for (pattern, title), (n, dt) in asked.items():
        chain = pattern, n, dt
        if chain not in runs or trial_of(title, n, dt, runs[chain]).outcome == "unfinished":
            needed.setdefault(chain, []).append(title)
    return needed


def _raced(
    needed: Mapping[Chain, Sequence[Title]], stage: str, options: Options, runner: Runner
) -> dict[Chain, RaceRun]:
    """Run chains against the clock."""
    cases = {chain: _with_links(*chain, options) for chain in needed}
    refusals = refused(runner, list(cases.values()))
    going = {chain: case for chain, case in cases.items() if case not in refusals}
    known = {
        case.scene.n: task(measure_known, case.scene, options.every, share=_KNOWN_SHARE) for case in going.values()
    }
    runner.run("motions to compare with", known)
    tasks = {
        chain: task(
            measure_race, case, options.every, tuple(title.name for title in needed[chain]), needs=(known[chain[1]],)
        )
        for chain, case in going.items()
    }
    found = runner.run(stage, tasks)
    return {chain: found[chain] if chain in found else RaceRun(*refusals[case]) for chain, case in cases.items()}
