"""The kind of study `scaling`: what a step costs as links are added, and the longest chain that runs in real time.

The study's scene is a pattern: its mass and its length are divided among any number of links. Its jobs: the cost of a
step for each number of links, from few to many until one takes too long; then trials of longer and longer chains
against the clock, each with the coarsest step that keeps the energy.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Annotated, Any, Final

import numpy as np
import pandas as pd
from pydantic import Field

from pendbench.physics.energy import energy_scale
from pendbench.scene import MAX_LINKS, Scene
from pendbench.strict import input_error
from pendbench.study.ask import refusal, version
from pendbench.study.case import Case
from pendbench.study.flags import of_timing
from pendbench.study.measure import growth_exponent
from pendbench.study.plan import Plan, StudyFile
from pendbench.study.results import Results
from pendbench.study.runner import Runner
from pendbench.study.stages import compile_kernels, fault_record, job_of
from pendbench.study.work import measure_race, measure_step_cost

Record = dict[str, Any]
#: What is timed: engine, method, settings.
Racer = tuple[str, str, str]

#: Steps of the trials: each is so many times shorter than the one before.
FINER: Final = 1.5
#: How well the longest chain is known: to this factor.
PRECISION: Final = 1.1

_FEWEST: Final = 8
_COST_COLUMNS: Final = ("error_max", "energy_drift_max", "memory_mb")
_TIMING_COLUMNS: Final = ("step_us", "step_spread", "build_s", "first_call_s")


class Options(StudyFile):
    """links: how many, for the cost of a step. fit_from: over this many and more, growth is fitted, or over the last
    decade where fewer than three lengths get there. step, s, of a chain of one link: n links get an n-th of it, as
    their fastest swing does; steps: so many, with which the cost and the error are measured. duration: how long a chain
    has to keep up with the clock, s. coarsest and finest: steps of the trials, s.
    """

    links: Annotated[list[Annotated[int, Field(ge=1, le=MAX_LINKS)]], Field(min_length=1)]
    fit_from: Annotated[int, Field(ge=1)] = 100
    step: Annotated[float, Field(gt=0, le=1)] = 1e-2
    steps: Annotated[int, Field(ge=10, le=100_000)] = 100
    duration: Annotated[float, Field(gt=0, le=1000)] = 10.0
    coarsest: Annotated[float, Field(gt=0, le=1)] = 1 / 240
    finest: Annotated[float, Field(ge=1e-6, le=1)] = 1e-5


def check(plan: Plan) -> None:
    """Raise InputError where the study has more than one scene, or one whose links are not alike."""
    if len(plan.scenes) != 1:
        raise input_error(plan.where, f"scenes has {len(plan.scenes)} entries; allowed: 1, the pattern of all chains")
    [scene] = plan.scenes
    for name in ("masses", "lengths", "angles", "rates"):
        values = getattr(scene, name)
        if np.ptp(values) > 1e-12 * np.abs(values).max(initial=1.0):
            raise input_error(plan.where, f"scene {scene.name!r}: {name} differ; allowed: links that are alike")
    if not energy_scale(scene) or _rests(scene):
        raise input_error(plan.where, f"scene {scene.name!r} is at rest and nothing pulls it; allowed: one that moves")
    if plan.options.coarsest < plan.options.finest:
        said = f"coarsest is {plan.options.coarsest:g}; allowed: finest = {plan.options.finest:g} or more"
        raise input_error(plan.where, said)


def _rests(scene: Scene) -> bool:
    """Whether its rods are at rest, straight down or up, and gravity alone acts."""
    upright = np.abs(np.sin(scene.angles)).max() < 1e-9
    return bool(upright and not scene.rates.any() and set(scene.terms) <= {"gravity"})


def run(plan: Plan, runner: Runner) -> Results:
    """Run the study."""
    study = _Scaling(plan, runner)
    study.measure()
    return study.results()


class _Scaling:
    """What the study has found so far."""

    def __init__(self, plan: Plan, runner: Runner) -> None:
        self.plan, self.runner, self.options = plan, runner, plan.options
        self.racers = {(case.engine, case.method, case.settings_text): case for case in plan.cases}
        self.costs: dict[Racer, dict[int, Record]] = {racer: {} for racer in self.racers}
        self.trials: dict[Racer, list[Record]] = {racer: [] for racer in self.racers}

    @cache  # noqa: B019  # lives as long as the study
    def scene(self, n: int) -> Scene:
        """The pattern's mass and length in n links."""
        [pattern] = self.plan.scenes
        return Scene(
            name=pattern.name,
            title=pattern.title,
            duration=float(self.options.duration),
            masses=np.full(n, pattern.masses.sum() / n),
            lengths=np.full(n, pattern.lengths.sum() / n),
            angles=np.full(n, pattern.angles[0]),
            rates=np.full(n, pattern.rates[0]),
            effects=pattern.effects,
        )

    def measure(self) -> None:
        """Run what the study asks for."""
        compile_kernels(self.runner, [*self.plan.cases], self.options.time_limit)
        for n in sorted(set(self.options.links)):
            self._measure_cost(n)
        number = 0
        while asked := {racer: trial for racer in self.racers if (trial := self._next(racer)) is not None}:
            number += 1
            self._race(f"real time, round {number}", asked)

    def _case(self, racer: Racer, n: int, dt: float | None) -> Case:
        first = self.racers[racer]
        return Case(self.scene(n), first.engine, first.method, None if first.dt is None else dt, first.settings)

    def _step(self, n: int) -> float:
        step: float = self.options.step / n
        return step

    def _measure_cost(self, n: int) -> None:
        """The cost of a step with n links, of every racer that has got as far as this."""
        jobs = {}
        for racer, found in self.costs.items():
            if any(record["status"] != "ok" for record in found.values()):
                continue
            step = self._step(n)
            case = self._case(racer, n, step)
            if (reason := refusal(case)) is not None:
                found[n] = {"status": "refused", "reason": reason}
                continue
            content = (*case.content, self.options.steps, step, version(case.engine))
            arguments = (case, step, self.options.steps)
            jobs[racer] = job_of(measure_step_cost, content, self.options.time_limit, *arguments)
        if jobs:
            values = self.runner.run(
                f"{n} links, one at a time", list(jobs.values()), lambda _, fault: fault_record(fault), alone=True
            )
            for racer, job in jobs.items():
                self.costs[racer][n] = values[job.key]

    def _next(self, racer: Racer) -> tuple[int, float] | None:
        """The next trial of a racer: how many links, and which step; None where its longest chain is known."""
        done = self.trials[racer]
        if not done:
            return _FEWEST, self.options.coarsest
        last = done[-1]
        if last["outcome"] == "lost" and self.racers[racer].dt is not None:
            finer = last["dt"] / FINER
            if finer >= self.options.finest:
                return last["n"], finer
        held = [trial for trial in done if trial["outcome"] == "held"]
        best = max(held, key=lambda trial: trial["n"], default=None)
        if best is None:
            return (last["n"] // 2, self.options.coarsest) if last["n"] > 1 else None
        failed = {trial["n"] for trial in done} - {trial["n"] for trial in held}
        least = min((n for n in failed if n > best["n"]), default=None)
        n = 2 * best["n"] if least is None else round(math.sqrt(best["n"] * least))
        if n > MAX_LINKS or (least is not None and (least <= PRECISION * best["n"] or n in (best["n"], least))):
            return None
        return n, self._first_step(best, n)

    def _first_step(self, best: Mapping[str, Any], n: int) -> float:
        """A step that is a little coarser than what the best trial's would be, were it to fall like 1/n."""
        wanted = best["dt"] * best["n"] / n * FINER
        rungs = max(0, math.ceil(math.log(self.options.coarsest / wanted) / math.log(FINER)))
        step: float = self.options.coarsest / FINER**rungs
        return step

    def _race(self, stage: str, asked: Mapping[Racer, tuple[int, float]]) -> None:
        jobs = {}
        for racer, (n, dt) in asked.items():
            case = self._case(racer, n, float(f"{dt:.6g}"))
            if (reason := refusal(case)) is not None:
                self.trials[racer].append({"n": n, "dt": dt, "outcome": "refused", "reason": reason})
                continue
            jobs[racer] = job_of(measure_race, (*case.content, version(case.engine)), self.options.time_limit, case)
        values = self.runner.run(stage, list(jobs.values()), lambda _, fault: _failed(fault_record(fault)))
        for racer, job in jobs.items():
            n, dt = asked[racer]
            self.trials[racer].append({"n": n, "dt": dt, **values[job.key]})

    def results(self) -> Results:
        """The tables."""
        cases = [self._row(racer, n, record) for racer in self.racers for n, record in self.costs[racer].items()]
        growth = [self._growth_row(racer) for racer in self.racers]
        longest = [self._longest_row(racer) for racer in self.racers]
        return Results(
            name=self.plan.name,
            title=self.options.title,
            kind=self.options.kind,
            cases=pd.DataFrame(cases),
            tables={
                "growth": pd.DataFrame(growth),
                "longest": pd.DataFrame(longest),
                "trials": pd.DataFrame(list(self._trial_rows())),
            },
            options=self.options.model_dump(mode="json", exclude={"quick"}),
            quick=self.plan.quick,
        )

    def _row(self, racer: Racer, n: int, record: Record) -> Record:
        engine, method, settings = racer
        step_us = record.get("step_us")
        row = {
            "scene": self.plan.scenes[0].name,
            "n": n,
            "engine": engine,
            "method": method,
            "dt": math.nan if self.racers[racer].dt is None else self._step(n),
            "settings": settings,
            "status": record["status"],
            "reason": record["reason"],
            "flags": "; ".join(of_timing(record)) if record["status"] == "ok" else "",
            "horizon_s": math.nan,
            **{name: record.get(name) for name in (*_COST_COLUMNS, *_TIMING_COLUMNS)},
            "step_per_link_ns": None if step_us is None else 1e3 * step_us / n,
            "run_s": math.nan,
        }
        return {name: math.nan if value is None else value for name, value in row.items()}

    def _growth_row(self, racer: Racer) -> Record:
        measured = {n: record for n, record in self.costs[racer].items() if record["status"] == "ok"}
        fitted = self._fitted(sorted(measured))
        costs = np.array([measured[n]["step_us"] for n in fitted])
        stopped = [record for record in self.costs[racer].values() if record["status"] != "ok"]
        return {
            "engine": racer[0],
            "method": racer[1],
            "settings": racer[2],
            "n_from": fitted[0] if fitted else math.nan,
            "n_to": fitted[-1] if fitted else math.nan,
            "step_exponent": growth_exponent(np.array(fitted, dtype=float), costs),
            "status": stopped[0]["status"] if stopped else "ok",
            "reason": stopped[0]["reason"] if stopped else "",
        }

    def _fitted(self, measured: list[int]) -> list[int]:
        """The lengths that growth is fitted to: those of the last decade, where fewer than three reach `fit_from`."""
        fitted = [n for n in measured if n >= self.options.fit_from]
        if len(fitted) < 3:
            fitted = [n for n in measured if 10 * n >= measured[-1]]
        return fitted if len(fitted) >= 3 else []

    def _longest_row(self, racer: Racer) -> Record:
        held = [trial for trial in self.trials[racer] if trial["outcome"] == "held"]
        best: Mapping[str, Any] = max(held, key=lambda trial: trial["n"], default={})
        beyond = [trial for trial in self.trials[racer] if trial["n"] > best.get("n", 0)]
        nearest: Mapping[str, Any] = min(beyond, key=lambda trial: (trial["n"], trial["dt"]), default={})
        return {
            "engine": racer[0],
            "method": racer[1],
            "settings": racer[2],
            "longest_n": best.get("n", math.nan),
            "dt": math.nan if self.racers[racer].dt is None else best.get("dt", math.nan),
            "energy_drift_max": best.get("energy_drift_max", math.nan),
            "race_spent_s": best.get("spent_s", math.nan),
            "next_n": nearest.get("n", math.nan),
            "outcome": nearest.get("outcome", ""),
            "reason": nearest.get("reason", "") + self._not_tried(racer, nearest),
        }

    def _not_tried(self, racer: Racer, trial: Mapping[str, Any]) -> str:
        """That it was the study which ended the search, where it was."""
        if self.racers[racer].dt is None or trial.get("outcome") != "lost":
            return ""
        return f"; no step below {self.options.finest:g} s is tried"

    def _trial_rows(self) -> Iterator[Record]:
        for (engine, method, settings), trials in self.trials.items():
            for trial in trials:
                adaptive = self.racers[engine, method, settings].dt is None
                yield {
                    "engine": engine,
                    "method": method,
                    "settings": settings,
                    "n": trial["n"],
                    "dt": math.nan if adaptive else trial["dt"],
                    "outcome": trial["outcome"],
                    "reason": trial.get("reason", ""),
                    "reached_s": trial.get("reached_s", math.nan),
                    "race_spent_s": trial.get("spent_s", math.nan),
                    "energy_drift_max": trial.get("energy_drift_max", math.nan),
                }


def _failed(record: Record) -> Record:
    """A trial of which nothing came back."""
    return {"outcome": record["status"], "reason": record["reason"]}


def longest_of(rows: Sequence[Mapping[str, Any]], engine: str) -> float:
    """The longest chain that any method of an engine runs in real time; nan where none runs one."""
    found = [row["longest_n"] for row in rows if row["engine"] == engine and row["longest_n"] > 0]
    return max(found, default=math.nan)
