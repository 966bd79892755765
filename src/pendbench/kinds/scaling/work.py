"""What the study `scaling` runs in worker processes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendbench.base.processes import give_memory_back, memory_held
from pendbench.engines.protocol import Simulation, State
from pendbench.engines.recording import simulate
from pendbench.engines.registry import engine
from pendbench.measures.clock import Race, race
from pendbench.measures.energy import Meter, conserves_energy, with_energy_checked
from pendbench.measures.verdict import HOLDS
from pendbench.physics.acting import is_plain
from pendbench.physics.geometry import distance
from pendbench.study.case import Case
from pendbench.study.runs import follow
from pendbench.study.timing import UNTIMED, Timed, measure_timing

_RACE_SAMPLES: Final = 400
_DENSER: Final = 4  # where work has to be integrated


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
    """How a chain fared against the clock.

    judged: held, lost (energy or rods) or too slow; empty where nothing came back. reached_s: how far the motion was
    followed. spent_s: what stepping took.
    """

    status: str
    reason: str = ""
    judged: str = ""
    reached_s: float = math.nan
    spent_s: float = math.nan
    energy_drift_max: float = math.nan

    @property
    def outcome(self) -> str:
        """What it was judged to be, or the status of a run that could not be judged."""
        return self.judged or self.status


def measure_race(case: Case) -> RaceRun:
    """Run the case against the clock: `held` where it keeps up with it, and its energy within 1 %."""
    scene, meter, worst = case.scene, Meter(case.scene), 0.0
    samples = _RACE_SAMPLES * (1 if conserves_energy(scene) else _DENSER)

    def is_lost(t: float, state: State) -> bool:
        nonlocal worst
        worst = max(worst, meter.add(t, state.theta, state.omega))
        return not (worst < HOLDS and state.gap < HOLDS)

    found = race(engine(case.engine), scene, case.method, case.dt, dict(case.settings), samples, is_lost)
    outcome = "lost" if found.lost else "held" if found.spent <= scene.duration else "too slow"
    return RaceRun("ok", _reason(found, outcome), outcome, found.reached, found.spent, worst)


def _reason(found: Race, outcome: str) -> str:
    if found.fault is not None:
        return f"{found.fault.status}: {found.fault.reason}"
    if outcome == "lost":
        return f"the energy, or a rod, is off by more than {HOLDS:.0%} at t = {found.reached:.3g} s"
    return f"{found.reached:.3g} s of motion took {found.spent:.3g} s" if outcome == "too slow" else ""
