"""How the cases of a study move, for a page to show: each at a few hundred times, and the truth at the same times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray, no_numbers
from pendbench.engines.recording import simulate
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import task
from pendbench.measures.energy import energy_balance, with_energy_checked
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.truths import KeptTruth, measure_truth

#: A chain of more links is not shown: its truth takes long.
MOST_LINKS: Final = 100
#: What a run may cost, in steps times links: a second or two of the slower engines.
_RUN_WORK: Final = 1e6
#: What the truth may cost, as `reference_within` says: about as much.
_TRUTH_WORK: Final = 3e4
_SAMPLES: Final = 500
_NUMBERS: Final = 30_000  # of a chain's angles at all samples: long chains have fewer samples


@dataclass(frozen=True, eq=False)
class Motion:
    """A run: t (k,) s, theta (k, n) rad, omega (k, n) rad/s, gap (k,); nothing of it where it did not begin."""

    status: str
    reason: str = ""
    t: FloatArray = field(default_factory=no_numbers)
    theta: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    omega: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    gap: FloatArray = field(default_factory=no_numbers)

    @property
    def run(self) -> Trajectory:
        """The same as a run."""
        return Trajectory(self.t, self.theta, self.omega, self.gap, self.status, self.reason)


@dataclass(frozen=True)
class Motions:
    """Of cases of one scene, until a time, s: how each moves, and the truth."""

    until: float
    motions: tuple[tuple[Case, Motion], ...]
    truth: KeptTruth


def measure_motions(cases: Sequence[Case], runner: Runner) -> Motions | None:
    """How these cases of one scene move; None where there is none, or the chain is too long to be shown."""
    if not cases or cases[0].scene.n > MOST_LINKS:
        return None
    scene, until = cases[0].scene, shown_until(cases)
    times = {case: times_shown(case, until) for case in cases}
    every = np.unique(np.concatenate(list(times.values())))
    tasks: dict[Any, Any] = {case: task(measure_motion, case, own) for case, own in times.items()}
    found = runner.run("what moves", {**tasks, "truth": task(measure_truth, scene, every, _TRUTH_WORK)})
    return Motions(until, tuple((case, found[case]) for case in cases), found["truth"])


def measure_motion(case: Case, times: FloatArray) -> Motion:
    """Run a case, to be seen at `times` (k,) s."""
    run = simulate(case.scene, case.engine, case.method, case.dt, times, **dict(case.settings))
    with np.errstate(all="ignore"):
        run = with_energy_checked(run, energy_balance(case.scene, run))
    return Motion(run.status, run.reason, run.t, run.theta, run.omega, run.gap)


def shown_until(cases: Sequence[Case]) -> float:
    """Up to when cases of one scene are shown, s: to its end, or as far as a second or two of computing gets."""
    scene = cases[0].scene
    finest = min((case.dt for case in cases if case.dt is not None), default=scene.duration)
    return float(min(scene.duration, finest * _RUN_WORK / scene.n))


def times_shown(case: Case, until: float) -> FloatArray:
    """So many even times up to a time, s, each on a whole step of the case."""
    samples = max(50, min(_SAMPLES, _NUMBERS // case.scene.n))
    times = np.linspace(0.0, until, samples + 1)
    return times if case.dt is None else np.unique(np.rint(times / case.dt)) * case.dt
