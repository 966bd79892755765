"""Many starts of one chain: compiled across trajectories, for vector units, and spread over threads or machines."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pendbench.arrays import FloatArray
from pendbench.connect import LOCAL, connected, lost
from pendbench.errors import InputError, choose, printable
from pendbench.processes import processors
from pendbench.ranges import STEP
from pendbench.recording import step_counts
from pendbench.scene import ANGLE, RATE, Scene, load_scene
from pendbench.strict import show

#: The methods that run across trajectories, those of the analytic engine with the same name.
METHODS: Final = ("adaptive", "rk4")
TOLERANCE: Final = 1e-10
_TOLERANCES: Final = (1e-15, 1e-2)

# Runs side by side: a whole number of vectors, and enough of them to hide what a division takes.
_VECTOR: Final = 8
_LANES: Final = 64
# Links of the runs that are handed out together: enough to be worth it, few enough to be told of and to be cancelled.
_CHUNK_LINKS: Final = 1 << 13
_MOST_STEPS: Final = 10**6
_MOST_EVER: Final = 10**15
# Of a fixed step, which is asked for and whose work is known.
_MOST_FIXED: Final = 10**9
# A cluster is looked at after so long, s, and then after twice as long each time, to the longest: what takes long to
# arrive is given the time. So long may it have no worker.
_LOOK_S: Final = 2.0
_LONGEST_LOOK_S: Final = 64.0
_PATIENCE_S: Final = 120.0
_SMALLEST: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Trajectories of one chain from K starts.

    t (k,) s; theta, omega (k, K, n) rad, rad/s, nan where a trajectory ended before; status (K,): how each ended, a
    word of `trajectory.STATUSES`.
    """

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    status: npt.NDArray[np.str_]


Progress = Callable[[int, int], None]
#: Runs some starts (K, 2n): their states (k, K, 2n) and statuses; or the times of their flips.
Run = Callable[[FloatArray], tuple[Any, Any]]


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

    Raises `InputError`, one line, for whatever cannot be used.
    """
    chosen = scene if isinstance(scene, Scene) else load_scene(scene)
    starts = _starts(chosen, angles, rates)
    _check_progress(progress)
    asked = _times(times, chosen.duration)
    make = partial(_runner, chosen, method, dt, asked, tolerance, most_steps)
    k, runs, n = len(asked), len(starts), chosen.n
    states, status = np.empty((k, runs, 2 * n)), np.empty(runs, dtype="<U16")
    for low, high, out, how in _in_chunks(make, starts, threads, cluster):
        states[:, low:high], status[low:high] = out, how
        if progress is not None:
            progress(high, runs)
    if method == "rk4":
        asked = np.asarray(_step_counts(asked, _step(dt)) * _step(dt), dtype=np.float64)
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
    """
    chosen = scene if isinstance(scene, Scene) else load_scene(scene)
    starts = _starts(chosen, angles, rates)
    _check_progress(progress)
    if np.abs(starts[:, : chosen.n]).max(initial=0.0) > math.pi:
        raise InputError("angles: one begins beyond pi; allowed: from -pi to pi")
    end = np.array([chosen.duration])
    make = partial(_runner, chosen, "adaptive", None, end, tolerance, most_steps, limit=math.pi, flips=True)
    found = np.empty(len(starts))
    for low, high, out, _ in _in_chunks(make, starts, threads, cluster):
        found[low:high] = out
        if progress is not None:
            progress(high, len(starts))
    return found


@contextmanager
def _pool(threads: int | None, cluster: str | None) -> Iterator[tuple[Callable[..., Any], int, Callable[[], bool]]]:
    """What submits chunks, how many run at once, and whether there is anyone to run them."""
    workers = _workers(threads)
    if cluster is None:
        with ThreadPoolExecutor(workers) as pool:
            yield pool.submit, workers, lambda: True
        return
    if threads is not None and cluster != LOCAL:
        raise InputError(f"threads is {threads}; allowed: none, since a cluster has the workers that it has")
    with connected(cluster, workers) as client:
        # Not through Dask's executor: where a result cannot be fetched, its future never ends.
        there = max(1, sum(client.nthreads().values()))
        yield partial(client.submit, pure=False), there, lambda: bool(client.nthreads())


def _in_chunks(make: Callable[[], Run], starts: FloatArray, threads: int | None, cluster: str | None) -> Iterator[Any]:
    """The results of chunks of the starts, in order; a generator that is closed cancels those that have not begun."""
    make()  # what cannot be used is refused before anything runs
    waiting: list[tuple[int, int, Any]] = []
    with _pool(threads, cluster) as (submit, workers, alive):
        size = _chunk(len(starts), starts.shape[1], workers)
        bounds = ((low, min(low + size, len(starts))) for low in range(0, len(starts), size))
        try:
            while True:
                for low, high in itertools.islice(bounds, 2 * workers - len(waiting)):
                    waiting.append((low, high, submit(_run_chunk, make, starts[low:high])))
                if not waiting:
                    return
                low, high, future = waiting.pop(0)
                yield low, high, *_result(future, alive, cluster)
        finally:
            for _, _, future in waiting:
                future.cancel()


