"""The kind of study `stability`: where each engine and method holds, drifts or breaks, and up to which step it holds.

Its jobs: every case, from coarse steps to fine ones; then, for each scene and method, steps between the coarsest that
holds and the next one, until the largest stable step is known to a tenth.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Annotated, Any, Final

import numpy as np
import pandas as pd
from pydantic import Field

from pendbench.engines.registry import engine
from pendbench.errors import choose, printable
from pendbench.physics.exact import normal_modes
from pendbench.scene import Scene
from pendbench.strict import input_error
from pendbench.study.ask import version
from pendbench.study.case import Case
from pendbench.study.measure import growth_exponent
from pendbench.study.plan import Plan, StudyFile
from pendbench.study.results import Results
from pendbench.study.runner import Runner
from pendbench.study.stages import compile_kernels, job_of
from pendbench.study.verdict import rank
from pendbench.study.work import failed_stability, measure_stability

Record = dict[str, Any]
#: What a scene does with one method: scene, engine, method, settings.
Pair = tuple[str, str, str, str]

#: How well the largest stable step is known: to this factor.
PRECISION: Final = 1.1

_NO_FINER: Final = ("timed out", "out of memory")
_FINER: Final = 5.0  # by this much, where no step holds yet
_NEAR: Final = 1.5  # no step that is nearer to one that took too long is tried
_FEWEST_STEPS: Final = 20  # a run of fewer says nothing about stability
_RUN_COLUMNS: Final = ("verdict", "broke_s", "stays_s", "energy_drift_max", "gap_max", "steps")


class Options(StudyFile):
    """durations: how long a scene is run, s, where that is not its own duration. lengths: scenes that differ in n
    alone, over which the growth of the largest stable step is fitted. finest: the search goes no further down, s.
    """

    finest: Annotated[float, Field(ge=1e-6, le=1.0)] = 1e-5
    durations: dict[str, Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)]] = {}
    lengths: list[str] = []


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
        most = duration_of(plan, case.scene) / _FEWEST_STEPS
        if case.dt is not None and case.dt > most * (1 + 1e-9):
            raise input_error(plan.where, f"{case}: allowed: dt up to {most:g} s, for {_FEWEST_STEPS} steps")
    for name in plan.options.lengths:
        if name not in known:
            raise input_error(plan.where, f"lengths: {choose('scene', printable(name), known)}")


def duration_of(plan: Plan, scene: Scene) -> float:
    """How long a scene is run, s."""
    duration: float = plan.options.durations.get(scene.name, scene.duration)
    return duration


def run(plan: Plan, runner: Runner) -> Results:
    """Run the study."""
    study = _Stability(plan, runner)
    study.measure()
    return study.results()


def pair_of(case: Case) -> Pair:
    """What a case has in common with those that differ from it in step alone."""
    return case.scene.name, case.engine, case.method, case.settings_text


class _Stability:
    """What the study has found so far: a record for each case, those of the search among them."""

    def __init__(self, plan: Plan, runner: Runner) -> None:
        self.plan, self.runner, self.options = plan, runner, plan.options
        self.found: dict[Case, Record] = {}
        self.pairs: dict[Pair, list[Case]] = {}
        for case in plan.cases:
            self.pairs.setdefault(pair_of(case), []).append(case)

    def measure(self) -> None:
        """Run what the study asks for."""
        compile_kernels(self.runner, self.plan.cases, self.options.time_limit)
        self._measure_cases()
        self._search()

    def _measure_cases(self) -> None:
        """Step after step of every pair, the coarse ones first: a step that takes too long spares the finer ones."""
        waiting = {pair: sorted(cases, key=lambda case: -(case.dt or 0.0)) for pair, cases in self.pairs.items()}
        for number in range(max(map(len, waiting.values()), default=0)):
            batch = [cases[number] for cases in waiting.values() if number < len(cases)]
            self._run(f"step {number + 1} of each method", [case for case in batch if not self._settled(case)])

    def _settled(self, case: Case) -> bool:
        """Whether a case need not run, for a coarser step could not be finished either."""
        if case in self.found:
            return True
        coarser = [self.found[other] for other in self.pairs[pair_of(case)] if other in self.found]
        if any(record["verdict"] == "refused" for record in coarser):
            self.found[case] = coarser[0]
            return True
        spent = [record for record in coarser if record["verdict"] in _NO_FINER]
        if spent:
            self.found[case] = {**spent[0], "reason": f"a larger step already did: {spent[0]['reason']}"}
        return bool(spent)

    def _run(self, stage: str, cases: Sequence[Case]) -> None:
        jobs = {}
        for case in sorted(cases, key=self._effort, reverse=True):  # a long job begun last would leave workers idle
            duration = duration_of(self.plan, case.scene)
            content = (*case.content, duration, version(case.engine))
            jobs[case] = job_of(measure_stability, content, self.options.time_limit, case, duration)
        if jobs:
            values = self.runner.run(stage, list(jobs.values()), lambda _, fault: failed_stability(fault))
            self.found |= {case: values[job.key] for case, job in jobs.items()}

    def _effort(self, case: Case) -> float:
        """About how long a case takes, in links times steps; methods that choose their steps are quick."""
        return 0.0 if case.dt is None else case.scene.n * duration_of(self.plan, case.scene) / case.dt

    def _search(self) -> None:
        """Halve, on a logarithmic scale, what lies between a step that holds and one that does not; find both first."""
        number = 0
        while asked := [case for cases in self.pairs.values() if (case := self._next(cases)) is not None]:
            number += 1
            self._run(f"search, round {number}", asked)
            for case in asked:
                self.pairs[pair_of(case)].append(case)

    def _next(self, cases: Sequence[Case]) -> Case | None:
        """The next step to try with a method on a scene, None where nothing is left to learn."""
        first = cases[0]
        if first.dt is None or self.found[first]["verdict"] == "refused":
            return None
        low, high = self._bracket(cases)
        if low is None:
            dt = self._finer(cases)
        elif high is None:
            dt = _rounded(2.0 * low) if 2.0 * low * _FEWEST_STEPS <= duration_of(self.plan, first.scene) else None
        else:
            dt = _rounded(math.sqrt(low * high)) if high > PRECISION * low else None
        return None if dt is None else Case(first.scene, first.engine, first.method, dt, first.settings)

    def _finer(self, cases: Sequence[Case]) -> float | None:
        """A step to try where none holds yet: finer than all, or the finest that there may be time for."""
        spent = [case.dt or 0.0 for case in cases if self.found[case]["verdict"] in _NO_FINER]
        finished = [case.dt or 0.0 for case in cases if self.found[case]["verdict"] not in _NO_FINER]
        if not finished:
            return None
        if not spent:
            dt = _rounded(min(finished) / _FINER)
            return dt if dt >= self.options.finest else None
        return _rounded(math.sqrt(max(spent) * min(finished))) if min(finished) > _NEAR * max(spent) else None

    def _bracket(self, cases: Sequence[Case]) -> tuple[float | None, float | None]:
        """The largest step that holds, None where none does, and the smallest of those above it, None without."""
        steps = {case.dt: self.found[case]["verdict"] for case in cases if case.dt is not None}
        holding = [dt for dt, verdict in steps.items() if verdict == "holds"]
        if not holding:
            return None, None
        above = [dt for dt in steps if dt > max(holding)]
        return max(holding), min(above, default=None)

    def results(self) -> Results:
        """The tables."""
        steps = {pair: self._step_row(cases) for pair, cases in self.pairs.items()}
        best = _best(steps.values())
        for row in steps.values():
            row["stable_dt_ratio"] = row["stable_dt"] / best.get(row["scene"], math.nan)
        asked = set(self.plan.cases)
        searched = [case for cases in self.pairs.values() for case in cases if case not in asked]
        return Results(
            name=self.plan.name,
            title=self.options.title,
            kind=self.options.kind,
            cases=pd.DataFrame([self._row(case, steps[pair_of(case)]) for case in self.plan.cases]),
            tables={
                "scenes": pd.DataFrame([self._scene_row(scene) for scene in self.plan.scenes]),
                "stable_steps": pd.DataFrame(steps.values()),
                "growth": pd.DataFrame(self._growth_rows(steps)),
                "search": pd.DataFrame([self._row(case, steps[pair_of(case)]) for case in searched]),
            },
            options=self.options.model_dump(mode="json", exclude={"quick"}),
            quick=self.plan.quick,
        )

    def _scene_row(self, scene: Scene) -> Record:
        return {
            "scene": scene.name,
            "n": scene.n,
            "title": scene.title,
            "duration_s": duration_of(self.plan, scene),
            "stiffest_rad_per_s": _stiffest(scene),
            "fastest_rad_per_s": float(np.abs(scene.rates).max()),
        }

    def _step_row(self, cases: Sequence[Case]) -> Record:
        low, high = self._bracket(cases)
        first = cases[0]
        method = engine(first.engine).methods[first.method]
        best = min(cases, key=lambda case: (rank(self.found[case]["verdict"]), -(case.dt or 0.0)))
        return {
            "scene": first.scene.name,
            "n": first.scene.n,
            "engine": first.engine,
            "method": first.method,
            "settings": first.settings_text,
            "adaptive": method.adaptive,
            "substeps": method.substeps,
            "best_verdict": self.found[best]["verdict"],
            "reason": self.found[best]["reason"],
            "stable_dt": math.nan if low is None else low,
            "unbroken_dt": max((case.dt or 0.0 for case in cases if self._is_whole(case)), default=math.nan),
            "unsettled": low is None and any(self.found[case]["verdict"] in _NO_FINER for case in cases),
            "stable_dt_stiffest": (low or math.nan) * _stiffest(first.scene),
            "bound": low is not None and high is None,
        }

    def _is_whole(self, case: Case) -> bool:
        return case.dt is not None and self.found[case]["verdict"] in ("holds", "drifts")

    def _growth_rows(self, steps: dict[Pair, Record]) -> Iterator[Record]:
        """How the largest stable step falls with n, for each method over the scenes that differ in n alone."""
        for name, method, settings in dict.fromkeys(pair[1:] for pair in steps):
            rows = [
                steps[pair]
                for pair in steps
                if pair[0] in self.options.lengths and pair[1:] == (name, method, settings)
            ]
            known = sorted((row["n"], row["stable_dt"]) for row in rows if row["stable_dt"] > 0 and not row["bound"])
            if rows and not rows[0]["adaptive"]:
                n, dt = (np.array([each[at] for each in known], dtype=float) for at in (0, 1))
                yield {
                    "engine": name,
                    "method": method,
                    "settings": settings,
                    "n_from": n[0] if len(n) else math.nan,
                    "n_to": n[-1] if len(n) else math.nan,
                    "stable_dt_exponent": growth_exponent(n, dt),
                    "scenes_held": sum(row["stable_dt"] > 0 for row in rows),
                    "scenes": len(rows),
                }

    def _row(self, case: Case, step: Record) -> Record:
        record = self.found[case]
        row: Record = {
            "scene": case.scene.name,
            "n": case.scene.n,
            "engine": case.engine,
            "method": case.method,
            "dt": math.nan if case.dt is None else case.dt,
            "settings": case.settings_text,
            "status": record["status"],
            "reason": record["reason"],
            "duration_s": duration_of(self.plan, case.scene),
            "horizon_s": math.nan,
            "error_max": math.nan,
            **{name: record.get(name) for name in _RUN_COLUMNS},
            "stable_dt": step["stable_dt"],
            "step_us": math.nan,
            "run_s": math.nan,
        }
        return {name: math.nan if value is None else value for name, value in row.items()}


@cache
def _stiffest(scene: Scene) -> float:
    """The fastest small oscillation about the hanging chain, rad/s; nan without gravity, where there is none."""
    return float(normal_modes(scene)[0][-1]) if scene.effects.gravity else math.nan


def _rounded(dt: float) -> float:
    """To four digits: a step that people can type."""
    return float(f"{dt:.4g}")


def _best(rows: Iterable[Record]) -> dict[str, float]:
    """The largest stable step of each scene."""
    best: dict[str, float] = {}
    for row in rows:
        if row["stable_dt"] > 0 and not row["substeps"]:
            best[row["scene"]] = max(best.get(row["scene"], 0.0), row["stable_dt"])
    return best
