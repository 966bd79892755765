"""What the study `scaling` runs in worker processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.processes import give_memory_back, memory_held
from pendbench.engines.protocol import Simulation, State
from pendbench.engines.recording import simulate
from pendbench.engines.registry import engine
from pendbench.measures.clock import race
from pendbench.measures.coarse_motion import CoarseErrors, coarse_errors, coarse_motion
from pendbench.measures.energy import Meter, conserves_energy, with_energy_checked
from pendbench.measures.known_motion import Known
from pendbench.measures.titles import Shown, title_of
from pendbench.physics.acting import is_plain
from pendbench.physics.geometry import distance
from pendbench.scene.scene import Scene
from pendbench.study.case import Case
from pendbench.study.runs import follow
from pendbench.study.timing import UNTIMED, Timed, measure_timing

_SELDOM: Final = 6  # of the samples, one in so many is asked of a method that chooses its steps, to keep them long


@dataclass(frozen=True)
class StepCost:
    """What a step costs, the memory that a chain takes, and how far the steps were from the motion; nan where not
    measured. error_max: in lengths of the chain. energy_drift_max: in energy scales. memory_mb: 1e6 bytes.
    """

    status: str
    reason: str = ""
    error_max: float = math.nan
    energy_drift_max: float = math.nan
    memory_mb: float = math.nan
    timing: Timed = UNTIMED
    energy_floor: float = math.nan


def measure_step_cost(case: Case, step: float, steps: int) -> StepCost:
    """What a step of the case costs, the memory it takes, and how far `steps` steps of `step` (s) are from the motion.

    For a method that chooses its steps: a step of its own, over the same time.
    """
    until = step * steps
    run, balance = follow(case, np.array([0.0, until]))
    run = with_energy_checked(run, balance)
    if run.status != "ok":
        return StepCost(run.status, run.reason)
    best = "taylor" if is_plain(case.scene) else "adaptive"
    exact = simulate(case.scene, "analytic", best, None, [0.0, until], tolerance=1e-13)
    timing = measure_timing(case, until)
    error = distance(case.scene.lengths, exact.theta, run.theta - exact.theta)
    drift, memory = float(np.abs(balance.error).max()), _memory_taken(case, step) / 1e6
    return StepCost("ok", "", float(error.max()), drift, memory, timing, balance.known_to)


def _memory_taken(case: Case, step: float) -> int:
    """By how many bytes the process grows when the case is built and has taken a step (s), while it is there."""
    give_memory_back()
    before = memory_held()
    run = engine(case.engine).build(case.scene, case.method, case.dt, **dict(case.settings))
    if isinstance(run, Simulation):
        run.advance(1)
    else:
        run.advance_to(step)
    return max(0, memory_held() - before)


@dataclass(frozen=True)
class RaceRun:
    """What a chain showed against the clock; where nothing came back, status and reason say why."""

    status: str
    reason: str = ""
    shown: Shown = field(default_factory=Shown)


def measure_race(case: Case, every: float, titles: tuple[str, ...], known: Known | None = None) -> RaceRun:
    """Run the case until it is too slow, or can win none of the titles any more, and say what it has shown.

    every: s, between two samples, a whole number of steps. known: its motion there, where a title asks for that.
    """
    watch = _Watch(case.scene, every, known or Known("ok"))
    asked = [title_of(name) for name in titles]

    def is_lost(t: float, state: State) -> bool:
        shown = watch.see(t, state)
        return all(title.fails(shown) for title in asked)

    times = _sampled(case, every, watch.known.samples)
    found = race(engine(case.engine), case.scene, case.method, case.dt, dict(case.settings), times, is_lost)
    fault = "" if found.fault is None else f"{found.fault.status}: {found.fault.reason}"
    shown = replace(watch.shown, length=float(times[-1]), reached=found.reached, spent=found.spent, fault=fault)
    return RaceRun("ok", "", shown)


def _sampled(case: Case, every: float, compared: int) -> FloatArray:
    """When a run is looked at, s: always while it is compared, and seldom later where that would shorten its steps."""
    samples = np.arange(1, max(1, round(case.scene.duration / every)) + 1)
    if case.dt is None and conserves_energy(case.scene):
        samples = samples[(samples < compared) | (samples % _SELDOM == 0) | (samples == samples[-1])]
    return np.asarray(samples * every, np.float64)


class _Watch:
    """What a run shows, sample by sample."""

    def __init__(self, scene: Scene, every: float, known: Known) -> None:
        self.known, self._scene, self._every, self._meter = known, scene, every, Meter(scene)
        nothing = CoarseErrors(0.0, 0.0, 0.0) if len(known.lowest) else CoarseErrors()
        self.shown = Shown(error=0.0 if len(known.angles) else math.nan, coarse=nothing)

    def see(self, t: float, state: State) -> Shown:
        """What it has shown with its state at t, s; what is nan once stays so."""
        was, at = self.shown, round(t / self._every)
        strays = self._meter.add(t, state.theta, state.omega)
        self.shown = replace(
            was,
            reached=t,
            strays=_larger(was.strays, strays),
            risen=self._meter.risen,
            lost=self._meter.lost,
            gap=_larger(was.gap, state.gap),
            error=_larger(was.error, self._error(at, state.theta)),
            coarse=CoarseErrors(*map(_larger, was.coarse, self._coarse(at, state.theta))),
        )
        return self.shown

    def _error(self, at: int, theta: FloatArray) -> float:
        """The error e at a sample, 0 where nothing is compared any more."""
        if at >= len(self.known.angles):
            return 0.0
        right = self.known.angles[at]
        with np.errstate(over="ignore", invalid="ignore"):
            return float(distance(self._scene.lengths, right, theta - right))

    def _coarse(self, at: int, theta: FloatArray) -> CoarseErrors:
        """The errors of the coarse motion at a sample."""
        if at >= len(self.known.lowest):
            return CoarseErrors(0.0, 0.0, 0.0)
        with np.errstate(over="ignore", invalid="ignore"):
            found = coarse_motion(self._scene, theta[np.newaxis])
        return coarse_errors(found, self.known.swing(slice(at, at + 1)), self._scene.total_length)


def _larger(a: float, b: float) -> float:
    return float(np.maximum(a, b))
