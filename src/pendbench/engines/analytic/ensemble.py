"""Many starts of one chain: compiled across trajectories, for vector units."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError, choose, printable
from pendbench.base.ranges import rising_times
from pendbench.engines.analytic.chunks import LANES, Halt, Progress, Run, in_chunks
from pendbench.engines.arguments import step_counts, step_of
from pendbench.engines.protocol import Setting
from pendbench.scene.scene import ANGLE, RATE, Scene, scene_of

#: The methods that run across trajectories, those of the analytic engine with the same name.
METHODS: Final = ("adaptive", "rk4")
TOLERANCE: Final = 1e-10
_TOLERANCES: Final = Setting(TOLERANCE, 1e-15, 1e-2)

# Runs side by side are a whole number of vectors.
_VECTOR: Final = 8
_MOST_STEPS: Final = 10**6
_WORK: Final = Setting(_MOST_STEPS, 1, 1e15, integer=True)
# Of a fixed step, which is asked for and whose work is known.
_MOST_FIXED: Final = 10**9
_SMALLEST: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Trajectories of one chain from K starts.

    t (k,) s; theta, omega (k, K, n) rad, rad/s, nan where a trajectory ended before; status (K,): how each ended, a
    word as a run's `status` has it.

    >>> import pendbench as pb
    >>> many = pb.simulate_ensemble("double", [[0.1, 0.1], [2.0, 2.0]], times=[0.0, 1.0, 2.0])
    >>> many
    <Ensemble: 2 runs of 2 links at 3 times, 2 ok>
    >>> many.theta.shape
    (3, 2, 2)
    """

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    status: npt.NDArray[np.str_]

    def __repr__(self) -> str:
        k, runs, n = self.theta.shape
        well = int(np.count_nonzero(self.status == "ok"))
        return f"<Ensemble: {runs} runs of {n} link{'s' * (n != 1)} at {k} times, {well} ok>"


def simulate_ensemble(
    scene: Scene | str | os.PathLike[str],
    angles: npt.ArrayLike,
    rates: npt.ArrayLike | None = None,
    *,
    method: str = "adaptive",
    dt: float | None = None,
    times: npt.ArrayLike | None = None,
    tolerance: float = TOLERANCE,
    most_steps: int = _MOST_STEPS,
    threads: int | None = None,
    cluster: str | None = None,
    progress: Progress | None = None,
) -> Ensemble:
    """Run the scene's chain from each of the starts angles (K, n) rad, rates (K, n) rad/s (at rest without them).

    times (k,) s, rising; the scene's duration alone where None. method: `adaptive` (dt None), with the local error
    allowed per step; or `rk4`, whose times must be whole multiples of its step dt, s. A trajectory that needs more than
    `most_steps` of `adaptive` ends with the status `work limit`; `rk4` may take 1e9. threads: one for each processor
    where None. cluster: the address of a Dask cluster to run on instead, or `local` for one with as many processes.
    progress(done, K) is called as trajectories are done; whatever it raises cancels the rest.

    Results are those of `simulate` from each start, but for rounding. The starts and the states asked for, and a word
    for each, are all that grows with K: (16 (k + 1) n + 64) K bytes, and 32 n K before the first run, where that is
    more. Whoever has no room for them asks for a part of the starts at a time.

    >>> import numpy as np, pendbench as pb
    >>> angles = np.linspace(0.1, 0.2, 100)[:, np.newaxis] * [1.0, 1.0]
    >>> pb.simulate_ensemble("double", angles).theta.shape
    (1, 100, 2)

    Raises `InputError`, one line, for whatever cannot be used.
    """
    chosen = scene_of(scene)
    starts = _starts(chosen, angles, rates)
    asked = rising_times([chosen.duration] if times is None else times)
    make = partial(_runner, chosen, method, dt, asked, tolerance, most_steps)
    k, runs, n = len(asked), len(starts), chosen.n
    states, status = np.empty((k, runs, 2 * n)), np.empty(runs, dtype="<U16")
    for low, high, out, how in in_chunks(make, starts, threads, cluster, progress):
        states[:, low:high], status[low:high] = out, how
    if step := step_of(method, method == "adaptive", dt):
        asked = np.asarray(_step_counts(asked, step) * step, dtype=np.float64)
    return Ensemble(asked, states[..., :n], states[..., n:], status)


def first_flips(
    scene: Scene | str | os.PathLike[str],
    angles: npt.ArrayLike,
    rates: npt.ArrayLike | None = None,
    *,
    tolerance: float = TOLERANCE,
    most_steps: int = _MOST_STEPS,
    threads: int | None = None,
    cluster: str | None = None,
    progress: Progress | None = None,
) -> FloatArray:
    """When a rod of the chain first goes over the top, |theta| = pi, from each start: (K,) s.

    inf where that does not happen within the scene's duration, nan where a run ended badly. The arguments are those of
    `simulate_ensemble`; no angle may begin beyond pi.

    >>> import pendbench as pb
    >>> never, soon = pb.first_flips("double", [[0.1, 0.1], [3.0, 3.0]])
    >>> print(never, bool(0.0 < soon < 10.0))
    inf True
    """
    chosen = scene_of(scene)
    starts = _starts(chosen, angles, rates)
    if np.abs(starts[:, : chosen.n]).max(initial=0.0) > math.pi:
        raise InputError("angles: one begins beyond pi; allowed: from -pi to pi")
    make = partial(_flip_runner, chosen, tolerance, most_steps)
    found = np.empty(len(starts))
    for low, high, out, _ in in_chunks(make, starts, threads, cluster, progress):
        found[low:high] = out
    return found


