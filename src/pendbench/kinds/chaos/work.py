"""What the study `chaos` runs in worker processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray, largest, no_numbers
from pendbench.engines.arguments import on_steps, whole_steps
from pendbench.engines.recording import simulate
from pendbench.measures.divergence import Crossing, growth_rate, time_to
from pendbench.measures.drift import Drift
from pendbench.measures.energy import Balance, with_energy_checked
from pendbench.measures.lyapunov import lyapunov_exponent
from pendbench.scene.scene import Scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.runs import curve_samples, follow
from pendbench.study.truths import Compared, KeptTruth, compare, suspicion

#: The errors e whose first passing counts as divergence.
THRESHOLDS: Final = (1e-3, 1e-2, 1e-1)

_LEAST_SAMPLES: Final = 20
_APART: Final = 1e-10
_GROWTH_FROM: Final = 1e-12
_GROWTH_TO: Final = 1e-2


@dataclass(frozen=True)
class KeptExponent:
    """The largest Lyapunov exponent of a scene, 1/s, its standard error, and whether the motion is chaotic."""

    status: str
    reason: str = ""
    rate: float = math.nan
    error: float = math.nan
    chaotic: bool = False


@dataclass(frozen=True)
class Neighbour:
    """growth: the rate, 1/s, at which a start 1e-10 rad away leaves the truth; nan where it does not grow enough."""

    status: str
    reason: str = ""
    growth: float = math.nan


@dataclass(frozen=True, eq=False)
class Curves:
    """Some samples of a run: t (j,) s, its error e (j,), nan where it is not compared, and its energy's error (j,)."""

    t: FloatArray = field(default_factory=no_numbers)
    error: FloatArray = field(default_factory=no_numbers)
    energy: FloatArray = field(default_factory=no_numbers)


_NO_DRIFT: Final = Drift(math.nan, math.nan, math.nan, math.nan)


@dataclass(frozen=True)
class ChaosRun:
    """How a case went from one start; nan for what could not be measured.

    error_half, energy_half, known_half: the largest error, energy error and error of the reference up to half of the
    horizon. energy_floor: how well the energy's balance is known; nan where energy is conserved. crossings: of each of
    `THRESHOLDS`, None where it was not passed; none at all where nothing was compared.
    order_error: the largest error up to the time at which orders are fitted. too_good: what no honest run can do.
    """

    status: str
    reason: str = ""
    steps: int | None = None
    error_max: float = math.nan
    error_half: float = math.nan
    known_half: float = math.nan
    angle_error_max: float = math.nan
    crossings: tuple[Crossing | None, ...] = ()
    growth: float = math.nan
    order_error: float = math.nan
    energy: Drift = _NO_DRIFT
    energy_half: float = math.nan
    energy_floor: float = math.nan
    gap_max: float = math.nan
    too_good: str = ""
    curves: Curves = field(default_factory=Curves)


def compared_times(case: Case, sample: float) -> FloatArray:
    """The times (k,) s at which a case is compared: about every `sample` s, oftener where the scene is short, and on
    whole steps of the case.
    """
    count = max(_LEAST_SAMPLES, whole_steps(case.scene.duration, sample))
    times: FloatArray = np.arange(count + 1.0) * min(sample, case.scene.duration / _LEAST_SAMPLES)
    return times if case.dt is None else on_steps(times, case.dt, case.scene.duration)


def measure_exponent(scene: Scene, seconds: float) -> KeptExponent:
    """The scene's largest Lyapunov exponent, over `seconds` of its motion."""
    return KeptExponent("ok", "", *lyapunov_exponent(scene, seconds))


def measure_neighbour(scene: Scene, truth: KeptTruth | None) -> Neighbour:
    """What chaos does to any small error in the very seconds of the scene."""
    if truth is None or not len(truth.t):
        return Neighbour("ok")
    found = compare(
        scene, simulate(scene.with_start(scene.angles + _APART, scene.rates), method="adaptive", times=truth.t), truth
    )
    return Neighbour("ok", growth=growth_rate(found.t, found.error, _GROWTH_FROM, _GROWTH_TO))


def measure_run(
    case: Case, start: Scene, times: FloatArray, order_time: float, with_curves: bool, truth: KeptTruth | None
) -> ChaosRun:
    """Run the case from `start` and compare it with that start's truth at all of `times` (k,) s up to its horizon.

    Without a truth, what needs none is measured: energy, gap, steps and status.
    """
    run, balance = follow(case, times, start)
    run = with_energy_checked(run, balance)
    own = ChaosRun(
        run.status, run.reason, run.steps, energy=balance.drift(), energy_floor=balance.known_to,
        gap_max=largest(run.gap),
    )  # fmt: skip
    error = np.zeros(0)
    if truth is not None:
        found, compared = compare(start, run, truth), times[np.isin(times, truth.t)]
        half, error = 0.5 * compared[-1], found.error
        until_half = run.t <= half
        own = replace(
            _with_errors(own, found, compared, half),
            order_error=_up_to(times, error, order_time),
            energy_half=balance.drift(until_half).largest,
            too_good=suspicion(case, run, found),
        )
    return replace(own, curves=_curves(run, error, balance)) if with_curves else own


def _with_errors(own: ChaosRun, found: Compared, compared: FloatArray, half: float) -> ChaosRun:
    """A run with its errors. compared: (k,) s, the times at which it should have been compared; half: s."""
    until_half = (found.t <= half) & (np.count_nonzero(found.t <= half) > 1)  # the start alone is no comparison
    return replace(
        own,
        error_max=largest(found.error),
        error_half=largest(found.error[until_half]),
        known_half=largest(found.known[until_half]),
        angle_error_max=largest(found.angle_error),
        crossings=_crossings(compared, found.error),
        growth=growth_rate(found.t, found.error, _GROWTH_FROM, _GROWTH_TO),
    )


def _crossings(t: FloatArray, error: FloatArray) -> tuple[Crossing | None, ...]:
    """When the error passes each threshold. A run that ended before all of t has diverged then, if it ever began."""
    if not len(error):
        return ()
    ended = np.append(error, np.inf) if len(error) < len(t) else error
    return tuple(time_to(t[: len(ended)], ended, threshold) for threshold in THRESHOLDS)


def _up_to(t: FloatArray, error: FloatArray, time: float) -> float:
    """The largest error up to the one of the times t (k,) s that is nearest to `time`; nan where it was not reached.

    The nearest, so that a step that is rounded to eight digits is compared as far as the one that is not.
    """
    count = int(np.argmin(np.abs(t - time))) + 1
    return largest(error[:count]) if count <= len(error) else math.nan


def _curves(run: Trajectory, error: FloatArray, balance: Balance) -> Curves:
    chosen, errors = curve_samples(len(run.t)), np.full(len(run.t), np.nan)
    errors[: len(error)] = error
    return Curves(run.t[chosen], errors[chosen], balance.error[chosen])
