"""What the study `ensemble` runs in worker processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray, no_numbers
from pendbench.engines.analytic.ensemble import first_flips
from pendbench.engines.arguments import whole_steps
from pendbench.engines.recording import simulate
from pendbench.measures.clock import timed
from pendbench.measures.energy import energy_balance
from pendbench.measures.exponents import energy_shares, largest_exponents, starts_between
from pendbench.measures.flips import first_flip
from pendbench.physics.acting import is_plain
from pendbench.scene.scene import Scene
from pendbench.study.case import Case
from pendbench.study.kernels import Compiled
from pendbench.study.runs import run_case

#: The times at which an engine is asked for its state lie about so far apart, s.
_SAMPLE_S: Final = 0.02


def _no_starts() -> FloatArray:
    return np.zeros((0, 2))


@dataclass(frozen=True, eq=False)
class FlipRun:
    """When chains first go over the top: flips (k,) s, inf for never and nan for not known; run_s: processor time."""

    status: str
    reason: str = ""
    flips: FloatArray = field(default_factory=no_numbers)
    run_s: float = math.nan
    energy_drift_max: float = math.nan
    energy_floor: float = math.nan


@dataclass(frozen=True, eq=False)
class ExponentRun:
    """Starts at rest: angles (k, 2) rad, energy shares (k,), largest Lyapunov exponents (k,) 1/s."""

    status: str
    reason: str = ""
    angles: FloatArray = field(default_factory=_no_starts)
    shares: FloatArray = field(default_factory=no_numbers)
    exponents: FloatArray = field(default_factory=no_numbers)


def compile_flips(scene: Scene) -> Compiled:
    """Compile what follows chains, or load it where that was done before."""
    moment = replace(scene, duration=1e-6)
    if is_plain(scene):
        first_flips(moment, np.zeros((1, scene.n)), threads=1)
    else:
        simulate(moment)
    return Compiled("ok")


def measure_flips(scene: Scene, angles: FloatArray, tolerance: float) -> FlipRun:
    """When chains released from angles (k, n) rad first go over the top, on one thread: the tasks share the work.

    Where more than gravity acts, which many chains at once do not know, one after the other, as other engines run.
    """
    compile_flips(scene)  # not timed
    if not is_plain(scene):
        return measure_engine_flips(Case(scene, "analytic", "adaptive", None, (("tolerance", tolerance),)), angles)
    flips, seconds = timed(lambda: first_flips(scene, angles, tolerance=tolerance, threads=1))
    return FlipRun("ok", "", flips, seconds)


def measure_engine_flips(case: Case, angles: FloatArray) -> FlipRun:
    """The same from an engine, one chain after the other. Where a run fails before it flips, nothing is known."""
    times = _sample_times(case)
    flips = np.full(len(angles), np.nan)
    worst, known, status, reason, spent = 0.0, [math.nan], "ok", "", 0.0
    for number, start in enumerate(angles):
        scene = case.scene.with_start(start, np.zeros(len(start)))
        run, seconds = timed(partial(run_case, case, times, scene))
        spent += seconds
        found = first_flip(run.t, run.theta, run.omega)
        if run.status != "ok":
            status, reason = run.status, f"released from {start[0]:.4g}, {start[1]:.4g} rad: {run.reason}"
        if run.status == "ok" or math.isfinite(found):
            flips[number] = found
        balance = energy_balance(scene, run)
        astray = np.abs(balance.error).max(initial=0.0)
        worst = max(worst, float(astray) if math.isfinite(astray) else math.inf)
        known.append(balance.known_to)
    return FlipRun(status, reason, flips, spent, worst, float(np.fmax.reduce(known)))


def _sample_times(case: Case) -> FloatArray:
    """From 0 to the scene's duration, on whole steps of the case."""
    if case.dt is None:
        return np.linspace(0.0, case.scene.duration, math.ceil(case.scene.duration / _SAMPLE_S) + 1)
    total = whole_steps(case.scene.duration, case.dt)
    counts = np.arange(0, total + 1, max(1, round(_SAMPLE_S / case.dt)))
    return np.unique(np.append(counts, total)) * case.dt


def measure_exponents(scene: Scene, low: float, high: float, count: int, seconds: float, seed: int) -> ExponentRun:
    """Starts at rest with energy shares between `low` and `high`, and their exponents over `seconds`."""
    angles = starts_between(scene, low, high, count, seed)
    return ExponentRun("ok", "", angles, energy_shares(scene, angles), largest_exponents(scene, angles, seconds))
