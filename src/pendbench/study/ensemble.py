"""The kind of study `ensemble`: the map of the time until a double pendulum first flips, over all releases at rest.

Its jobs: the map; a sample of its pixels at other tolerances, the finest of which is the truth; a coarser grid of its
pixels by every other method and engine; and Lyapunov exponents over energies.
"""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field

from pendbench.arrays import FloatArray
from pendbench.scene import Scene
from pendbench.scene_file import Table
from pendbench.strict import input_error
from pendbench.study.ask import refusal, version
from pendbench.study.case import Case
from pendbench.study.ensemble_tables import (
    Energies,
    Findings,
    Pixels,
    Record,
    cases_table,
    finest_of,
    is_ours,
    other_tables,
    sample_of,
    tolerance_of,
)
from pendbench.study.flip_work import arrays_job, compile_flips, measure_engine_flips, measure_exponents, measure_flips
from pendbench.study.flips import coarse_pixels, edge_of, pixel_angles
from pendbench.study.jobs import Job
from pendbench.study.plan import Plan, StudyFile
from pendbench.study.results import Results
from pendbench.study.runner import Runner
from pendbench.study.stages import fault_record, job_of
from pendbench.trajectory import STATUSES

_PART: Final = 20_000  # chains in a job: a second or two of work
_ENGINE_PART: Final = 40
_FINER: Final = 10.0  # by so much at least, for a run to be the truth of another


class Exponents(Table):
    """[exponents]: `bins` of the energy, as many `starts` in each, and the time over which they part, s."""

    bins: Annotated[int, Field(ge=1, le=100)]
    starts: Annotated[int, Field(ge=1, le=10_000)]
    seconds: Annotated[float, Field(ge=1.0, le=1e5)]


class Options(StudyFile):
    """grid: pixels on each side of the map. tolerance: the map's, one of those of the analytic engine's adaptive
    method; the finest of these is the truth for `sample` pixels. coarse: pixels on each side for other methods.
    changed: a pixel is another one where its time differs by more than this share of the scene's duration.
    """

    grid: Annotated[int, Field(ge=3, le=4000)]
    tolerance: Annotated[float, Field(ge=1e-15, le=1e-2)]
    sample: Annotated[int, Field(ge=1, le=1_000_000)]
    coarse: Annotated[int, Field(ge=1, le=1000)]
    changed: Annotated[float, Field(gt=0, lt=1)] = 0.01
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    exponents: Exponents | None = None


def check(plan: Plan) -> None:
    """Raise InputError where the study is not about one double pendulum at rest, or has no map or no truth for it."""
    options, scene = plan.options, plan.scenes[0]
    if len(plan.scenes) > 1:
        raise input_error(plan.where, f"scenes has {len(plan.scenes)} names; allowed: one")
    if scene.n != 2 or scene.rates.any() or not scene.effects.gravity:
        raise input_error(plan.where, f"scenes has {scene.name!r}; allowed: a double pendulum at rest, with gravity")
    if options.sample > options.grid**2:
        raise input_error(plan.where, f"sample is {options.sample}; allowed: up to {options.grid**2}, grid x grid")
    if options.coarse > options.grid:
        raise input_error(plan.where, f"coarse is {options.coarse}; allowed: up to grid = {options.grid}")
    tolerances = [tolerance_of(case) for case in plan.cases if is_ours(case)]
    if options.tolerance not in tolerances or min(tolerances) * _FINER > options.tolerance:
        raise input_error(
            plan.where,
            f"tolerance is {options.tolerance:g}; allowed: one of those of the analytic engine's method 'adaptive' "
            "under [[engines]], with another there that is ten times finer or more",
        )


def run(plan: Plan, runner: Runner) -> Results:
    """Run the study."""
    study = _Ensemble(plan, runner)
    study.measure()
    return study.results()


