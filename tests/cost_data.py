"""Results of a study of kind `cost` to report on: small, made up, and with everything in them that can go wrong.

The columns are those of the study; a test holds that. Every method is a power law: e = size h^order, and so many
microseconds for a step.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from pendbench.study.measure import price_of, price_of_digit
from pendbench.study.results import Results
from report_data import ENGINE, HOSTILE, METHOD, NAN, SCENE

ACCURACIES = (1e-2, 1e-3, 1e-4, 1e-8)
#: Name: n, time of comparison, s.
SCENES = {"calm": (2, 2.0), "a01": (1, 2000.0), SCENE: (3, 1.0)}
METHODS = {
    # engine, method, settings: order, size, us for a step, steps (or tolerances, whose root is the mean step)
    ("ours", "adaptive", ""): (NAN, 1.0, 2.0, (1e-4, 1e-6, 1e-8)),
    ("ours", "rk4", ""): (4, 1e4, 1.0, (2e-2, 1e-2, 1e-3)),
    ("other", "rk4", ""): (4, 1e4, 10.0, (2e-2, 1e-2, 1e-3)),
    ("other", "euler", "iterations=10"): (1, 1.0, 5.0, (1e-2, 1e-3)),
    (ENGINE, METHOD, ""): (2, 1e4, 4.0, (1e-2, 1e-3)),
}
FAILURES = {
    # scene, engine, method, step: status, reason
    ("calm", "other", "rk4", 2e-2): ("not finite", "an angle is infinite"),
    ("calm", ENGINE, METHOD, 1e-2): ("refused", HOSTILE),
    ("calm", ENGINE, METHOD, 1e-3): ("refused", HOSTILE),
    (SCENE, "other", "euler", 1e-2): ("timed out", "took longer than 120 s"),
    (SCENE, ENGINE, METHOD, 1e-3): ("torn", "a rod is | off its length"),
}


def results(
    *, scenes=tuple(SCENES), engines=("ours", "other", ENGINE), methods=None, quick=False, without=(), failing=False
):
    """What a study found. without: names of tables to leave out. failing: every case failed."""
    keys = [key for key in METHODS if key[0] in engines and (methods is None or key[1] in methods)]
    groups = [
        [case(scene, *key, step, failing=failing) for step in METHODS[key][3]] for scene in scenes for key in keys
    ]
    cases = [row for rows in groups for row in rows]
    long_runs = [long_run("calm", *key, failing=failing) for key in keys if key[1] != "adaptive" and "calm" in scenes]
    tables = {
        "scenes": [scene_row(name, failing=failing) for name in scenes],
        "orders": [order(rows) for rows in groups],
        "prices": [price(rows, accuracy) for rows in groups for accuracy in ACCURACIES],
        "long_runs": long_runs,
        "curves": [row for run in long_runs for row in curve_rows(run)],
    }
    return Results(
        name="made_up",
        title="What does it cost? " + HOSTILE,
        kind="cost",
        cases=pd.DataFrame(cases),
        tables={name: pd.DataFrame(rows) for name, rows in tables.items() if name not in without},
        provenance={"pendbench": "0.1.0", "processor": HOSTILE},
        options={"accuracies": list(ACCURACIES), "long_runs": {"scenes": ["calm"], "steps": 1000000, "dt": 1e-3}},
        quick=quick,
    )


def scene_row(name, *, failing=False):
    n, seconds = SCENES[name]
    ending = ("timed out", "too slow") if failing else ("ok", "")
    row = {"scene": name, "n": n, "compare_s": seconds, "samples": 50, "horizon_s": seconds, "reference_error": 1e-25}
    row |= dict(zip(("status", "reason"), ending, strict=True))
    return {**row, "horizon_s": NAN, "reference_error": NAN} if failing else row


def case(scene, engine, method, settings, step, *, failing=False):
    """One case. step: s, or the tolerance of the method that chooses its steps."""
    n, seconds = SCENES[scene]
    order_, size, cost, _ = METHODS[engine, method, settings]
    adaptive = math.isnan(order_)
    status, reason = FAILURES.get((scene, engine, method, step), ("ok", ""))
    if failing:
        status, reason = "error", "ValueError: it never works"
    ok = status == "ok"
    mean = step**0.25 if adaptive else step
    taken = round(seconds / mean)
    error = step if adaptive else min(2.0, size * step**order_)
    row = {
        "scene": scene,
        "n": n,
        "engine": engine,
        "method": method,
        "dt": NAN if adaptive else step,
        "tolerance": step if adaptive else NAN,
        "settings": f"tolerance={step:g}" if adaptive else settings,
        "status": status,
        "reason": reason,
        "horizon_s": NAN if failing else seconds,
        "compare_s": seconds,
        "order_claimed": order_,
        "order_observed": NAN if failing or adaptive else order_ - 0.01,
        "plateau": NAN,
        "flags": "",
    }
    numbers = {"error_max": error, "angle_error_max_rad": error, "reference_error": 1e-25, "energy_drift_max": error,
               "gap_max": 0.0, "steps": taken}  # fmt: skip
    timing = {"step_us": cost, "step_spread": 0.02, "step_and_state_us": cost + 10.0, "run_s": 1e-6 * cost * taken,
              "simulated_s_per_s": 1e6 * seconds / (cost * taken), "build_s": 1e-3, "first_call_s": 2e-3}  # fmt: skip
    row |= {name: value if ok else NAN for name, value in {**numbers, **timing}.items()}
    if ok and (scene, engine, method, step) == ("calm", "other", "euler", 1e-3):
        row |= {"step_spread": 0.5, "flags": "plateau: the error stops at 1.0e-03; noisy timing: spread 50%"}
    return row


def _points(rows):
    step = [row["tolerance"] if math.isnan(row["dt"]) else row["dt"] for row in rows]
    columns = [step, *([row[name] for row in rows] for name in ("error_max", "run_s"))]
    points = np.array(columns, dtype=float)
    return points[:, np.isfinite(points[2])]


def order(rows):
    step, error, run_s = _points(rows)
    first = rows[0]
    shown = len(step) > 1 and not math.isnan(first["dt"])
    names = ("scene", "n", "engine", "method", "order_claimed", "plateau")
    return {
        **{name: first[name] for name in names},
        "order_observed": first["order_observed"] if shown else NAN,
        "settings": "" if first["settings"].startswith("tolerance") else first["settings"],
        "order_dt_coarse": step[-2] if shown else NAN,
        "order_dt_fine": step[-1] if shown else NAN,
        "digit_price": price_of_digit(error, run_s, 1e-12, 0.03),
        "best_error": error.min() if len(error) else NAN,
    }


def price(rows, accuracy):
    step, error, run_s = _points(rows)
    found, first = price_of(accuracy, step, error, run_s), rows[0]
    adaptive = math.isnan(first["dt"])
    return {
        **{name: first[name] for name in ("scene", "engine", "method")},
        "accuracy": accuracy,
        "settings": "" if adaptive else first["settings"],
        "dt": NAN if adaptive else found.step,
        "tolerance": found.step if adaptive else NAN,
        "run_s": found.run_s,
        "with_states_s": 3 * found.run_s,
        "bound": found.bound,
        "best_error": found.best,
    }


def long_run(scene, engine, method, _settings, *, failing=False):
    """A long run: rk4 drifts, euler keeps its band, the others fail."""
    n, _ = SCENES[scene]
    failed = failing or engine == ENGINE
    drifts = method == "rk4"
    numbers = {
        "steps": 1000000,
        "energy_drift_max": 1e-6,
        "energy_drift_band": 1e-6,
        "energy_drift_slope_per_s": -1e-9 if drifts else 1e-14,
        "energy_slope_share": 1.0 if drifts else 1e-5,
        "energy_band_first_tenth": 1e-7 if drifts else 9e-7,
        "energy_band_last_tenth": 1e-7 if drifts else 1e-6,
    }
    row = {"scene": scene, "n": n, "engine": engine, "method": method, "dt": 1e-3}
    row |= {"status": "crashed" if failed else "ok", "reason": HOSTILE if failed else ""}
    return row | {name: NAN if failed else value for name, value in numbers.items()}


def curve_rows(run):
    for i in range(50 if run["status"] == "ok" else 0):
        t = 1000.0 * i / 49
        energy = run["energy_drift_slope_per_s"] * t + 1e-7 * math.sin(t)
        names = ("scene", "engine", "method", "dt")
        yield {**{name: run[name] for name in names}, "settings": "", "t_s": t, "error": None, "energy_error": energy}
