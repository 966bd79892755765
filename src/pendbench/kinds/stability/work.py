"""What the study `stability` runs in worker processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray, largest
from pendbench.engines.arguments import whole_steps
from pendbench.measures.energy import is_driven
from pendbench.measures.verdict import verdict_of
from pendbench.physics.kernels.recursion import accelerations
from pendbench.scene.scene import Scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.runs import follow

_JUDGED_NUMBERS: Final = 200_000  # angles of all samples together
_MOVED: Final = 0.1  # rad: no longer where it was
_PULLED: Final = 1e-5  # rad/s^2: more than what an equilibrium has by rounding, or by a nudge of 1e-9 rad


@dataclass(frozen=True)
class StabilityRun:
    """How a case ended and how it was judged.

    judged: one of `VERDICTS`, empty where nothing came back that could be judged. broke_s, stays_s: s, nan where it
    never broke, or was not a chain that stands still. steps: that it took.
    """

    status: str
    reason: str = ""
    judged: str = ""
    broke_s: float = math.nan
    stays_s: float = math.nan
    energy_drift_max: float = math.nan
    gap_max: float = math.nan
    steps: int | None = None
    energy_floor: float = math.nan

    @property
    def verdict(self) -> str:
        """One of `VERDICTS`."""
        return self.judged or self.status


def measure_stability(case: Case, duration: float) -> StabilityRun:
    """Run the case for `duration` (s) and judge it."""
    scene = replace(case.scene, duration=duration)
    times = _times_to_judge(scene, case.dt)
    run, balance = follow(case, times, scene)
    found = verdict_of(run.status, run.reason, run.t, balance.excess, run.gap, balance.known_to)
    return StabilityRun(
        run.status, found.reason, found.word, found.broke, _stays(scene, run), largest(np.abs(balance.error)),
        largest(run.gap), run.steps, balance.known_to,
    )  # fmt: skip


def _times_to_judge(scene: Scene, dt: float | None) -> FloatArray:
    """Every step, or as many samples as memory allows: what strays for a moment is to be seen."""
    most = max(1000, min(10_000, _JUDGED_NUMBERS // scene.n))
    if dt is None:
        return np.linspace(0.0, scene.duration, most + 1)
    total = max(1, whole_steps(scene.duration, dt))
    counts = np.unique(np.linspace(0, total, min(total, most) + 1).round().astype(np.int64))
    return np.asarray(counts * dt, dtype=np.float64)


def _stays(scene: Scene, run: Trajectory) -> float:
    """When a chain released at rest, where nothing pulls it, had moved by `_MOVED`; its end where it never had."""
    pulled = np.abs(accelerations(scene, scene.angles, scene.rates)).max() > _PULLED
    if scene.rates.any() or pulled or is_driven(scene) or not len(run.t):
        return math.nan
    moved = np.flatnonzero(np.abs(run.theta - scene.angles).max(axis=1) > _MOVED)
    return float(run.t[moved[0]] if moved.size else run.t[-1])
