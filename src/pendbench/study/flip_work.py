"""The jobs of studies of kind `ensemble`. Each leaves its arrays in the store and returns a record of JSON's types."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.ensemble import first_flips
from pendbench.physics.energy import energy, energy_scale
from pendbench.recording import simulate
from pendbench.scene import Scene
from pendbench.study.case import Case
from pendbench.study.clock import timed
from pendbench.study.exponents import energy_shares, largest_exponents, starts_between
from pendbench.study.flips import first_flip
from pendbench.study.jobs import Job
from pendbench.study.store import Store, key_of

Record = dict[str, Any]

#: The times at which an engine is asked for its state lie about so far apart, s.
_SAMPLE_S: Final = 0.02


def arrays_job(
    function: Callable[..., Record], content: tuple[object, ...], store: Store, time_limit: float, *arguments: Any
) -> Job:
    """A job that leaves its arrays under its key: run again where they are not there."""
    key = key_of(function.__name__, *content)
    if store.load_arrays(key) is None:
        store.forget(key)
    return Job(key, function, (*arguments, store, key), time_limit)


def compile_flips(scene: Scene) -> Record:
    """Compile what follows many chains at once, or load it where that was done before."""
    first_flips(replace(scene, duration=1e-6), np.zeros((1, scene.n)), threads=1)
    return {}


def measure_flips(scene: Scene, angles: FloatArray, tolerance: float, store: Store, key: str) -> Record:
    """When chains released from angles (k, n) rad first go over the top, on one thread: the jobs share the work."""
    compile_flips(scene)  # not timed
    flips, seconds = timed(lambda: first_flips(scene, angles, tolerance=tolerance, threads=1))
    store.save_arrays(key, {"flips": flips})
    return {"status": "ok", "reason": "", "run_s": seconds}


def measure_engine_flips(case: Case, angles: FloatArray, store: Store, key: str) -> Record:
    """The same from an engine, one chain after the other. Where a run fails before it flips, nothing is known."""
    times = _sample_times(case)
    flips = np.full(len(angles), np.nan)
    worst, status, reason, spent = 0.0, "ok", "", 0.0
    for number, start in enumerate(angles):
        scene = case.scene.with_start(start, np.zeros(len(start)))
        settings = dict(case.settings)
        run, seconds = timed(partial(simulate, scene, case.engine, case.method, case.dt, times, **settings))
        spent += seconds
        found = first_flip(run.t, run.theta, run.omega)
        if run.status != "ok":
            status, reason = run.status, f"released from {start[0]:.4g}, {start[1]:.4g} rad: {run.reason}"
        if run.status == "ok" or math.isfinite(found):
            flips[number] = found
        worst = max(worst, _energy_drift(scene, run.theta, run.omega))
    store.save_arrays(key, {"flips": flips})
    return {"status": status, "reason": reason, "run_s": spent, "energy_drift_max": worst}


def _sample_times(case: Case) -> FloatArray:
    """From 0 to the scene's duration, on whole steps of the case."""
    if case.dt is None:
        return np.linspace(0.0, case.scene.duration, math.ceil(case.scene.duration / _SAMPLE_S) + 1)
    total = math.floor(case.scene.duration / case.dt + 1e-6)
    counts = np.arange(0, total + 1, max(1, round(_SAMPLE_S / case.dt)))
    return np.unique(np.append(counts, total)) * case.dt


def _energy_drift(scene: Scene, theta: FloatArray, omega: FloatArray) -> float:
    scale = energy_scale(scene)
    if not len(theta) or not scale:
        return 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        values = energy(scene, theta, omega)
        worst = np.abs((values - values[0]) / scale).max()
    return float(worst) if np.isfinite(worst) else math.inf


def measure_exponents(
    scene: Scene, low: float, high: float, count: int, seconds: float, seed: int, store: Store, key: str
) -> Record:
    """Starts at rest with energy shares between `low` and `high`, and their largest Lyapunov exponents."""
    angles = starts_between(scene, low, high, count, seed)
    rates = largest_exponents(scene, angles, seconds)
    store.save_arrays(key, {"angles": angles, "shares": energy_shares(scene, angles), "exponents": rates})
    return {"status": "ok", "reason": ""}
