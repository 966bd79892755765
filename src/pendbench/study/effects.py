"""The kind of study `effects`: how well each engine simulates each effect, and what the effect costs it.

Its jobs: the truth of each scene; every case against it, with the balance of its energy; then, alone on the machine,
the cost of a step of one chain with one effect at a time against that of the bare chain.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any, Final

import numpy as np
import pandas as pd
from pydantic import Field

from pendbench.engines.protocol import mapped_effects
from pendbench.engines.registry import engine
from pendbench.scene import Effects, Scene
from pendbench.strict import input_error, show
from pendbench.study.ask import refusal, version
from pendbench.study.case import Case
from pendbench.study.effect_work import measure_effect, measure_effect_truth, measure_prices, truth_times
from pendbench.study.jobs import Job
from pendbench.study.measure import observed_order
from pendbench.study.plan import Plan, StudyFile
from pendbench.study.results import Results
from pendbench.study.runner import Runner
from pendbench.study.stages import fault_record, job_of
from pendbench.study.store import key_of
from pendbench.study.work import compile_kernel

Record = dict[str, Any]

#: The chain with nothing but gravity, and with all effects of the scene at once, in the tables of prices.
BARE: Final = "bare"
ALL: Final = "all"
#: The bare chain with what the engine has on by itself, where that can be asked for.
DEFAULTS: Final = "bare, default flags"

_NO_PRICE: Final = dict.fromkeys(("step_us", "step_price", "price_spread"), math.nan)
_FLOOR: Final = 1e-12
_CEILING: Final = 0.05
_MEASURED: Final = ("error_max", "balance_error", "balance_floor", "moved_max_rad", "gap_max", "steps")


class Options(StudyFile):
    """priced: the scene whose effects are priced, one at a time. price_step: s, with which."""

    priced: str
    price_step: Annotated[float, Field(ge=1e-6, le=1)] = 1e-4


def check(plan: Plan) -> None:
    """Raise InputError where the scene to price is none of the study's, or has no effect to price."""
    allowed = [scene.name for scene in plan.scenes if not scene.terms.keys() <= {"gravity"}]
    if plan.options.priced not in allowed:
        one = f"one of its scenes with more than gravity ({', '.join(allowed) or 'there is none'})"
        raise input_error(plan.where, f"priced is {show(plan.options.priced)}; allowed: {one}")


def run(plan: Plan, runner: Runner) -> Results:
    """Run the study."""
    study = _Effects(plan, runner)
    study.measure()
    return study.results()


