"""The kind of study `cost`: what accuracy costs in time.

Its jobs, in order: the truth of every scene; every case against it; long runs, for what drifts; and, one at a time when
nothing else runs, what each case costs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any, Final

import numpy as np
import pandas as pd
from pydantic import Field

from pendbench.arrays import FloatArray
from pendbench.engines.registry import engine
from pendbench.errors import choose, printable
from pendbench.scene import Scene
from pendbench.scene_file import Table
from pendbench.strict import input_error
from pendbench.study import flags
from pendbench.study.ask import refusal, version
from pendbench.study.case import Case, settings_text
from pendbench.study.jobs import Job
from pendbench.study.measure import observed_order, price_of, price_of_digit
from pendbench.study.plan import Plan, StudyFile
from pendbench.study.results import Results
from pendbench.study.runner import Runner
from pendbench.study.stages import compile_kernels, fault_record, job_of, truth_job
from pendbench.study.work import failed_run, measure_cost_timing, measure_error, measure_long_run

Record = dict[str, Any]
Series = tuple[str, str, str, str]

#: The settings that stand for a step in a method that chooses its own.
_INSTEAD_OF_STEPS: Final = ("tolerance",)

_ACCURACIES: Final = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
_RUN_COLUMNS: Final = ("error_max", "angle_error_max_rad", "reference_error", "energy_drift_max", "gap_max", "steps")
_TIMING_COLUMNS: Final = (
    "step_us", "step_spread", "step_and_state_us", "simulated_s_per_s", "build_s", "first_call_s", "run_s",
)  # fmt: skip
_ERROR_FLOOR: Final = 1e-12
_ERROR_CEILING: Final = 0.03


class Window(Table):
    """Over what a scene's errors are compared: the largest of `samples` evenly spaced ones up to `time` (s)."""

    time: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
    samples: Annotated[int, Field(ge=1, le=100_000)]


class LongRuns(Table):
    """[long_runs]: the energy over `steps` steps of `dt` (s), for these scenes and every method with a fixed step."""

    scenes: Annotated[list[str], Field(min_length=1)]
    steps: Annotated[int, Field(ge=1000, le=10**9)]
    dt: Annotated[float, Field(gt=0, le=1e3, allow_inf_nan=False)]


class Options(StudyFile):
    """windows: for each scene what is compared. accuracies: the errors whose price is asked for."""

    windows: dict[str, Window]
    accuracies: Annotated[list[Annotated[float, Field(gt=0, lt=1)]], Field(min_length=1)] = list(_ACCURACIES)
    long_runs: LongRuns | None = None


def check(plan: Plan) -> None:
    """Raise InputError where a scene has no window, or one that is longer than the scene."""
    names = [scene.name for scene in plan.scenes]
    windows, long_runs = plan.options.windows, plan.options.long_runs
    for scene in plan.scenes:
        if scene.name not in windows:
            raise input_error(f"{plan.where} [windows]", f"missing key {scene.name!r}, one of the study's scenes")
        if windows[scene.name].time > scene.duration:
            found, most = windows[scene.name].time, scene.duration
            raise input_error(f"{plan.where} [windows.{scene.name}]", f"time is {found:g}; allowed: up to {most:g} s")
    for case in plan.cases:
        most = windows[case.scene.name].time
        if case.dt is not None and case.dt > most:
            raise input_error(plan.where, f"{case}: allowed: dt up to {most:g} s, the time that is compared")
    for name in long_runs.scenes if long_runs else ():
        if name not in names:
            raise input_error(f"{plan.where} [long_runs]", f"scenes: {choose('scene', printable(name), names)}")


def run(plan: Plan, runner: Runner) -> Results:
    """Run the study."""
    study = _Cost(plan, runner)
    study.measure()
    return study.results()


def times_of(case: Case, window: Window) -> FloatArray:
    """The times at which a case is compared: the window's samples, each on a whole step of the case."""
    times = np.linspace(0.0, window.time, window.samples + 1)
    if case.dt is not None:
        times = np.unique(np.rint(times / case.dt)) * case.dt
    return np.round(times, 12)


def series_of(case: Case) -> Series:
    """What a case has in common with those that differ from it in step or tolerance alone."""
    return case.scene.name, case.engine, case.method, settings_text(_lasting(case))


def step_of(case: Case) -> float:
    """The step, s, or what stands for it: the smaller, the better and the dearer."""
    return tolerance_of(case) if case.dt is None else case.dt


def tolerance_of(case: Case) -> float:
    """The tolerance of a method that chooses its steps, its default where none is given; nan for other methods."""
    settings = engine(case.engine).methods[case.method].with_defaults(dict(case.settings))
    return settings.get("tolerance", math.nan) if case.dt is None else math.nan