class _Ensemble:
    """What the study has found so far: flip times of the pixels of each case, and a record of how that went."""

    def __init__(self, plan: Plan, runner: Runner) -> None:
        self.plan, self.runner, self.options = plan, runner, plan.options
        self.scene: Scene = plan.scenes[0]
        self.ours = [case for case in plan.cases if is_ours(case)]
        self.mapped = next(case for case in self.ours if tolerance_of(case) == self.options.tolerance)
        self.sample = sample_of(self.options)
        self.coarse = coarse_pixels(self.options.grid, self.options.coarse)
        self.flips: dict[Case, FloatArray] = {}
        self.records: dict[Case, Record] = {}

    def measure(self) -> None:
        """Run what the study asks for."""
        limit = self.options.time_limit
        compiling = job_of(compile_flips, (), limit, self.scene)
        self.runner.run("compiled kernels", [compiling], lambda _, fault: fault_record(fault))
        everything = np.arange(self.options.grid**2)
        self._run("the map", {self.mapped: self._our_jobs(self.mapped, everything)})
        self.map = self.flips[self.mapped].reshape(self.options.grid, -1)
        self.edge = edge_of(self.map, self.options.changed * self.scene.duration)
        self.flips[self.mapped] = self.map.ravel()[self.sample]
        again = {case: self._our_jobs(case, self.sample) for case in self.ours if case != self.mapped}
        finest = finest_of(self.ours)
        again[finest] = self._our_jobs(finest, np.concatenate([self.sample, self.coarse]))
        self._run("the sample", again)
        self.flips[finest], elsewhere = np.split(self.flips[finest], [len(self.sample)])
        self.truth = {True: self.flips[finest], False: elsewhere}
        self._run("other methods", {case: self._their_jobs(case) for case in self._able()})
        self._measure_exponents()

    def _able(self) -> Iterator[Case]:
        """The other cases that their engines do not refuse."""
        for case in self.plan.cases:
            reason = None if is_ours(case) else refusal(case)
            if reason is not None:
                self.records[case] = {"status": "refused", "reason": reason}
                self.flips[case] = np.full(len(self.coarse), np.nan)
            elif not is_ours(case):
                yield case

    def _our_jobs(self, case: Case, pixels: Pixels) -> list[tuple[Job, int]]:
        return self._jobs(measure_flips, case, pixels, _PART, (self.scene, tolerance_of(case)))

    def _their_jobs(self, case: Case) -> list[tuple[Job, int]]:
        return self._jobs(measure_engine_flips, case, self.coarse, _ENGINE_PART, (case,))

    def _jobs(
        self, function: Callable[..., Record], case: Case, pixels: Pixels, size: int, what: tuple[Any, ...]
    ) -> list[tuple[Job, int]]:
        """A case's jobs, each with how many of its pixels it is for."""
        angles, store = pixel_angles(self.options.grid, pixels), self.runner.store
        jobs = []
        for part in np.split(angles, range(size, len(angles), size)):
            content = (*case.content, version(case.engine), hashlib.sha256(part.tobytes()).hexdigest())
            arguments = (what[0], part, *what[1:])
            jobs.append((arrays_job(function, content, store, self.options.time_limit, *arguments), len(part)))
        return jobs

    def _run(self, stage: str, jobs: dict[Case, list[tuple[Job, int]]]) -> None:
        """Run the jobs of all the cases, side by side, and put together what they leave."""
        asked = [job for own in jobs.values() for job, _ in own]
        if not asked:
            return
        values = self.runner.run(stage, asked, lambda _, fault: fault_record(fault))
        for case, own in jobs.items():
            self.flips[case] = np.concatenate([self._found(job, count) for job, count in own])
            self.records[case] = _together([values[job.key] for job, _ in own])

    def _found(self, job: Job, count: int) -> FloatArray:
        arrays = self.runner.store.load_arrays(job.key)
        return np.full(count, np.nan) if arrays is None else arrays["flips"]

    def _measure_exponents(self) -> None:
        asked, limit = self.options.exponents, self.options.time_limit
        self.energies: list[Energies] = []
        if asked is None:
            return
        bounds = [number / asked.bins for number in range(asked.bins + 1)]
        jobs = []
        for number, (low, high) in enumerate(itertools.pairwise(bounds)):
            arguments = (low, high, asked.starts, asked.seconds, self.options.seed + number)
            content = (self.scene.digest, *arguments)
            jobs.append(arrays_job(measure_exponents, content, self.runner.store, limit, self.scene, *arguments))
        values = self.runner.run("exponents", jobs, lambda _, fault: fault_record(fault))
        for job, (low, high) in zip(jobs, itertools.pairwise(bounds), strict=True):
            self.energies.append(Energies(low, high, self.runner.store.load_arrays(job.key), values[job.key]))

    def results(self) -> Results:
        """The tables."""
        everything = (self.map, self.edge, self.flips, self.truth, self.records, self.energies)
        found = Findings(self.scene, self.options, self.plan.cases, *everything)
        return Results(
            name=self.plan.name,
            title=self.options.title,
            kind=self.options.kind,
            cases=cases_table(found),
            tables=other_tables(found),
            options=self.options.model_dump(mode="json", exclude={"quick"}) | {"duration": self.scene.duration},
            quick=self.plan.quick,
        )


def _together(records: Sequence[Record]) -> Record:
    """The record of a case from those of its jobs: the worst status, the whole time, the largest drift."""
    ranks = list(STATUSES)
    worst = max(records, key=lambda record: ranks.index(record["status"]))
    drifts = [record["energy_drift_max"] for record in records if "energy_drift_max" in record]
    return {
        "status": worst["status"],
        "reason": worst["reason"],
        "run_s": sum(record.get("run_s", math.nan) for record in records),
        **({"energy_drift_max": max(drifts)} if drifts else {}),
    }