class _Effects:
    """What the study has found so far."""

    def __init__(self, plan: Plan, runner: Runner) -> None:
        self.plan, self.runner, self.options = plan, runner, plan.options
        self.limit = plan.options.time_limit
        [self.priced] = [scene for scene in plan.scenes if scene.name == plan.options.priced]
        self.truths: dict[str, Record] = {}
        self.found: dict[Case, Record] = {}
        self.prices: list[Record] = []

    def measure(self) -> None:
        """Run what the study asks for."""
        self._compile()
        self._find_truths()
        self._run_cases()
        self._find_prices()

    def _compile(self) -> None:
        """Compile each scene's kernels once, before several jobs wait for the same."""
        asked = {(case.scene.name, case.method): case for case in self.plan.cases if case.engine == "analytic"}
        jobs = [
            job_of(compile_kernel, (case.method, case.scene.digest), self.limit, case.method, case.scene)
            for case in asked.values()
            if refusal(case) is None
        ]
        self.runner.run("compiled kernels", jobs, lambda _, fault: fault_record(fault))

    def _find_truths(self) -> None:
        jobs: dict[str, Job] = {}
        for scene in self.plan.scenes:
            key = self._truth_key(scene)
            if self.runner.store.load_arrays(key) is None:
                self.runner.store.forget(key)
            arguments = (scene, truth_times(scene), self.runner.store, key)
            jobs[scene.name] = Job(key, measure_effect_truth, arguments, self.limit)
        values = self.runner.run("truth", list(jobs.values()), lambda _, fault: fault_record(fault))
        self.truths = {name: values[job.key] for name, job in jobs.items()}

    def _truth_key(self, scene: Scene) -> str:
        return key_of("effect truth", scene.digest, truth_times(scene).tobytes())

    def _run_cases(self) -> None:
        jobs: dict[Case, Job] = {}
        for case in self.plan.cases:
            if (reason := refusal(case)) is not None:
                self.found[case] = {"status": "refused", "reason": reason}
                continue
            content, key = (*case.content, version(case.engine)), self._truth_key(case.scene)
            jobs[case] = job_of(measure_effect, content, self.limit, case, key, self.runner.store)
        values = self.runner.run("cases", list(jobs.values()), lambda _, fault: fault_record(fault))
        self.found |= {case: values[job.key] for case, job in jobs.items()}

    def _find_prices(self) -> None:
        """Of each engine and method, in one job that measures all chains in turn."""
        jobs: dict[tuple[str, str], Job] = {}
        asked: dict[tuple[str, str], dict[str, Record]] = {}
        for name, method in dict.fromkeys((case.engine, case.method) for case in self.plan.cases):
            if engine(name).methods[method].adaptive:
                continue
            every = dict(self._priced_cases(name, method))
            reasons = {label: refusal(case) for label, case in every.items()}
            asked[name, method] = {label: {"status": "refused", "reason": reason} for label, reason in reasons.items()}
            cases = {label: case for label, case in every.items() if reasons[label] is None}
            if set(cases) <= {BARE, DEFAULTS}:  # nothing to measure the bare chain against
                cases = {}
            content = (*(case.content for case in cases.values()), version(name))
            if cases:
                jobs[name, method] = job_of(measure_prices, content, 4 * self.limit, cases, BARE)
        values = self.runner.run("prices", list(jobs.values()), lambda _, fault: fault_record(fault), alone=True)
        for (name, method), records in asked.items():
            where = {"scene": self.priced.name, "n": self.priced.n, "engine": name, "method": method}
            measured = values[jobs[name, method].key] if (name, method) in jobs else {}
            for label, record in records.items():
                found = record if record["reason"] else measured
                if found:
                    price = measured.get("prices", {}).get(label, _NO_PRICE)
                    how = {"status": found["status"], "reason": found["reason"]}
                    self.prices.append({**where, "effect": label, **price, **how})

    def _priced_cases(self, name: str, method: str) -> Iterator[tuple[str, Case]]:
        """The chain with each of its effects alone, with all, and bare."""
        step, effects = self.options.price_step, self.priced.effects
        only_gravity = Effects(gravity=effects.gravity)
        bare = replace(self.priced, effects=only_gravity)
        yield BARE, Case(bare, name, method, step)
        others = [effect for effect in self.priced.terms if effect != "gravity"]
        for effect in others:
            alone = replace(only_gravity, **{effect: getattr(effects, effect)})
            yield effect, Case(replace(self.priced, effects=alone), name, method, step)
        if len(others) > 1:
            yield ALL, Case(self.priced, name, method, step)
        if "default_flags" in engine(name).methods[method].settings:
            yield DEFAULTS, Case(bare, name, method, step, (("default_flags", 1),))

    def results(self) -> Results:
        """The tables."""
        return Results(
            name=self.plan.name,
            title=self.options.title,
            kind=self.options.kind,
            cases=pd.DataFrame([self._row(case) for case in self.plan.cases]),
            tables={
                "scenes": pd.DataFrame([self._scene_row(scene) for scene in self.plan.scenes]),
                "orders": pd.DataFrame(list(self._order_rows())),
                "prices": pd.DataFrame(self.prices),
                "mappings": pd.DataFrame(list(_mapping_rows(sorted({case.engine for case in self.plan.cases})))),
            },
            options=self.options.model_dump(mode="json", exclude={"quick"}),
            quick=self.plan.quick,
        )

    def _scene_row(self, scene: Scene) -> Record:
        truth = self.truths[scene.name]
        return {
            "scene": scene.name,
            "n": scene.n,
            "effects": ", ".join(scene.terms),
            "duration_s": scene.duration,
            "horizon_s": truth.get("horizon", math.nan),
            "reference_error": truth.get("error", math.nan),
            "moved_max_rad": truth.get("moved_max_rad", math.nan),
            "title": scene.title,
            "status": truth["status"],
            "reason": truth["reason"],
        }

    def _row(self, case: Case) -> Record:
        record, truth = self.found[case], self.truths[case.scene.name]
        row = {
            "scene": case.scene.name,
            "n": case.scene.n,
            "engine": case.engine,
            "method": case.method,
            "dt": case.dt,
            "settings": case.settings_text,
            "status": record["status"],
            "reason": record["reason"],
            "horizon_s": truth.get("horizon"),
            **{name: record.get(name) for name in _MEASURED},
            "energy_drift_max": None,
            "step_us": None,
            "run_s": None,
        }
        return {name: math.nan if value is None else value for name, value in row.items()}

    def _order_rows(self) -> Iterator[Record]:
        groups: dict[tuple[str, str, str], list[Case]] = {}
        for case in self.plan.cases:
            if case.dt is not None and self.found[case]["status"] == "ok":
                groups.setdefault((case.scene.name, case.engine, case.method), []).append(case)
        for (scene, name, method), cases in groups.items():
            steps = np.array([case.dt for case in cases], dtype=np.float64)
            errors = np.array([self.found[case].get("error_max") or math.nan for case in cases], dtype=np.float64)
            fit = observed_order(steps, errors, _FLOOR, _CEILING)
            yield {
                "scene": scene,
                "engine": name,
                "method": method,
                "order_claimed": _claimed(name, method, cases[0].scene),
                "order_observed": math.nan if fit is None else fit.order,
            }


def _claimed(name: str, method: str, scene: Scene) -> int:
    """The order that the method claims, or what the engine's means for one of the effects leave of it."""
    its = engine(name)
    mapped = mapped_effects(its)
    left = [mapped[effect].orders.get(method, math.inf) for effect in scene.terms if effect in mapped]
    return int(min([its.methods[method].order, *left]))


def _mapping_rows(engines: Sequence[str]) -> Iterator[Record]:
    from pendbench.effects import names

    for effect in names():
        for name in engines:
            mapped = mapped_effects(engine(name)).get(effect)
            yield {
                "effect": effect,
                "engine": name,
                "means": f"refused: {mapped.how}" if mapped and mapped.refused else mapped.how if mapped else "refused",
            }
