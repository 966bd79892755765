"""What the study `league` runs in worker processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pendbench.base.arrays import FloatArray, largest
from pendbench.engines.arguments import on_steps, whole_steps
from pendbench.measures.divergence import time_to
from pendbench.measures.energy import with_energy_checked
from pendbench.measures.verdict import verdict_of
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.runs import follow_unstopped
from pendbench.study.truths import KeptTruth, compare


@dataclass(frozen=True)
class LeagueRun:
    """How a case went; nan for what could not be measured.

    error_early: the largest error up to the time for which an accuracy is asked. follows_s: for how long the error
    stays below 1 % of the length, s. judged: one of `VERDICTS`.
    """

    status: str
    reason: str = ""
    steps: int | None = None
    error_max: float = math.nan
    error_early: float = math.nan
    follows_s: float = math.nan
    energy_drift_max: float = math.nan
    energy_floor: float = math.nan
    gap_max: float = math.nan
    judged: str = ""

    @property
    def verdict(self) -> str:
        """One of `VERDICTS`."""
        return self.judged or self.status


def compared_times(dt: float | None, duration: float, sample: float) -> FloatArray:
    """The times (k,) s at which a run is compared: about every `sample` s, on whole steps."""
    times = np.arange(whole_steps(duration, sample) + 1.0) * sample
    return times if dt is None else on_steps(times, dt, duration)


def measure_run(case: Case, times: FloatArray, early: float, leaves: float, truth: KeptTruth | None) -> LeagueRun:
    """Run the case, compare it with the truth at `times` (k,) s, and judge it.

    early: s, up to when an accuracy is asked for. leaves: the error at which a run has left the truth, in lengths of
    the chain.
    """
    run, balance = follow_unstopped(case, times, truth)
    word = verdict_of(run.status, run.reason, balance.t, balance.excess, run.gap, balance.known_to).word
    run = with_energy_checked(run, balance)
    found = LeagueRun(
        run.status, run.reason, run.steps, energy_drift_max=largest(np.abs(balance.error)),
        energy_floor=balance.known_to, gap_max=largest(run.gap), judged=word,
    )  # fmt: skip
    return found if truth is None or not len(truth.t) else _compared(case, found, run, early, leaves, truth)


def _compared(
    case: Case, found: LeagueRun, run: Trajectory, early: float, leaves: float, truth: KeptTruth
) -> LeagueRun:
    both = compare(case.scene, run, truth)
    if not len(both.t):
        return replace(found, follows_s=0.0)
    crossing = time_to(both.t, both.error, leaves)
    soon = both.t <= early * (1 + 1e-9)
    whole = bool(both.t[-1] >= early * (1 - 1e-2))
    return replace(
        found,
        error_max=largest(both.error),
        error_early=largest(both.error[soon]) if whole else math.nan,
        follows_s=crossing.time if crossing else float(both.t[-1]),
    )
