"""Runs of a case, with the balance of their energy: what all kinds of study do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.recording import simulate
from pendbench.measures.energy import (
    Balance,
    balance_against,
    conserves_energy,
    energy_balance,
    times_to_balance,
)
from pendbench.scene.scene import Scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.truths import KeptTruth

_FREE_RUNS: Final = 10
_CURVE_POINTS: Final = 250


def run_case(case: Case, times: FloatArray, scene: Scene | None = None) -> Trajectory:
    """The run of a case at `times` (k,) s. scene: the case's from another start, or for another time."""
    scene = case.scene if scene is None else scene
    return simulate(scene, case.engine, case.method, case.dt, times, **dict(case.settings))


def curve_samples(k: int) -> Any:
    """Which of k samples of a run are kept of its curves: all of a few, or as many as a curve shows."""
    return np.unique(np.linspace(0, max(k - 1, 0), min(k, _CURVE_POINTS)).astype(int))


def follow(case: Case, times: FloatArray, scene: Scene | None = None) -> tuple[Trajectory, Balance]:
    """The run of a case at `times` (k,) s, and the balance of its energy at these times.

    scene: the case's from another start, or for another time. Where work has to be integrated the run is sampled more
    densely than it is asked for; a method that chooses its steps then shortens them to stop there.
    """
    scene = case.scene if scene is None else scene
    dense = times_to_balance(scene, case.dt, times)
    run = run_case(case, dense, scene)
    balance = energy_balance(scene, run)
    if dense is times:
        return run, balance
    asked = np.isin(run.t, times) if case.dt is None else np.isin(np.rint(run.t / case.dt), np.rint(times / case.dt))
    return _at(run, asked), balance.at(asked)


def _at(run: Trajectory, chosen: Any) -> Trajectory:
    return replace(run, **{name: getattr(run, name)[chosen] for name in ("t", "theta", "omega", "gap")})


def follow_unstopped(case: Case, times: FloatArray, truth: KeptTruth | None) -> tuple[Trajectory, Balance]:
    """The same of a run whose errors are those of the run that is timed, which stops nowhere.

    Where work would have to be integrated, a method that chooses its steps would have to stop: the truth's energy at
    the times that both have is what the run's is compared with.
    """
    if _stops_nowhere(case):
        return follow(case, times)
    run = run_unstopped(case, times)
    if conserves_energy(case.scene):
        return run, energy_balance(case.scene, run)
    right = KeptTruth("refused") if truth is None else truth
    _, ours, theirs = np.intersect1d(run.t, right.t, assume_unique=True, return_indices=True)
    n = case.scene.n
    theta, omega = right.theta[theirs].reshape(-1, n), right.omega[theirs].reshape(-1, n)
    return run, balance_against(case.scene, _at(run, ours), Trajectory(run.t[ours], theta, omega, run.gap[ours]))


def run_unstopped(case: Case, times: FloatArray) -> Trajectory:
    """The states of a case at `times` (k,) s, the first of them 0.

    A method that would shorten its steps to stop at the times is run afresh to some of them, and stops nowhere before.
    """
    if _stops_nowhere(case):
        return run_case(case, times)
    return _run_afresh(case, times[np.unique(np.linspace(0, len(times) - 1, _FREE_RUNS + 1).round().astype(int))])


def _stops_nowhere(case: Case) -> bool:
    """Whether being asked for states changes no step of the case."""
    return not case.its_method.adaptive or case.its_method.dense


def _run_afresh(case: Case, times: FloatArray) -> Trajectory:
    runs = []
    for time in times[1:]:
        runs.append(run_case(case, np.array([0.0, time])))
        if runs[-1].status != "ok":
            break
    ends = [runs[0].t[:1], *(run.t[1:] for run in runs)]
    parts: dict[str, Any] = {
        name: np.concatenate([getattr(runs[0], name)[:1], *(getattr(run, name)[1:] for run in runs)])
        for name in ("theta", "omega", "gap")
    }
    return replace(runs[-1], t=np.concatenate(ends), **parts)