def _lanes(runs: int) -> int:
    """How many lanes so many runs can use."""
    return min(LANES, math.ceil(runs / _VECTOR) * _VECTOR)


def _runner(scene: Scene, method: str, dt: float | None, times: FloatArray, tolerance: float, most_steps: int) -> Run:
    """What runs some starts, and gives their states."""
    if method not in METHODS:
        raise InputError(f"simulate_ensemble: {choose('method', printable(str(method)), METHODS)}")
    limits = _limits(scene, tolerance, most_steps)
    step = step_of(method, method == "adaptive", dt)
    return _adaptive_runner(scene, times, limits, math.inf) if step is None else _fixed_runner(scene, step, times)


def _flip_runner(scene: Scene, tolerance: float, most_steps: int) -> Run:
    """What runs some starts, and gives the times of their flips."""
    return _adaptive_runner(scene, np.array([scene.duration]), _limits(scene, tolerance, most_steps), math.pi)


def _limits(scene: Scene, tolerance: float, most_steps: int) -> Any:
    from pendbench.solvers.control import Limits

    tolerance, most_steps = _TOLERANCES.read("tolerance", tolerance), int(_WORK.read("most_steps", most_steps))
    return Limits(tolerance, np.concatenate([np.zeros(scene.n), np.ones(scene.n)]), _SMALLEST, most_steps)


def _adaptive_runner(scene: Scene, times: FloatArray, limits: Any, border: float) -> Run:
    from pendbench.physics.kernels.table import ensemble_system_of  # compiles or loads the kernels
    from pendbench.solvers.dop853 import DOP853
    from pendbench.solvers.ensemble import Runs, integrate_ensemble
    from pendbench.solvers.outcome import CROSSED

    def run(starts: FloatArray, halt: Halt) -> tuple[Any, Any]:
        out = np.full((len(times), len(starts), 2 * scene.n), np.nan)
        outcomes, stopped = np.zeros(len(starts), np.int64), np.zeros(len(starts))
        lanes, runs = _lanes(len(starts)), Runs(starts, times, out, outcomes, stopped)
        integrate_ensemble(ensemble_system_of(scene, lanes), DOP853, limits, runs, lanes, border, halt)
        if border < math.inf:
            return np.where(outcomes == CROSSED, stopped, np.where(outcomes == 0, np.inf, np.nan)), None
        return out, _words(outcomes)

    return run


def _fixed_runner(scene: Scene, step: float, times: FloatArray) -> Run:
    from pendbench.physics.kernels.table import ensemble_system_of
    from pendbench.solvers.ensemble import runge_kutta_ensemble
    from pendbench.solvers.rk4 import RK4

    counts = _step_counts(times, step)

    def run(starts: FloatArray, halt: Halt) -> tuple[Any, Any]:
        out = np.empty((len(times), len(starts), 2 * scene.n))
        lanes = _lanes(len(starts))
        runge_kutta_ensemble(ensemble_system_of(scene, lanes), RK4, starts, counts, step, lanes, out, halt)
        whole = np.isfinite(out).all(axis=(0, 2))
        return out, np.where(whole, "ok", "not finite")

    return run


def _step_counts(times: FloatArray, dt: float) -> npt.NDArray[np.int64]:
    """After how many steps each of the times comes."""
    if times[-1] > _MOST_FIXED * dt:
        raise InputError(
            f"dt is {dt:g}; allowed: {times[-1] / _MOST_FIXED:g} or more, for {_MOST_FIXED:g} steps at most"
        )
    return step_counts(times, dt)


def _words(outcomes: Any) -> npt.NDArray[np.str_]:
    from pendbench.solvers.outcome import REASONS

    words = {outcome: status for outcome, (status, _) in REASONS.items()}
    return np.array([words.get(int(outcome), "ok") for outcome in outcomes])


def _starts(scene: Scene, angles: npt.ArrayLike, rates: npt.ArrayLike | None) -> FloatArray:
    theta = _table("angles", angles, scene.n, ANGLE)
    omega = np.zeros_like(theta) if rates is None else _table("rates", rates, scene.n, RATE)
    if omega.shape != theta.shape:
        raise InputError(f"rates has shape {omega.shape}; allowed: that of angles, {theta.shape}")
    return np.concatenate([theta, omega], axis=1)


def _table(name: str, values: npt.ArrayLike, n: int, allowed: Any) -> FloatArray:
    try:
        table = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} is no table of numbers; allowed: shape (K, {n})") from None
    if table.ndim != 2 or table.shape[1] != n or not len(table):
        raise InputError(f"{name} has shape {table.shape}; allowed: (K, {n}), a row for each start")
    if not np.all((table >= allowed.low) & (table <= allowed.high)):
        raise InputError(
            f"{name} holds a number out of range; allowed: {allowed.low:g} to {allowed.high:g} {allowed.unit}"
        )
    return table