def _result(future: Any, alive: Callable[[], bool], cluster: str | None) -> Any:
    """What a chunk gave. Raises InputError where there has been nobody to run it for long."""
    look, alone = _LOOK_S, 0.0
    while alone < _PATIENCE_S:
        try:
            return future.result(timeout=look)
        except TimeoutError:
            alone = 0.0 if alive() else alone + look
            look = min(2.0 * look, _LONGEST_LOOK_S)
    raise InputError(lost(str(cluster)))


def _chunk(runs: int, d: int, workers: int) -> int:
    """How many of the runs, of d numbers each, are handed out together: whole lanes, and some for every worker."""
    most = min(2 * _CHUNK_LINKS // d, math.ceil(runs / workers))
    return max(1, math.ceil(most / _LANES)) * _LANES


def _lanes(runs: int) -> int:
    """How many lanes so many runs can use."""
    return min(_LANES, math.ceil(runs / _VECTOR) * _VECTOR)


def _check_progress(progress: object) -> None:
    if progress is not None and not callable(progress):
        raise InputError(f"progress is {show(progress)}; allowed: a function of how many are done, and of how many")


def _run_chunk(make: Callable[[], Run], starts: FloatArray) -> tuple[Any, Any]:
    """Make what runs some starts where they are to be run: it cannot travel itself."""
    return make()(starts)


def _runner(
    scene: Scene,
    method: str,
    dt: float | None,
    times: FloatArray,
    tolerance: float,
    most_steps: int,
    limit: float = math.inf,
    *,
    flips: bool = False,
) -> Run:
    """What runs some starts, and gives their states or, with `flips`, the times of those."""
    if method not in METHODS:
        raise InputError(f"simulate_ensemble: {choose('method', printable(str(method)), METHODS)}")
    if not (isinstance(tolerance, float) and _TOLERANCES[0] <= tolerance <= _TOLERANCES[1]):
        raise InputError(
            f"tolerance is {show(tolerance)}; allowed: a number from {_TOLERANCES[0]:g} to {_TOLERANCES[1]:g}"
        )
    if type(most_steps) is not int or not 1 <= most_steps <= _MOST_EVER:
        raise InputError(f"most_steps is {show(most_steps)}; allowed: a whole number from 1 to {_MOST_EVER:g}")
    if method == "rk4":
        return _fixed_runner(scene, dt, times)
    if dt is not None:
        raise InputError(f"dt is {show(dt)}; allowed: none, since method 'adaptive' chooses its steps")
    from pendbench.physics.many import many_system_of  # compiles or loads the kernels
    from pendbench.solvers.many import integrate_many
    from pendbench.solvers.outcome import CROSSED
    from pendbench.solvers.tableaux import DOP853

    relative = np.concatenate([np.zeros(scene.n), np.ones(scene.n)])

    def run(starts: FloatArray) -> tuple[Any, Any]:
        out = np.full((len(times), len(starts), 2 * scene.n), np.nan)
        outcomes, stopped = np.zeros(len(starts), np.int64), np.zeros(len(starts))
        lanes, limits = _lanes(len(starts)), (tolerance, relative, _SMALLEST, most_steps)
        system = many_system_of(scene, lanes)
        integrate_many(system, DOP853, starts, times, *limits, lanes, out, outcomes, stopped, limit)
        if flips:
            return np.where(outcomes == CROSSED, stopped, np.where(outcomes == 0, np.inf, np.nan)), None
        return out, _words(outcomes)

    return run


def _fixed_runner(scene: Scene, dt: float | None, times: FloatArray) -> Run:
    from pendbench.physics.many import many_system_of
    from pendbench.solvers.many import runge_kutta_many
    from pendbench.solvers.tableaux import RK4

    step = _step(dt)
    counts = _step_counts(times, step)

    def run(starts: FloatArray) -> tuple[Any, Any]:
        out = np.empty((len(times), len(starts), 2 * scene.n))
        lanes = _lanes(len(starts))
        runge_kutta_many(many_system_of(scene, lanes), RK4, starts, counts, step, lanes, out)
        whole = np.isfinite(out).all(axis=(0, 2))
        return out, np.where(whole, "ok", "not finite")

    return run


def _step(dt: object) -> float:
    try:
        return STEP.read(dt)
    except ValueError as error:
        raise InputError(f"dt is {'missing' if dt is None else show(dt)}; allowed: {error}, the step of rk4") from None


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


def _times(times: npt.ArrayLike | None, duration: float) -> FloatArray:
    try:
        asked = np.array([duration] if times is None else times, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError("times is no list of numbers; allowed: finite times from 0 on, s") from None
    if asked.ndim != 1 or not asked.size or not np.isfinite(asked).all() or asked[0] < 0 or np.any(np.diff(asked) <= 0):
        raise InputError("times is not in order; allowed: finite times from 0 on, each later than the one before, s")
    return asked


def _workers(threads: int | None) -> int:
    if threads is None:
        return processors()
    if type(threads) is not int or not 1 <= threads <= 1024:
        raise InputError(f"threads is {show(threads)}; allowed: 1 to 1024")
    return threads
