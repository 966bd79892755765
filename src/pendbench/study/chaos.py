"""The kind of study `chaos`: how long does each engine stay with the truth, and why does it leave it?

Its jobs, in order: the truth of every start; every case from every start against it; the three causes; and, one at a
time when nothing else runs, what each case costs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Final

import numpy as np
import pandas as pd
from pydantic import Field

from pendbench.arrays import FloatArray
from pendbench.engines.registry import engine
from pendbench.scene import Scene
from pendbench.strict import input_error
from pendbench.study import flags
from pendbench.study.ask import refusal, version
from pendbench.study.case import Case
from pendbench.study.jobs import Job
from pendbench.study.measure import OrderFit, observed_order
from pendbench.study.plan import Plan, StudyFile
from pendbench.study.results import Results
from pendbench.study.runner import Runner, distinct
from pendbench.study.stages import compile_kernels, fault_record, job_of, truth_job
from pendbench.study.work import (
    THRESHOLDS,
    failed_run,
    measure_exponent,
    measure_model,
    measure_run,
    measure_timing,
)
from pendbench.trajectory import STATUSES

Record = dict[str, Any]

_ERROR_FLOOR: Final = 1e-13  # below it an error is rounding, and says nothing about an order
_MOST_SAMPLES: Final = 1e6
_ERROR_CEILING: Final = 0.03  # above it an error is no longer small, and says nothing either


class Options(StudyFile):
    """starts: how many perturbed starts beside the scene's own; perturbation: their angles' standard deviation, rad;
    sample: s between the times that are compared; order_time: s at which orders are fitted; lyapunov_time: s.
    """

    starts: Annotated[int, Field(ge=0, le=10_000)] = 8
    perturbation: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.01
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    sample: Annotated[float, Field(gt=0, le=1e3, allow_inf_nan=False)] = 0.01
    order_time: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)] = 0.5
    lyapunov_time: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)] = 200.0


def starts_of(scene: Scene, options: Options) -> list[Scene]:
    """The scene, and the scene from each perturbed start."""
    random = np.random.default_rng([options.seed, scene.n])
    changes = options.perturbation * random.standard_normal((options.starts, scene.n))
    return [scene, *(scene.with_start(scene.angles + change, scene.rates) for change in changes)]


def times_of(case: Case, sample: float) -> FloatArray:
    """The times at which a case is compared: about every `sample` s, on whole steps of the case."""
    count = max(1, math.floor(case.scene.duration / sample + 1e-9))
    times = np.arange(count + 1) * sample
    if case.dt is not None:
        last = math.floor(case.scene.duration / case.dt + 1e-9)
        times = np.unique(np.minimum(np.rint(times / case.dt), last)) * case.dt
    return np.round(times, 12)


def check(plan: Plan) -> None:
    """Raise InputError where the samples would be too many, or too few to see anything."""
    for scene in plan.scenes:
        if not 1 <= scene.duration / plan.options.sample <= _MOST_SAMPLES:
            low, high = scene.duration / _MOST_SAMPLES, scene.duration
            allowed = f"{low:.3g} to {high:g} s, for the {high:g} s of scene {scene.name!r}"
            raise input_error(plan.where, f"sample is {plan.options.sample:g}; allowed: {allowed}")


def run(plan: Plan, runner: Runner) -> Results:
    """Run the study."""
    study = _Chaos(plan, runner)
    study.measure()
    return study.results()


class _Chaos:
    """What the study has found so far: records by scene, by scene and start, by case and start, by case."""

    def __init__(self, plan: Plan, runner: Runner) -> None:
        self.plan, self.runner, self.options = plan, runner, plan.options
        asked = {case.scene.name for case in plan.cases}  # where not all engines are, some scenes may not be
        self.scenes = [scene for scene in plan.scenes if scene.name in asked]
        self.starts = {scene.name: starts_of(scene, self.options) for scene in self.scenes}
        self.truths: dict[tuple[str, int], Record] = {}
        self.exponents: dict[str, Record] = {}
        self.runs: dict[tuple[Case, int], Record] = {}
        self.models: dict[Case, Record] = {}
        self.timings: dict[Case, Record] = {}
        self.refusals = {case: refusal(case) for case in plan.cases}
        self.accepted = [case for case in plan.cases if self.refusals[case] is None]

    def measure(self) -> None:
        """Run what the study asks for."""
        compile_kernels(self.runner, self.plan.cases, self.options.time_limit)
        self._measure_truths()
        self._measure_runs()
        self._measure_models()
        self._measure_timings()

    def _job(self, function: Any, depends_on: tuple[object, ...], *arguments: Any) -> Job:
        return job_of(function, depends_on, self.options.time_limit, *arguments)

    def _measure_truths(self) -> None:
        jobs, owners = [], {}
        for name, starts in self.starts.items():
            cases = [case for case in self.plan.cases if case.scene.name == name]
            times = np.unique(np.concatenate([times_of(case, self.options.sample) for case in cases]))
            for index, start in enumerate(starts):
                job = truth_job(start, times, self.runner.store, self.options.time_limit)
                jobs.append(job)
                owners[name, index] = job.key
        exponents = {
            scene.name: self._job(
                measure_exponent, (scene.digest, self.options.lyapunov_time), scene, self.options.lyapunov_time
            )
            for scene in self.scenes
        }
        stage = distinct([*jobs, *exponents.values()])
        found = self.runner.run("the truth", stage, lambda _, fault: fault_record(fault))
        self.truths = {owner: {**found[key], "key": key} for owner, key in owners.items()}
        self.exponents = {name: found[job.key] for name, job in exponents.items()}

    def _measure_runs(self) -> None:
        jobs, owners = [], {}
        for case in self.accepted:
            times = times_of(case, self.options.sample)
            for index, start in enumerate(self.starts[case.scene.name]):
                truth = self.truths[case.scene.name, index]["key"]
                content = (
                    start.digest,
                    *case.content[1:],
                    version(case.engine),
                    truth,
                    self.options.order_time,
                    index == 0,
                )
                arguments = (case, start, times, truth, self.runner.store, self.options.order_time, index == 0)
                job = self._job(measure_run, content, *arguments)
                jobs.append(job)
                owners[case, index] = job.key
        found = self.runner.run("the engines", distinct(jobs), lambda _, fault: failed_run(fault))
        self.runs = {owner: found[key] for owner, key in owners.items()}

    def _measure_models(self) -> None:
        owners = {}
        for case in self.accepted:
            content = (case.scene.digest, case.engine, case.method, case.settings, version(case.engine))
            owners[case] = self._job(measure_model, (*content, self.options.seed), case, self.options.seed)
        found = self.runner.run("the causes", distinct(owners.values()), lambda _, fault: fault_record(fault))
        self.models = {case: found[job.key] for case, job in owners.items()}

    def _measure_timings(self) -> None:
        owners = {}
        for case in self.accepted:
            until = self.truths[case.scene.name, 0].get("horizon") or case.scene.duration
            content = (*case.content, until, version(case.engine))
            owners[case] = self._job(measure_timing, content, case, until)
        found = self.runner.run(
            "the clock, one at a time", distinct(owners.values()), lambda _, fault: fault_record(fault), alone=True
        )
        self.timings = {case: found[job.key] for case, job in owners.items()}

    def results(self) -> Results:
        """The tables."""
        causes = {key: self._causes(cases) for key, cases in self._by_method().items()}
        rows = [self._row(case, causes[_method_key(case)]) for case in self.plan.cases]
        return Results(
            name=self.plan.name,
            title=self.options.title,
            kind=self.options.kind,
            cases=pd.DataFrame(rows),
            tables={
                "scenes": pd.DataFrame([self._scene_row(scene) for scene in self.scenes]),
                "causes": pd.DataFrame(causes.values()),
                "starts": pd.DataFrame(self._start_rows()),
                "curves": pd.DataFrame(self._curve_rows()),
            },
            options=self.options.model_dump(mode="json", exclude={"quick"}),
            quick=self.plan.quick,
        )

    def _by_method(self) -> dict[tuple[object, ...], list[Case]]:
        groups: dict[tuple[object, ...], list[Case]] = {}
        for case in self.plan.cases:
            groups.setdefault(_method_key(case), []).append(case)
        return groups

    def _exponent(self, scene: str) -> float:
        found = self.exponents[scene]
        return found["rate"] if found.get("chaotic") else math.nan

    def _scene_row(self, scene: Scene) -> Record:
        truths = [self.truths[scene.name, index] for index in range(self.options.starts + 1)]
        horizons = [truth.get("horizon", math.nan) for truth in truths]
        exponent = self.exponents[scene.name]
        return {
            "scene": scene.name,
            "n": scene.n,
            "duration_s": scene.duration,
            "starts": len(truths),
            "horizon_s": horizons[0],
            "horizon_min_s": min(horizons),
            "horizon_max_s": max(horizons),
            "reference_error": truths[0].get("error", math.nan),
            "lyapunov_per_s": exponent.get("rate", math.nan),
            "lyapunov_error_per_s": exponent.get("error", math.nan),
            "growth_per_s": truths[0].get("growth", math.nan),
            "chaotic": bool(exponent.get("chaotic", False)),
            "status": truths[0].get("status", "ok"),
            "reason": truths[0].get("reason", ""),
        }

    def _fit(self, cases: Iterable[Case]) -> OrderFit | None:
        points = [
            (case.dt, self.runs[case, 0]["order_error"])
            for case in cases
            if case.dt is not None and (case, 0) in self.runs and self.runs[case, 0]["order_error"] is not None
        ]
        if not points:
            return None
        steps, errors = np.array(points).T
        return observed_order(steps, errors, _ERROR_FLOOR, _ERROR_CEILING)

    def _causes(self, cases: list[Case]) -> Record:
        """The three causes for one scene, engine, method and settings, over its steps."""
        first = cases[0]
        method = engine(first.engine).methods[first.method]
        fit = self._fit(cases)
        model = self.models.get(first, {})
        growths = [self.runs[case, i].get("growth") for case in cases for i in range(self.options.starts + 1)
                   if (case, i) in self.runs]  # fmt: skip
        known = [growth for growth in growths if growth is not None and math.isfinite(growth)]
        record = {
            "scene": first.scene.name,
            "n": first.scene.n,
            "engine": first.engine,
            "method": first.method,
            "settings": first.settings_text,
            "model_error": model.get("error", math.nan),
            "model_error_limit": model.get("limit", math.nan),
            "order_claimed": None if method.adaptive else method.order,
            "order_observed": fit.order if fit else math.nan,
            "order_dt_coarse": fit.coarse if fit else math.nan,
            "order_dt_fine": fit.fine if fit else math.nan,
            "plateau": fit.plateau if fit and fit.plateau is not None else math.nan,
            "growth_per_s": float(np.median(known)) if known else math.nan,
            "neighbours_growth_per_s": self.truths[first.scene.name, 0].get("growth", math.nan),
            "lyapunov_per_s": self._exponent(first.scene.name),
        }
        return {**record, "cause": flags.cause(record)}

    def _row(self, case: Case, causes: Record) -> Record:
        truth = self.truths[case.scene.name, 0]
        runs = [self.runs[case, i] for i in range(self.options.starts + 1) if (case, i) in self.runs]
        row: Record = {
            "scene": case.scene.name,
            "n": case.scene.n,
            "engine": case.engine,
            "method": case.method,
            "dt": math.nan if case.dt is None else case.dt,
            "settings": case.settings_text,
            **_ending(runs, self.refusals[case], truth),
            "horizon_s": truth.get("horizon", math.nan),
            "reference_error": truth.get("error", math.nan),
        }
        own = runs[0] if runs else {}
        for name in ("error_max", "error_half", "angle_error_max_rad", "reference_error_half"):
            row[name] = own.get(name)
        row.update(self._divergence(case.scene.name, runs))
        for name in ("energy_drift_max", "energy_drift_final", "energy_drift_band", "energy_drift_slope_per_s",
                     "energy_drift_half", "gap_max"):  # fmt: skip
            row[name] = own.get(name)
        row.update({name: causes[name] for name in ("model_error", "order_claimed", "order_observed", "plateau")})
        row["growth_per_s"] = own.get("growth")
        row["cause"] = causes["cause"]
        timing = self.timings.get(case, {})
        for name in ("step_us", "step_spread", "simulated_s_per_s", "build_s", "first_call_s", "run_s"):
            row[name] = timing.get(name)
        row["flags"] = "; ".join(flags.of_row(own, causes, self.models.get(case, {}), timing))
        return {name: math.nan if value is None else value for name, value in row.items()}

    def _divergence(self, scene: str, runs: list[Record]) -> Record:
        """Times to each threshold over the starts: the median, the extremes, and how many did not get there.

        The median counts a start that did not get there as later than all that did; where it falls on one of those,
        it is empty.
        """
        row: Record = {"starts": len(runs)}
        exponent = self._exponent(scene)
        for position, threshold in enumerate(THRESHOLDS):
            name = f"t_{threshold:.0e}".replace("e-0", "e-")
            found = [run["crossings"][position] for run in runs if run.get("crossings")]
            reached = sorted(crossing[0] for crossing in found if crossing)
            median = _median(reached, len(found))
            row[f"{name}_s"] = median
            row[f"{name}_min_s"] = reached[0] if reached else math.nan
            row[f"{name}_max_s"] = reached[-1] if len(reached) == len(found) and found else math.nan
            row[f"{name}_lyapunov"] = median * exponent
            row[f"{name}_not_reached"] = len(found) - len(reached)
            row[f"{name}_band_s"] = max((c[2] - c[1] for c in found if c), default=math.nan)
        return row

    def _start_rows(self) -> Iterable[Record]:
        for (case, index), record in self.runs.items():
            crossings = record.get("crossings") or [None] * len(THRESHOLDS)
            yield {
                "scene": case.scene.name,
                "start": index,
                "engine": case.engine,
                "method": case.method,
                "dt": case.dt,
                "settings": case.settings_text,
                "status": record["status"],
                "reason": record["reason"],
                "horizon_s": self.truths[case.scene.name, index].get("horizon"),
                "error_max": record.get("error_max"),
                "energy_drift_max": record.get("energy_drift_max"),
                **{
                    f"t_{threshold:.0e}_s".replace("e-0", "e-"): crossing[0] if crossing else None
                    for threshold, crossing in zip(THRESHOLDS, crossings, strict=True)
                },
            }

    def _curve_rows(self) -> Iterable[Record]:
        for (case, index), record in self.runs.items():
            curve = record.get("curve") if index == 0 else None
            for t, error, energy in zip(*curve, strict=True) if curve else ():
                yield {
                    "scene": case.scene.name,
                    "engine": case.engine,
                    "method": case.method,
                    "dt": case.dt,
                    "settings": case.settings_text,
                    "t_s": t,
                    "error": error,
                    "energy_error": energy,
                }


def _method_key(case: Case) -> tuple[object, ...]:
    return case.scene.name, case.engine, case.method, case.settings


def _median(reached: list[float], total: int) -> float:
    """The median of `total` times of which only `reached` (sorted) are known, the others being later."""
    low, high = (total - 1) // 2, total // 2
    return 0.5 * (reached[low] + reached[high]) if total and high < len(reached) else math.nan


def _ending(runs: list[Record], refusal: str | None, truth: Mapping[str, Any]) -> Record:
    """How a case ended: as the worst of its starts did."""
    if refusal is not None:
        return {"status": "refused", "reason": refusal}
    ranks = list(STATUSES)
    index = max(range(len(runs)), key=lambda i: ranks.index(runs[i]["status"]))
    worst = runs[index]
    where = f" (start {index} of {len(runs) - 1})" if index else ""
    reason = f"{worst['reason']}{where}" if worst["reason"] else ""
    if "horizon" not in truth:
        reason = "; ".join(filter(None, [reason, f"not compared, for want of a truth: {truth.get('reason', '')}"]))
    return {"status": worst["status"], "reason": reason}
