"""Results of a study of kind `chaos` to report on: small, made up, and with everything in them that can go wrong.

Every error is e = size exp(rate t), and every start but the first leaves the truth a tenth earlier or later.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np

from pendbench.base.faults import Fault
from pendbench.kinds.chaos.study import Found
from pendbench.kinds.chaos.work import THRESHOLDS, ChaosRun, Curves, KeptExponent, Neighbour
from pendbench.measures.divergence import Crossing
from pendbench.measures.drift import Drift
from pendbench.report.page import Report
from pendbench.scene.scene import Effects, Scene
from pendbench.study.case import Case
from pendbench.study.models import Model
from pendbench.study.results import Results
from pendbench.study.timing import UNTIMED, Timed
from pendbench.study.truths import KeptTruth

NAN = math.nan
HOSTILE = "=cmd|' /C calc'!A1 <script>alert(1)</script> `x` [a](http://b.c) | $y_1$ \\foo\nnew\trow \u202e\ud800"
#: A scene, an engine and a method with names that nobody should have.
SCENE, ENGINE, METHOD = "../a|b\n=1+1", "@evil|<b>", "-1+1`$\\frac$"

DURATION = 10.0
SCENES = {
    # name: n, Lyapunov exponent, chaotic, horizon
    "calm": (2, 0.01, False, 10.0),
    "wild": (3, 2.0, True, 8.0),
    SCENE: (2, 1.0, True, 10.0),
}
METHODS = {
    # engine, method: order, steps, the error's size at a step of 1
    ("ours", "adaptive"): (None, (None,), 1e-16),
    ("ours", "rk4"): (4, (1e-2, 1e-3), 1e2),
    ("other", "rk4"): (4, (1e-2, 1e-3), 1e2),
    ("other", "euler"): (1, (1e-2, 1e-3), 1.0),
    (ENGINE, METHOD): (2, (1e-2, 1e-3), 10.0),
}
FAILURES = {
    # scene, engine, method, step: status, reason
    ("wild", "other", "euler", 1e-2): ("not finite", "an angle is infinite"),
    ("wild", "other", "euler", 1e-3): ("timed out", "took longer than 120 s"),
    ("calm", ENGINE, METHOD, 1e-2): ("refused", HOSTILE),
    ("wild", ENGINE, METHOD, 1e-2): ("torn", "a rod is | off its length"),
    ("wild", ENGINE, METHOD, 1e-3): ("crashed", "the process died with exit code -11"),
}
#: How much earlier or later each start leaves the truth.
STARTS = (1.0, 0.9, 1.1)
_SILENT = ("refused", "timed out", "crashed")  # nothing comes back from these


def scene_of(name: str) -> Scene:
    """A chain that is released from 1 rad."""
    n = SCENES[name][0]
    return Scene(name, name, DURATION, np.ones(n), np.ones(n), np.ones(n), np.zeros(n), Effects(gravity=9.81))


@cache
def found(*, scenes=tuple(SCENES), engines=("ours", "other", ENGINE), failing=False) -> Found:
    """What a study found. failing: every case failed."""
    chains = {name: scene_of(name) for name in scenes}
    cases = [Case(chain, *pair, dt) for chain in chains.values() for pair, (_, steps, _) in METHODS.items()
             if pair[0] in engines for dt in steps]  # fmt: skip
    methods = {replace(case, dt=None): case for case in cases}
    ran = [case for case in cases if ending(case, failing)[0] != "refused"]
    return Found(
        cases=tuple(cases),
        scenes=tuple(chains.values()),
        truths={name: [truth_of(chain, at) for at in range(len(STARTS))] for name, chain in chains.items()},
        exponents={name: KeptExponent("ok", "", SCENES[name][1], 0.001, SCENES[name][2]) for name in scenes},
        neighbours={name: Neighbour("ok", "", SCENES[name][1]) for name in scenes},
        refusals={case: Fault(*ending(case, failing)) for case in cases if case not in ran},
        runs={case: [run(case, at, failing) for at in range(len(STARTS))] for case in ran},
        models={its: model(its, failing) for its in methods},
        orders={its: METHODS[its.engine, its.method][0] for its in methods},
        timings={case: timing(case, failing) for case in ran},
    )


def results(*, quick=False, **chosen) -> Results[Found]:
    """A study with `found(**chosen)`."""
    return Results(
        name="made_up",
        title="Which one? " + HOSTILE,
        kind="chaos",
        found=found(**chosen),
        options=SimpleNamespace(starts=2, perturbation=0.01, sample=0.01, order_time=0.5, lyapunov_time=50.0),
        provenance={"pendbench": "0.1.0", "processor": HOSTILE, "nested": {"a": [1, 2], "b": NAN}, "seed": 7},
        quick=quick,
    )


def report(**chosen) -> Report:
    """What people read of it."""
    return Report(results(**chosen))


def changed(**fields) -> Report:
    """The report of the results with some fields of `Found` replaced."""
    made = results()
    return Report(replace(made, found=replace(made.found, **fields)))


def truth_of(scene: Scene, start: int) -> KeptTruth:
    """A truth of which little but the horizon is used; the second start's is half a second shorter."""
    t = np.array([0.0, SCENES[scene.name][3] - (0.5 if start == 1 else 0.0)])
    theta = np.array([scene.angles, scene.angles + 1.0])
    return KeptTruth("ok", "", float(t[-1]), 1e-20, t, theta, 0.0 * theta, 0.0 * theta, np.zeros(2))


