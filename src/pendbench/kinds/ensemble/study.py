"""The kind of study `ensemble`: the map of the time until a double pendulum first flips, over all releases at rest.

It runs the map; a sample of its pixels at other tolerances, the finest of which is the truth; a coarser grid of its
pixels by every other method and engine; and Lyapunov exponents over energies.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
from pydantic import Field

from pendbench.base.arrays import FloatArray
from pendbench.base.faults import STATUSES
from pendbench.base.strict import input_error
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import Task, task
from pendbench.kinds.ensemble.work import (
    ExponentRun,
    FlipRun,
    compile_flips,
    measure_engine_flips,
    measure_exponents,
    measure_flips,
)
from pendbench.measures.flips import coarse_pixels, pixel_angles
from pendbench.physics.acting import is_plain
from pendbench.scene.scene import Scene
from pendbench.scene.toml_file import Table
from pendbench.study.ask import refused
from pendbench.study.case import Case
from pendbench.study.plan import Plan
from pendbench.study.study_file import StudyFile

Pixels = npt.NDArray[np.int64]

_PART: Final = 20_000  # chains in a task: a second or two of work
_ENGINE_PART: Final = 40
_FINER: Final = 10.0  # by so much at least, for a run to be the truth of another


class Exponents(Table):
    """[exponents]: Lyapunov exponents by energy."""

    bins: Annotated[int, Field(ge=1, le=100)]
    """equal parts of the energy"""
    starts: Annotated[int, Field(ge=1, le=10_000)]
    """starts in each of them"""
    seconds: Annotated[float, Field(ge=1.0, le=1e5)]
    """over how long an exponent is measured, s"""


class Options(StudyFile):
    """What a study of kind `ensemble` asks besides."""

    STEPS: ClassVar[tuple[float, ...]] = (5e-3,)
    TOLERANCES: ClassVar[tuple[float, ...]] = (1e-4, 1e-6, 1e-10)

    grid: Annotated[int, Field(ge=3, le=4000)] = 300
    """pixels on each side of the map"""
    tolerance: Annotated[float, Field(ge=1e-15, le=1e-2)] = 1e-6
    """the map's: one of those of the analytic engine's adaptive method, the finest of which is the truth"""
    sample: Annotated[int, Field(ge=1, le=1_000_000)] = 1000
    """how many random pixels are compared with it"""
    coarse: Annotated[int, Field(ge=1, le=1000)] = 12
    """pixels on each side for other methods"""
    changed: Annotated[float, Field(gt=0, lt=1)] = 0.01
    """a pixel is another one where its time differs by more than this share of the scene's duration"""
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    """of the random numbers"""
    exponents: Exponents | None = None
    """Lyapunov exponents, where they are asked for"""


@dataclass(frozen=True, eq=False)
class Compared:
    """What a case did with all its chains, and its flip times, s, at those pixels (k,) of the map where it is compared
    with the expected ones, of the finest tolerance.
    """

    case: Case
    run: FlipRun
    pixels: Pixels
    flips: FloatArray
    expected: FloatArray


@dataclass(frozen=True)
class Energies:
    """The exponents of starts with energy shares from `low` to `high`."""

    low: float
    high: float
    run: ExponentRun


@dataclass(frozen=True, eq=False)
class Found:
    """map (k, k): its flip times, s. finest: the case that is the truth of the others. energies: none where the study
    does not ask.
    """

    scene: Scene
    map: FloatArray
    finest: Case
    cases: tuple[Compared, ...]
    energies: tuple[Energies, ...]


def is_ours(case: Case) -> bool:
    """Whether a case runs many chains at once."""
    return case.engine == "analytic" and case.method == "adaptive"


def check(plan: Plan) -> None:
    """Raise InputError where the study is not about one double pendulum at rest, or has no map or no truth for it."""
    options, scene = plan.options, plan.scenes[0]
    if len(plan.scenes) > 1:
        raise input_error(plan.where, f"scenes has {len(plan.scenes)} names; allowed: one")
    if scene.n != 2 or scene.rates.any() or not scene.effects.gravity:
        raise input_error(plan.where, f"scenes has {scene.name!r}; allowed: a double pendulum at rest, with gravity")
    if options.exponents and (others := sorted(scene.terms.keys() - {"gravity"})):
        allowed = "gravity alone, or no table [exponents]"
        raise input_error(f"{plan.where} [exponents]", f"{scene.name!r} calls for {others[0]}; allowed: {allowed}")
    if options.sample > options.grid**2:
        raise input_error(plan.where, f"sample is {options.sample}; allowed: up to {options.grid**2}, grid x grid")
    if options.coarse > options.grid:
        raise input_error(plan.where, f"coarse is {options.coarse}; allowed: up to grid = {options.grid}")
    tolerances = [case.tolerance for case in plan.cases if is_ours(case)]
    if options.tolerance not in tolerances or min(tolerances) * _FINER > options.tolerance:
        raise input_error(
            plan.where,
            f"tolerance is {options.tolerance:g}; allowed: one of those of the analytic engine's method 'adaptive' "
            "under [[engines]], with another there that is ten times finer or more",
        )


