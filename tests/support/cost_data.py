"""Results of a study of kind `cost` to report on: small, made up, and with everything in them that can go wrong.

Every method is a power law: e = size h^order, and so many microseconds for a step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from pendbench.engines import registry
from pendbench.engines.protocol import Method, Setting
from pendbench.kinds.cost.study import Found, Window
from pendbench.kinds.cost.work import ErrorRun, LongRun
from pendbench.scene.scene import Scene
from pendbench.study.case import Case
from pendbench.study.results import Results
from pendbench.study.timing import UNTIMED, Timed
from pendbench.study.truths import KeptTruth
from support.controls import Engine
from support.report_data import ENGINE, HOSTILE, METHOD, NAN, SCENE
from support.scenes import chain

ACCURACIES = (1e-2, 1e-3, 1e-4, 1e-8)
#: Name: n, time of comparison, s.
SCENES = {"calm": (2, 2.0), "a01": (1, 2000.0), SCENE: (3, 1.0)}
METHODS = {
    # engine, method, settings: order, size, us for a step, steps (or tolerances, whose root is the mean step)
    ("ours", "adaptive", ()): (NAN, 1.0, 2.0, (1e-4, 1e-6, 1e-8)),
    ("ours", "rk4", ()): (4, 1e4, 1.0, (2e-2, 1e-2, 1e-3)),
    ("other", "rk4", ()): (4, 1e4, 10.0, (2e-2, 1e-2, 1e-3)),
    ("other", "euler", (("iterations", 10),)): (1, 1.0, 5.0, (1e-2, 2e-3, 1e-3)),
    (ENGINE, METHOD, ()): (2, 1e4, 4.0, (1e-2, 1e-3)),
}
FAILURES = {
    # scene, engine, method, step: status, reason
    ("calm", "other", "rk4", 2e-2): ("not finite", "an angle is infinite"),
    ("calm", ENGINE, METHOD, 1e-2): ("refused", HOSTILE),
    ("calm", ENGINE, METHOD, 1e-3): ("refused", HOSTILE),
    (SCENE, "other", "euler", 1e-2): ("timed out", "took longer than 120 s"),
    (SCENE, ENGINE, METHOD, 1e-3): ("torn", "a rod is | off its length"),
}
#: Seconds that a caller who reads every state pays for each.
READING_US = 10.0
_TOLERANCE = MappingProxyType({"tolerance": Setting(1e-8, 1e-15, 1.0)})
_ITERATIONS = MappingProxyType({"iterations": Setting(10, 1, 1000, integer=True)})


def _engine(its_name: str) -> type[Engine]:
    """An engine that claims what its methods are."""

    class MadeUp(Engine):
        name = its_name
        methods = MappingProxyType({
            method: Method(order=8, adaptive=True, settings=_TOLERANCE) if math.isnan(order)
            else Method(order=order, settings=_ITERATIONS)
            for (engine, method, _), (order, *_) in METHODS.items() if engine == its_name
        })  # fmt: skip

    return MadeUp


@contextmanager
def made_up_engines() -> Iterator[None]:
    """The engines of the results are known, for as long as this lasts."""
    with pytest.MonkeyPatch.context() as patch:
        for name in {engine for engine, *_ in METHODS}:
            patch.setitem(registry._registered, name, _engine(name))
        yield


def results(
    *, scenes=tuple(SCENES), engines=("ours", "other", ENGINE), methods=None, quick=False, failing=False, dear=1.0
) -> Results[Found]:
    """What a study found. failing: every case failed. dear: by what factor ours costs more in the calm scene."""
    keys = [key for key in METHODS if key[0] in engines and (methods is None or key[1] in methods)]
    made = {name: _scene(name) for name in scenes}
    cases = [_case(made[name], *key, step) for name in scenes for key in keys for step in METHODS[key][3]]
    long_cases = [Case(made["calm"], key[0], key[1], 1e-3) for key in keys if key[1] != "adaptive" and "calm" in scenes]
    runs = {case: _run(case, failing=failing) for case in cases}
    found = Found(
        tuple(made.values()),
        {name: Window(time=SCENES[name][1], samples=50) for name in scenes},
        ACCURACIES,
        {name: _truth(name, failing=failing) for name in scenes},
        runs,
        {case: _timing(case, dear) if run.status == "ok" else UNTIMED for case, run in runs.items()},
        {case: _long_run(case, failing=failing) for case in long_cases},
    )
    title = "What does it cost? " + HOSTILE
    return Results("made_up", title, "cost", found, None, {"pendbench": "0.1.0", "processor": HOSTILE}, quick)


def with_runs(of: Results[Found], change: Any, chosen: Any) -> Results[Found]:
    """The results with changes to the runs of some cases. chosen: of a case."""
    runs = {case: replace(run, **change) if chosen(case) else run for case, run in of.found.runs.items()}
    return replace(of, found=replace(of.found, runs=runs))


def with_timings(of: Results[Found], **change: Any) -> Results[Found]:
    """The results with changes to all timings."""
    timings = {case: replace(timing, **change) for case, timing in of.found.timings.items()}
    return replace(of, found=replace(of.found, timings=timings))


def _scene(name: str) -> Scene:
    n, seconds = SCENES[name]
    return chain(n, duration=seconds, name=name)


def _truth(name: str, *, failing: bool) -> KeptTruth:
    if failing:
        return KeptTruth("timed out", "too slow")
    seconds = SCENES[name][1]
    return KeptTruth("ok", "", seconds, 1e-25, np.array([0.0, seconds]), theta=np.array([[1.0], [0.5]]))


def _case(scene: Scene, engine: str, method: str, settings: tuple[tuple[str, float], ...], step: float) -> Case:
    if math.isnan(METHODS[engine, method, settings][0]):
        return Case(scene, engine, method, None, (("tolerance", step),))
    return Case(scene, engine, method, step, settings)


def _law(case: Case) -> tuple[float, float, int]:
    """Error, us for a step, and steps."""
    [(order, size, cost, _)] = [law for key, law in METHODS.items() if key[:2] == (case.engine, case.method)]
    step = dict(case.settings)["tolerance"] if case.dt is None else case.dt
    seconds = SCENES[case.scene.name][1]
    if case.dt is None:
        return step, cost, round(seconds / step**0.25)
    return min(2.0, size * step**order), cost, round(seconds / step)


def _run(case: Case, *, failing: bool) -> ErrorRun:
    if failing:
        return ErrorRun("error", "ValueError: it never works")
    step = dict(case.settings)["tolerance"] if case.dt is None else case.dt
    if fault := FAILURES.get((case.scene.name, case.engine, case.method, step)):
        return ErrorRun(*fault)
    error, _, steps = _law(case)
    return ErrorRun("ok", "", steps, error, error, 1e-25, error, 0.0)


def _timing(case: Case, dear: float) -> Timed:
    _, cost, steps = _law(case)
    if (case.scene.name, case.engine) == ("calm", "ours"):
        cost *= dear
    spread = 0.5 if (case.scene.name, case.method, case.dt) == ("calm", "euler", 1e-3) else 0.02
    seconds, run_s = SCENES[case.scene.name][1], cost * steps / 1e6
    return Timed("ok", "", cost, spread, seconds / run_s, 1e-3, 2e-3, run_s, cost + READING_US)


def _long_run(case: Case, *, failing: bool) -> LongRun:
    """A long run: rk4 drifts, euler keeps its band, the others fail."""
    if failing or case.engine == ENGINE:
        return LongRun("crashed", HOSTILE)
    slope = -1e-9 if case.method == "rk4" else 1e-14
    t = np.linspace(0.0, 1000.0, 50)
    energy = slope * t + 1e-7 * np.sin(t)
    band = (1e-7, 1e-7) if case.method == "rk4" else (9e-7, 1e-6)
    return LongRun("ok", "", 1_000_000, 1e-6, 1e-6, slope, abs(slope) * 1e9, *band, t, energy)