def _lasting(case: Case) -> tuple[tuple[str, float], ...]:
    return tuple((name, value) for name, value in case.settings if name not in _INSTEAD_OF_STEPS)


class _Cost:
    """What the study has found so far: records by scene and by case."""

    def __init__(self, plan: Plan, runner: Runner) -> None:
        self.plan, self.runner, self.options = plan, runner, plan.options
        self.truths: dict[str, Record] = {}
        self.runs: dict[Case, Record] = {}
        self.timings: dict[Case, Record] = {}
        self.long: dict[Case, Record] = {}
        self.refusals = {case: refusal(case) for case in plan.cases}
        self.accepted = [case for case in plan.cases if self.refusals[case] is None]

    def measure(self) -> None:
        """Run what the study asks for."""
        compile_kernels(self.runner, self.plan.cases, self.options.time_limit)
        self._measure_truths()
        self._measure_runs()
        self._measure_long_runs()
        self._measure_timings()

    def _job(self, function: Any, depends_on: tuple[object, ...], *arguments: Any) -> Job:
        return job_of(function, depends_on, self.options.time_limit, *arguments)

    def _measure_truths(self) -> None:
        owners = {}
        for scene in self.plan.scenes:
            cases = [case for case in self.plan.cases if case.scene is scene]
            window = self.options.windows[scene.name]
            times = np.unique(np.concatenate([times_of(case, window) for case in cases])) if cases else np.zeros(1)
            owners[scene.name] = truth_job(scene, times, self.runner.store, self.options.time_limit)
        found = self.runner.run("the truth", list(owners.values()), lambda _, fault: fault_record(fault))
        self.truths = {name: {**found[job.key], "key": job.key} for name, job in owners.items()}

    def _measure_runs(self) -> None:
        owners = {}
        for case in self.accepted:
            times, truth = times_of(case, self.options.windows[case.scene.name]), self.truths[case.scene.name]["key"]
            content = (*case.content, version(case.engine), truth, times.tobytes())
            owners[case] = self._job(measure_error, content, case, times, truth, self.runner.store)
        found = self.runner.run("the errors", list(owners.values()), lambda _, fault: failed_run(fault))
        self.runs = {case: found[job.key] for case, job in owners.items()}

    def _long_cases(self) -> Iterator[Case]:
        """Each method with a fixed step that the study names, with its default settings."""
        long_runs = self.options.long_runs
        wanted = dict.fromkeys((case.scene, case.engine, case.method) for case in self.accepted if case.dt is not None)
        for scene, name, method in wanted:
            if long_runs is not None and scene.name in long_runs.scenes:
                yield Case(scene, name, method, long_runs.dt)

    def _measure_long_runs(self) -> None:
        owners = {}
        for case in self._long_cases():
            content = (*case.content, self.options.long_runs.steps, version(case.engine))
            owners[case] = self._job(measure_long_run, content, case, self.options.long_runs.steps)
        found = self.runner.run("long runs", list(owners.values()), lambda _, fault: failed_run(fault))
        self.long = {case: found[job.key] for case, job in owners.items()}

    def _measure_timings(self) -> None:
        owners = {}
        for case in self.accepted:
            if self.runs[case]["status"] != "ok":
                continue  # how quickly a run fails is not what it costs
            window = self.options.windows[case.scene.name]
            content = (*case.content, window.time, version(case.engine))
            arguments = (case, window.time, window.time / window.samples)
            owners[case] = self._job(measure_cost_timing, content, *arguments)
        found = self.runner.run(
            "the clock, one at a time", list(owners.values()), lambda _, fault: fault_record(fault), alone=True
        )
        self.timings = {case: found[job.key] for case, job in owners.items()}

    def results(self) -> Results:
        """The tables."""
        groups: dict[Series, list[Case]] = {}
        for case in self.plan.cases:
            groups.setdefault(series_of(case), []).append(case)
        orders = {key: self._order_row(cases) for key, cases in groups.items()}
        prices = [row for cases in groups.values() for row in self._price_rows(cases)]
        return Results(
            name=self.plan.name,
            title=self.options.title,
            kind=self.options.kind,
            cases=pd.DataFrame([self._row(case, orders[series_of(case)]) for case in self.plan.cases]),
            tables={
                "scenes": pd.DataFrame([self._scene_row(scene) for scene in self.plan.scenes]),
                "orders": pd.DataFrame(orders.values()),
                "prices": pd.DataFrame(prices),
                "long_runs": pd.DataFrame([_long_row(case, record) for case, record in self.long.items()]),
                "curves": pd.DataFrame([row for case, record in self.long.items() for row in _curve(case, record)]),
            },
            options=self.options.model_dump(mode="json", exclude={"quick"}),
            quick=self.plan.quick,
        )

    def _scene_row(self, scene: Scene) -> Record:
        truth, window = self.truths[scene.name], self.options.windows[scene.name]
        return {
            "scene": scene.name,
            "n": scene.n,
            "compare_s": window.time,
            "samples": window.samples,
            "horizon_s": truth.get("horizon", math.nan),
            "reference_error": truth.get("error", math.nan),
            "status": truth["status"],
            "reason": truth["reason"],
        }

    def _points(self, cases: Sequence[Case]) -> FloatArray:
        """Step, error, time, and time with a look at every state, (4, j), of each case that was measured and timed."""
        rows = [
            (step_of(case), self.runs[case].get("error_max"), self.timings[case].get("run_s"), self._with_states(case))
            for case in cases
            if case in self.timings
        ]
        known = [[math.nan if value is None else value for value in row] for row in rows]
        points = np.array(known, dtype=float).reshape(-1, 4)
        timed: FloatArray = points[np.isfinite(points[:, 2])].T
        return timed

    def _with_states(self, case: Case) -> float:
        """What a caller pays, s, who looks at the state after every step, or at every sample of a method without."""
        window = self.options.windows[case.scene.name]
        looks: int = window.samples if case.dt is None else max(1, round(window.time / case.dt))
        look_us: float = self.timings[case].get("step_and_state_us", math.nan)
        return 1e-6 * look_us * looks

    def _order_row(self, cases: Sequence[Case]) -> Record:
        first = cases[0]
        method = engine(first.engine).methods[first.method]
        step, error, run_s, _ = self._points(cases)
        fit = None if method.adaptive or not len(step) else observed_order(step, error, _ERROR_FLOOR, _ERROR_CEILING)
        return {
            "scene": first.scene.name,
            "n": first.scene.n,
            "engine": first.engine,
            "method": first.method,
            "settings": settings_text(_lasting(first)),
            "order_claimed": None if method.adaptive else method.order,
            "order_observed": fit.order if fit else math.nan,
            "order_dt_coarse": fit.coarse if fit else math.nan,
            "order_dt_fine": fit.fine if fit else math.nan,
            "plateau": fit.plateau if fit and fit.plateau is not None else math.nan,
            "digit_price": price_of_digit(error, run_s, _ERROR_FLOOR, _ERROR_CEILING),
            "best_error": float(np.nanmin(error)) if np.isfinite(error).any() else math.nan,
        }

    def _price_rows(self, cases: Sequence[Case]) -> Iterator[Record]:
        first = cases[0]
        adaptive = engine(first.engine).methods[first.method].adaptive
        step, error, run_s, with_states_s = self._points(cases)
        for accuracy in self.options.accuracies:
            price = price_of(accuracy, step, error, run_s)
            yield {
                "scene": first.scene.name,
                "accuracy": accuracy,
                "engine": first.engine,
                "method": first.method,
                "settings": settings_text(_lasting(first)),
                "dt": math.nan if adaptive else price.step,
                "tolerance": price.step if adaptive else math.nan,
                "run_s": price.run_s,
                "with_states_s": price_of(accuracy, step, error, with_states_s).run_s,
                "bound": price.bound,
                "best_error": price.best,
            }

    def _row(self, case: Case, order: Record) -> Record:
        run, timing = self.runs.get(case, {}), self.timings.get(case, {})
        refused, truth = self.refusals[case], self.truths[case.scene.name]
        row: Record = {
            "scene": case.scene.name,
            "n": case.scene.n,
            "engine": case.engine,
            "method": case.method,
            "dt": math.nan if case.dt is None else case.dt,
            "tolerance": tolerance_of(case),
            "settings": case.settings_text,
            "status": "refused" if refused else run["status"],
            "reason": refused or run["reason"],
            "horizon_s": truth.get("horizon", math.nan),
            "compare_s": self.options.windows[case.scene.name].time,
            **{name: run.get(name) for name in _RUN_COLUMNS},
            **{name: order[name] for name in ("order_claimed", "order_observed", "plateau")},
            **{name: timing.get(name) for name in _TIMING_COLUMNS},
            "flags": "; ".join(flags.of_priced_row(run, order, timing)),
        }
        return {name: math.nan if value is None else value for name, value in row.items()}


def _long_row(case: Case, record: Record) -> Record:
    row = {"scene": case.scene.name, "n": case.scene.n, "engine": case.engine, "method": case.method, "dt": case.dt}
    row |= {name: value for name, value in record.items() if name not in {"curve", "order_error"}}
    return {name: math.nan if value is None else value for name, value in row.items()}


def _curve(case: Case, record: Record) -> Iterable[Record]:
    for t, _, energy in zip(*record["curve"], strict=True) if "curve" in record else ():
        yield {
            "scene": case.scene.name,
            "engine": case.engine,
            "method": case.method,
            "dt": case.dt,
            "settings": "",
            "t_s": t,
            "error": None,
            "energy_error": energy,
        }