def measure(plan: Plan, runner: Runner) -> Found:
    """Run the study."""
    options, scene = plan.options, plan.scenes[0]
    ours = [case for case in plan.cases if is_ours(case)]
    mapped = next(case for case in ours if case.tolerance == options.tolerance)
    finest = min(ours, key=lambda case: case.tolerance)
    sample, coarse = sample_of(options), coarse_pixels(options.grid, options.coarse)
    runner.run("kernels compiled", {scene.name: task(compile_flips, scene)})
    runs = _flips(runner, "the map", options.grid, {mapped: np.arange(options.grid**2)})
    again = dict.fromkeys(ours, sample) | {finest: np.concatenate([sample, coarse])}
    del again[mapped]
    runs |= _flips(runner, "the sample", options.grid, again)
    runs |= _others(plan, runner, coarse)
    truth, elsewhere = np.split(runs[finest].flips, [len(sample)])
    at_sample = {mapped: runs[mapped].flips[sample], finest: truth}
    cases = (
        Compared(case, runs[case], sample, at_sample.get(case, runs[case].flips), truth)
        if is_ours(case)
        else Compared(case, runs[case], coarse, runs[case].flips, elsewhere)
        for case in plan.cases
    )
    whole = runs[mapped].flips.reshape(options.grid, -1)
    return Found(scene, whole, finest, tuple(cases), tuple(_energies(plan, runner)))


def sample_of(options: Any) -> Pixels:
    """The pixels of the sample, in the map's order."""
    rng = np.random.default_rng(options.seed)
    return np.sort(rng.choice(options.grid**2, options.sample, replace=False))


def _others(plan: Plan, runner: Runner, pixels: Pixels) -> dict[Case, FlipRun]:
    """The cases that run one chain after the other, those that their engines refuse among them."""
    others = [case for case in plan.cases if not is_ours(case)]
    refusals = refused(runner, others)
    runs = _flips(runner, "other methods", plan.options.grid, {case: pixels for case in others if case not in refusals})
    nothing = np.full(len(pixels), np.nan)
    return runs | {case: FlipRun(*fault, flips=nothing) for case, fault in refusals.items()}


def _flips(runner: Runner, stage: str, grid: int, pixels: Mapping[Case, Pixels]) -> dict[Case, FlipRun]:
    """The flips of each case at its pixels (k,) of a map with so many on each side, in tasks side by side."""
    tasks = {case: list(_tasks(case, pixel_angles(grid, own))) for case, own in pixels.items()}
    if not tasks:
        return {}
    found = runner.run(stage, {(case, at): each for case, own in tasks.items() for at, (each, _) in enumerate(own)})
    return {
        case: _together([(found[case, at], count) for at, (_, count) in enumerate(own)]) for case, own in tasks.items()
    }


def _tasks(case: Case, angles: FloatArray) -> Iterator[tuple[Task[FlipRun], int]]:
    """The tasks of a case, each with how many of its chains it is for."""
    size = _PART if is_ours(case) and is_plain(case.scene) else _ENGINE_PART
    for part in np.split(angles, range(size, len(angles), size)):
        if is_ours(case):
            yield task(measure_flips, case.scene, part, case.tolerance), len(part)
        else:
            yield task(measure_engine_flips, case, part), len(part)


def _together(parts: Sequence[tuple[FlipRun, int]]) -> FlipRun:
    """The parts of a case as one: the worst status, the whole time, the largest drift; not known what none found."""
    runs = [run for run, _ in parts]
    worst = max(runs, key=lambda run: list(STATUSES).index(run.status))
    flips = [run.flips if len(run.flips) else np.full(count, np.nan) for run, count in parts]
    drifts = [run.energy_drift_max for run in runs if not math.isnan(run.energy_drift_max)]
    whole, known = sum(run.run_s for run in runs), float(np.fmax.reduce([run.energy_floor for run in runs]))
    return FlipRun(worst.status, worst.reason, np.concatenate(flips), whole, max(drifts, default=math.nan), known)


def _energies(plan: Plan, runner: Runner) -> Iterator[Energies]:
    """The exponents of each bin of the energy."""
    asked = plan.options.exponents
    if asked is None:
        return
    bounds = list(itertools.pairwise(number / asked.bins for number in range(asked.bins + 1)))
    tasks = {
        (low, high): task(
            measure_exponents, plan.scenes[0], low, high, asked.starts, asked.seconds, plan.options.seed + number
        )
        for number, (low, high) in enumerate(bounds)
    }
    for (low, high), run in runner.run("exponents", tasks).items():
        yield Energies(low, high, run)
