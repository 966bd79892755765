"""Results to report on: small, made up, and with everything in them that can go wrong.

The columns are those of the study of kind `chaos`; a test holds that.
"""

from __future__ import annotations

import math

import pandas as pd

from pendbench.study.results import Results

NAN = math.nan
HOSTILE = "=cmd|' /C calc'!A1 <script>alert(1)</script> `x` [a](http://b.c) | $y_1$ \\foo\nnew\trow \u202e\ud800"
#: A scene, an engine and a method with names that nobody should have.
SCENE, ENGINE, METHOD = "../a|b\n=1+1", "@evil|<b>", "-1+1`$\\frac$"

SCENES = {
    # name: n, Lyapunov exponent, chaotic, horizon
    "calm": (2, 0.01, False, 10.0),
    "wild": (3, 2.0, True, 8.0),
    SCENE: (2, 1.0, True, 10.0),
}
METHODS = {
    # engine, method: order, steps, how much faster than the error of rk4 the error grows
    ("ours", "adaptive"): (NAN, (NAN,), 1e-16),
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
_SILENT = ("refused", "timed out", "crashed")  # nothing comes back from these


def results(*, scenes=tuple(SCENES), engines=("ours", "other", ENGINE), quick=False, without=(), failing=False):
    """What a study found. without: names of tables to leave out. failing: every case failed."""
    cases = [
        case(scene, engine, method, dt, failing=failing)
        for scene in scenes
        for (engine, method), (_, steps, _) in METHODS.items()
        if engine in engines
        for dt in steps
    ]
    causes = [
        cause(scene, engine, method, failing=failing)
        for scene in scenes
        for engine, method in METHODS
        if engine in engines
    ]
    tables = {
        "scenes": pd.DataFrame([scene_row(name) for name in scenes]),
        "causes": pd.DataFrame(causes),
        "starts": pd.DataFrame([row for one in cases for row in start_rows(one)]),
        "curves": pd.DataFrame([row for one in cases for row in curve_rows(one)]),
    }
    return Results(
        name="made_up",
        title="Which one? " + HOSTILE,
        kind="chaos",
        cases=pd.DataFrame(cases),
        tables={name: frame for name, frame in tables.items() if name not in without},
        provenance={"pendbench": "0.1.0", "processor": HOSTILE, "nested": {"a": [1, 2], "b": NAN}, "seed": 7},
        options={"starts": 2, "perturbation": 0.01, "sample": 0.01, "order_time": 0.5, "lyapunov_time": 50.0},
        quick=quick,
    )


def scene_row(name):
    n, exponent, chaotic, horizon = SCENES[name]
    return {
        "scene": name,
        "n": n,
        "duration_s": 10.0,
        "starts": 3,
        "horizon_s": horizon,
        "horizon_min_s": horizon - 0.5,
        "horizon_max_s": horizon,
        "reference_error": 1e-20,
        "lyapunov_per_s": exponent,
        "lyapunov_error_per_s": 0.001,
        "growth_per_s": exponent,
        "chaotic": chaotic,
        "status": "ok",
        "reason": "",
    }


def _ending(scene, engine, method, dt, failing):
    if failing:
        return "error", "ValueError: it never works"
    return FAILURES.get((scene, engine, method, dt), ("ok", ""))


def _time(scene, engine, method, dt, threshold):
    """When e = size exp(rate t) passes the threshold, s, or nan where not before the horizon."""
    order, _, size = METHODS[engine, method]
    _, exponent, _, horizon = SCENES[scene]
    first = size * (1.0 if math.isnan(order) else dt**order)
    time = max(0.0, math.log(threshold / first) / exponent) if first < threshold else 0.0
    return time if time <= horizon else NAN


def case(scene, engine, method, dt, *, failing=False):
    n, exponent, chaotic, horizon = SCENES[scene]
    status, reason = _ending(scene, engine, method, dt, failing)
    silent = failing or status in _SILENT
    row = {"scene": scene, "n": n, "engine": engine, "method": method, "dt": dt, "settings": ""}
    row |= {"status": status, "reason": reason, "horizon_s": horizon, "reference_error": 1e-20}
    size = 1e-15 if math.isnan(dt) else dt ** METHODS[engine, method][0]
    errors = {"error_max": 10 * size, "error_half": size, "angle_error_max_rad": size, "reference_error_half": 1e-25}
    row |= {name: NAN if silent else value for name, value in errors.items()}
    row["starts"] = 0 if silent else 3
    for name in ("1e-3", "1e-2", "1e-1"):
        time = NAN if silent else _time(scene, engine, method, dt, float(name))
        missed = 0 if silent else 3 if math.isnan(time) else 0
        row[f"t_{name}_s"] = time
        row[f"t_{name}_min_s"] = time * 0.9
        row[f"t_{name}_max_s"] = time * 1.1
        row[f"t_{name}_lyapunov"] = time * exponent if chaotic else NAN
        row[f"t_{name}_not_reached"] = missed
        row[f"t_{name}_band_s"] = NAN if math.isnan(time) else 0.01
    for name in ("max", "final", "band", "slope_per_s", "half"):
        infinite = status == "not finite" and name == "max"
        row[f"energy_drift_{name}"] = NAN if silent else math.inf if infinite else -size if name == "final" else size
    row["gap_max"] = NAN if silent else 0.0
    row |= {name: cause(scene, engine, method)[name] for name in ("model_error", "order_claimed", "order_observed")}
    row["plateau"] = NAN
    row["growth_per_s"] = NAN if silent else exponent
    row["cause"] = "integration"
    speed = NAN if silent else 1e5 * (1e-3 if math.isnan(dt) else dt)
    row |= {"step_us": 10.0, "step_spread": 0.02, "simulated_s_per_s": speed, "build_s": 1e-3, "first_call_s": 2e-3}
    row |= {"run_s": horizon / speed, "flags": ""}
    if silent:
        row |= dict.fromkeys(("step_us", "step_spread", "build_s", "first_call_s", "run_s"), NAN)
    elif (engine, method, dt) == ("other", "rk4", 1e-3):
        row |= {"step_spread": 0.5, "flags": "noisy timing: spread 50%"}
    return row


def cause(scene, engine, method, *, failing=False):
    n, exponent, chaotic, _ = SCENES[scene]
    order, steps, _ = METHODS[engine, method]
    adaptive = math.isnan(order)
    other = engine == ENGINE
    return {
        "scene": scene,
        "n": n,
        "engine": engine,
        "method": method,
        "settings": "",
        "model_error": NAN if failing else 2e-3 if other else 1e-12,
        "model_error_limit": NAN if failing else 1e-13,
        "order_claimed": order,
        "order_observed": NAN if failing or adaptive else order - 0.01,
        "order_dt_coarse": NAN if failing or adaptive else steps[0],
        "order_dt_fine": NAN if failing or adaptive else steps[-1],
        "plateau": NAN,
        "growth_per_s": NAN if failing else exponent,
        "neighbours_growth_per_s": exponent,
        "lyapunov_per_s": exponent if chaotic else NAN,
        "cause": "model" if other and not failing else "integration",
    }


def start_rows(row):
    """The starts of a case of which something came back."""
    for start in range(3 if row["starts"] else 0):
        names = ("scene", "engine", "method", "dt", "settings", "status", "reason", "horizon_s", "error_max")
        times = {f"t_{name}_s": row[f"t_{name}_s"] for name in ("1e-3", "1e-2", "1e-1")}
        own = {name: row[name] for name in names}
        yield {**own, "start": start, "energy_drift_max": row["energy_drift_max"], **times}


def curve_rows(row):
    """Fifty samples of a case, fewer where it ended early."""
    if not row["starts"]:
        return
    _, exponent, _, horizon = SCENES[row["scene"]]
    end = 10.0 if row["status"] == "ok" else 4.0
    for i in range(50):
        t = end * i / 49
        error = min(1.5, row["error_half"] * math.exp(exponent * t)) if i else 0.0
        energy = row["energy_drift_half"] * math.sin(t) * (1e300 if row["status"] == "not finite" and t > 3 else 1.0)
        yield {
            **{name: row[name] for name in ("scene", "engine", "method", "dt", "settings")},
            "t_s": t,
            "error": error if t <= horizon else None,
            "energy_error": energy,
        }