def ending(case: Case, failing: bool = False) -> tuple[str, str]:
    """How a case ended, and why."""
    if failing:
        return "error", "ValueError: it never works"
    return FAILURES.get((case.scene.name, case.engine, case.method, case.dt), ("ok", ""))


def size_of(case: Case) -> float:
    """The error at the start."""
    order, _, size = METHODS[case.engine, case.method]
    return size if order is None else size * case.dt**order


def time_to(case: Case, threshold: float) -> float:
    """When e = size exp(rate t) passes the threshold, s, or nan where not before the horizon."""
    _, exponent, _, horizon = SCENES[case.scene.name]
    time = max(0.0, math.log(threshold / size_of(case)) / exponent)
    return time if time <= horizon else NAN


def run(case: Case, start: int, failing: bool = False) -> ChaosRun:
    """What came back of a case from one start."""
    status, reason = ending(case, failing)
    if failing or status in _SILENT:
        return ChaosRun(status, reason)
    order, size = METHODS[case.engine, case.method][0], size_of(case)
    half = 1e-15 if order is None else case.dt**order
    largest = math.inf if status == "not finite" else half
    return ChaosRun(
        status,
        reason,
        steps=1000,
        error_max=10 * half,
        error_half=half,
        known_half=1e-25,
        angle_error_max=half,
        crossings=tuple(_crossing(STARTS[start] * time_to(case, threshold)) for threshold in THRESHOLDS),
        growth=SCENES[case.scene.name][1],
        order_error=size if order is None else case.dt ** (order - 0.01),
        energy=Drift(largest, -half, half, half),
        energy_half=half,
        gap_max=0.0,
        curves=curves(case, half, status) if start == 0 else Curves(),
    )


def _crossing(time: float) -> Crossing | None:
    return None if math.isnan(time) else Crossing(time, time - 0.005, time + 0.005)


def curves(case: Case, size: float, status: str) -> Curves:
    """Fifty samples of a case, until 4 s where it ended early."""
    _, exponent, _, horizon = SCENES[case.scene.name]
    t = np.linspace(0.0, DURATION if status == "ok" else 4.0, 50)
    error = np.minimum(1.5, size * np.exp(exponent * t))
    error[0] = 0.0
    blown = np.where((t > 3) & (status == "not finite"), 1e300, 1.0)
    return Curves(t, np.where(t <= horizon, error, np.nan), size * np.sin(t) * blown)


def model(its: Case, failing: bool = False) -> Model:
    """The third engine simulates another system."""
    if failing:
        return Model("error", "ValueError: it never works")
    return Model("ok", "", 2e-3 if its.engine == ENGINE else 1e-12, 1e-13)


def timing(case: Case, failing: bool = False) -> Timed:
    """10 us a step, and one noisy case."""
    if failing or ending(case)[0] in _SILENT:
        return UNTIMED
    speed = 1e5 * (case.dt or 1e-3)
    spread = 0.5 if (case.engine, case.method, case.dt) == ("other", "rk4", 1e-3) else 0.02
    return Timed("ok", "", 10.0, spread, speed, 1e-3, 2e-3, SCENES[case.scene.name][3] / speed)
