"""What the study `effects` runs in worker processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.arguments import on_steps, whole_steps
from pendbench.measures.energy import energy_balance
from pendbench.scene.scene import Scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.runs import run_case
from pendbench.study.timing import measure_timing
from pendbench.study.truths import KeptTruth, compare

#: Errors are taken about every so many seconds, on whole steps of the case.
GRID_S: Final = 0.01
_BETWEEN: Final = 20
_MOST_SAMPLES: Final = 20_000
_ROUNDS: Final = 3


@dataclass(frozen=True)
class EffectRun:
    """How a case ended, its errors, and the balance of its energy; nan for what could not be measured."""

    status: str
    reason: str = ""
    steps: int | None = None
    error_max: float = math.nan
    gap_max: float = math.nan
    moved_max_rad: float = math.nan
    balance_error: float = math.nan
    balance_floor: float = math.nan


def compared_times(scene: Scene, dt: float | None) -> FloatArray:
    """The times (k,) s at which a case's errors are taken."""
    times: FloatArray = np.arange(whole_steps(scene.duration, GRID_S) + 1.0) * GRID_S
    times = times if len(times) > 1 else np.array([0.0, scene.duration])
    return times if dt is None else on_steps(times, dt, scene.duration)


def run_times(scene: Scene, dt: float | None) -> FloatArray:
    """Every step, or as many as memory allows, and those at which errors are taken: the balance needs them all."""
    compared = compared_times(scene, dt)
    if dt is None:
        between = np.linspace(compared[:-1], compared[1:], _BETWEEN, endpoint=False).T.ravel()
        return np.union1d(between, compared)
    steps = whole_steps(scene.duration, dt)
    return np.union1d(np.arange(0, steps + 1, -(-steps // _MOST_SAMPLES)) * dt, compared)


def measure_effect(case: Case, truth: KeptTruth | None) -> EffectRun:
    """Run the case, compare it with the truth where there is one, and balance its energy."""
    run = run_case(case, run_times(case.scene, case.dt))
    if not len(run.t):
        return EffectRun(run.status, run.reason, run.steps)
    balance = energy_balance(case.scene, run)
    return EffectRun(
        run.status,
        run.reason,
        run.steps,
        _largest_error(case.scene, run, truth),
        float(run.gap.max()),
        float(np.abs(run.theta - case.scene.angles).max()),
        float(np.abs(balance.error).max()) if balance.scale else math.nan,
        balance.known_to,
    )


def _largest_error(scene: Scene, run: Trajectory, truth: KeptTruth | None) -> float:
    """The largest error of all samples; nan where nothing but the start was compared."""
    if truth is None or not len(truth.t):
        return math.nan
    compared = compare(scene, run, truth)
    return float(compared.error.max()) if len(compared.t) > 1 else math.nan


class Price(NamedTuple):
    """us a step; over that of the bare chain, the median of rounds in turn; the largest less the smallest of these."""

    step_us: float = math.nan
    ratio: float = math.nan
    spread: float = math.nan


@dataclass(frozen=True)
class Prices:
    """What a step of each of some chains costs, by label."""

    status: str
    reason: str = ""
    prices: dict[str, Price] = field(default_factory=dict)


def measure_prices(cases: dict[str, Case], bare: str) -> Prices:
    """What a step of each case costs, and its ratio to that of the case called `bare`, measured in turn."""
    costs = {label: np.zeros(_ROUNDS) for label in cases}
    for number in range(_ROUNDS):
        for label, case in cases.items():
            costs[label][number] = measure_timing(case, case.scene.duration).step_us
    return Prices("ok", prices={label: _price(cost, costs[bare]) for label, cost in costs.items()})


def _price(cost: FloatArray, bare: FloatArray) -> Price:
    """A ratio is of the medians, so that it is that of the costs beside it; its spread is over the rounds."""
    return Price(float(np.median(cost)), float(np.median(cost) / np.median(bare)), float(np.ptp(cost / bare)))
