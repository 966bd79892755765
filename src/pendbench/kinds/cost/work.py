"""What the study `cost` runs in worker processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray, largest, no_numbers
from pendbench.measures.energy import with_energy_checked
from pendbench.study.case import Case
from pendbench.study.runs import curve_samples, follow, follow_unstopped
from pendbench.study.truths import KeptTruth, compare, suspicion

_LONG_SAMPLES: Final = 20_000


@dataclass(frozen=True)
class ErrorRun:
    """How a case ended, and its largest errors; nan for what could not be measured. seen: what no honest run does."""

    status: str
    reason: str = ""
    steps: int | None = None
    error_max: float = math.nan
    angle_error_max_rad: float = math.nan
    reference_error: float = math.nan
    energy_drift_max: float = math.nan
    gap_max: float = math.nan
    seen: str = ""
    energy_floor: float = math.nan


@dataclass(frozen=True, eq=False)
class LongRun:
    """What the energy of a long run does, in units of its scale; t (k,) s and energy_error (k,): some of its samples.

    energy_slope_share: what the slope moves the energy by over the whole run, over the band.
    """

    status: str
    reason: str = ""
    steps: int | None = None
    energy_drift_max: float = math.nan
    energy_drift_band: float = math.nan
    energy_drift_slope_per_s: float = math.nan
    energy_slope_share: float = math.nan
    energy_band_first_tenth: float = math.nan
    energy_band_last_tenth: float = math.nan
    t: FloatArray = field(default_factory=no_numbers)
    energy_error: FloatArray = field(default_factory=no_numbers)
    energy_floor: float = math.nan


def measure_error(case: Case, times: FloatArray, truth: KeptTruth | None) -> ErrorRun:
    """Run the case up to the last of `times` (k,) s and compare it with the truth; there is no error without one."""
    run, balance = follow_unstopped(case, times, truth)
    run = with_energy_checked(run, balance)
    found = ErrorRun(
        run.status, run.reason, run.steps, energy_drift_max=balance.drift().largest, energy_floor=balance.known_to,
        gap_max=largest(run.gap),
    )  # fmt: skip
    if truth is None or run.status != "ok" or len(truth.t) == 0 or truth.t[-1] < times[-1]:
        return found
    compared = compare(case.scene, run, truth)
    return replace(
        found,
        error_max=largest(compared.error),
        angle_error_max_rad=largest(compared.angle_error),
        reference_error=largest(compared.known),
        seen=suspicion(case, run, compared),
    )


def measure_long_run(case: Case, steps: int) -> LongRun:
    """Take `steps` steps and see what the energy does: over all of them, and in the first and the last tenth."""
    times = np.arange(0, steps + 1, max(1, steps // _LONG_SAMPLES)) * (case.dt or 0.0)
    run, balance = follow(case, np.asarray(times, dtype=np.float64))
    run, k = with_energy_checked(run, balance), len(run.t)
    tenth = max(1, k // 10)
    whole, first, last = balance.drift(), balance.drift(slice(tenth)), balance.drift(slice(max(0, k - tenth), k))
    chosen = curve_samples(k)
    return LongRun(
        run.status,
        run.reason,
        run.steps,
        energy_drift_max=whole.largest,
        energy_floor=balance.known_to,
        energy_drift_band=whole.band,
        energy_drift_slope_per_s=whole.slope,
        energy_slope_share=abs(whole.slope) * float(run.t[-1]) / whole.band if k > 1 and whole.band > 0 else math.nan,
        energy_band_first_tenth=first.band,
        energy_band_last_tenth=last.band,
        t=run.t[chosen],
        energy_error=balance.error[chosen],
    )
