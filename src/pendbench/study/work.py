"""The jobs of studies: what runs in a worker process. Each returns a record of JSON's types."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.engines.protocol import Fault, Simulation, State
from pendbench.engines.registry import engine
from pendbench.physics.energy import energy, energy_scale
from pendbench.physics.geometry import distance, wrapped
from pendbench.physics.recursion import accelerations
from pendbench.processes import give_memory_back
from pendbench.recording import simulate
from pendbench.scene import Scene
from pendbench.study.case import Case
from pendbench.study.causes import model_error
from pendbench.study.clock import Timing, race, time_case, time_each_step
from pendbench.study.lyapunov import lyapunov_exponent
from pendbench.study.measure import drift, growth_rate, time_to
from pendbench.study.store import Store
from pendbench.study.verdict import HOLDS, verdict_of
from pendbench.trajectory import Trajectory
from pendbench.truth import Truth, reference, solve_angles, solve_vectors

Record = dict[str, Any]

#: The errors e whose first passing counts as divergence.
THRESHOLDS: Final = (1e-3, 1e-2, 1e-1)

_CURVE_POINTS: Final = 250
_LONG_SAMPLES: Final = 20_000
_FREE_RUNS: Final = 10
_RACE_SAMPLES: Final = 400
_JUDGED_NUMBERS: Final = 200_000  # angles of all samples together
_APART: Final = 1e-10
_MOVED: Final = 0.1  # rad: no longer where it was
_PULLED: Final = 1e-5  # rad/s^2: more than what an equilibrium has by rounding, or by a nudge of 1e-9 rad
_GROWTH_FROM: Final = 1e-12
_GROWTH_TO: Final = 1e-2
#: So many samples that are all the truth to the last bit tell something; the first few of a good method are, too.
_TELLING: Final = 16


#: The kernels of the reference, each with what compiles it.
FORMS: Final[dict[str, Callable[[Scene], object]]] = {
    "angle form": lambda scene: next(solve_angles(scene, np.array([1e-9]))),
    "vector form": lambda scene: next(solve_vectors(scene, np.array([1e-9]))),
}


def compile_kernel(name: str, scene: Scene) -> Record:
    """Compile one of `FORMS` or a method of the analytic engine, or load it where that was done before."""
    if name in FORMS:
        FORMS[name](scene)
    else:
        adaptive = engine("analytic").methods[name].adaptive
        simulate(scene, "analytic", name, None if adaptive else 1e-9, [1e-9])
    return {}


def measure_truth(scene: Scene, times: FloatArray, store: Store, key: str) -> Record:
    """Compute the truth at `times`, save its arrays under `key`, and say how good it is."""
    truth = reference(scene, times)
    names = ("t", "theta", "omega", "theta_low", "disagreement")
    store.save_arrays(key, {name: getattr(truth, name) for name in names})
    return {
        "horizon": truth.horizon,
        "error": float(truth.error),
        "growth": _growth_of_neighbours(scene, truth),
        "status": truth.status,
        "reason": truth.reason,
    }


def _growth_of_neighbours(scene: Scene, truth: Truth) -> float:
    """The rate, 1/s, at which a start 1e-10 rad away leaves the truth: what chaos does to any small error here."""
    neighbour = simulate(scene.with_start(scene.angles + _APART, scene.rates), times=truth.t)
    offset = truth.offset(neighbour.theta)
    return growth_rate(
        truth.t[: len(offset)], distance(scene.lengths, truth.theta[: len(offset)], offset), _GROWTH_FROM, _GROWTH_TO
    )


def measure_exponent(scene: Scene, seconds: float) -> Record:
    """The scene's largest Lyapunov exponent."""
    found = lyapunov_exponent(scene, seconds)
    return {"rate": found.rate, "error": found.error, "chaotic": found.chaotic}


def measure_model(case: Case, seed: int) -> Record:
    """How far the engine's accelerations are from the equations'."""
    return model_error(engine(case.engine), case.scene, case.method, dict(case.settings), seed)._asdict()


def measure_timing(case: Case, until: float) -> Record:
    """What the case costs."""
    return _timing(time_case(engine(case.engine), case.scene, case.method, case.dt, dict(case.settings), until), until)


def measure_cost_timing(case: Case, until: float, interval: float) -> Record:
    """The same, and what a step costs a caller who asks for the state after every one (or every `interval` s)."""
    its, settings = engine(case.engine), dict(case.settings)
    timing = _timing(time_case(its, case.scene, case.method, case.dt, settings, until), until)
    each = time_each_step(its, case.scene, case.method, case.dt, settings, interval)
    return {**timing, "step_and_state_us": each}


def _timing(found: Timing, until: float) -> Record:
    return {
        "step_us": found.step_us,
        "step_spread": found.spread,
        "simulated_s_per_s": until / found.run_s,
        "build_s": found.build_s,
        "first_call_s": found.first_call_s,
        "run_s": found.run_s,
    }


def measure_run(
    case: Case, start: Scene, times: FloatArray, truth_key: str, store: Store, order_time: float, curve: bool
) -> Record:
    """Run the case from `start` and compare it with the truth saved under `truth_key`, whose times hold all of `times`.

    Where there is no truth, what needs none is measured: energy, gap, steps and status.
    """
    truth = store.load_arrays(truth_key)
    run = simulate(start, case.engine, case.method, case.dt, times, **dict(case.settings))
    record: Record = {"status": run.status, "reason": run.reason, "steps": run.steps, "gap_max": _largest(run.gap)}
    if truth is None:
        return record | _energies(start, run, 0.0) | {"order_error": None}
    at = np.searchsorted(truth["t"], times)
    inside = at < len(truth["t"])
    compared, at = times[inside], at[inside]
    error, angle = _errors(start, run, truth, at)
    record |= _energies(start, run, compared[-1])
    record |= _divergence(compared, error)
    half = compared <= 0.5 * compared[-1]
    half &= np.count_nonzero(half) > 1  # the start alone is no comparison
    upto = _largest(error[half[: len(error)]])
    record |= {
        "error_max": _largest(error),
        "too_good": _too_good(case, run, truth, at),
        "error_half": upto,
        "reference_error_half": _largest(truth["disagreement"][at[half]]),
        "angle_error_max_rad": _largest(angle),
        "growth": growth_rate(compared[: len(error)], error, _GROWTH_FROM, _GROWTH_TO),
        "order_error": _at(compared[: len(error)], error, order_time),
    }
    if curve:
        record["curve"] = _curve(start, run, error)
    return record


def measure_error(case: Case, times: FloatArray, truth_key: str, store: Store) -> Record:
    """Run the case up to the last of `times` and compare it with the truth saved under `truth_key`.

    A method that would shorten its steps to stop at the times is run afresh to some of them: its errors are to be
    those of the run that is timed, which stops nowhere. Raises LookupError where the truth is not there.
    """
    truth = store.load_arrays(truth_key)
    if truth is None:
        raise LookupError("no truth to compare with")
    method = engine(case.engine).methods[case.method]
    if method.adaptive and not method.dense:
        times = times[np.unique(np.linspace(0, len(times) - 1, _FREE_RUNS + 1).round().astype(int))]
        run = _run_freely(case, times)
    else:
        run = simulate(case.scene, case.engine, case.method, case.dt, times, **dict(case.settings))
    at = np.searchsorted(truth["t"], times - 1e-9)
    if at[-1] >= len(truth["t"]):
        until, horizon = f"{times[-1]:.4g} s", f"{truth['t'][-1]:.4g} s"
        return failed_run(Fault("error", f"compared up to {until}, but the reference's horizon is {horizon}"))
    error, angle = _errors(case.scene, run, truth, at)
    whole = run.status == "ok"
    return {
        "status": run.status,
        "reason": run.reason,
        "steps": run.steps,
        "error_max": _largest(error) if whole else None,
        "angle_error_max_rad": _largest(angle) if whole else None,
        "reference_error": _largest(truth["disagreement"][at]),
        "energy_drift_max": _energies(case.scene, run, float(times[-1]))["energy_drift_max"],
        "gap_max": _largest(run.gap),
        "too_good": _too_good(case, run, truth, at),
    }


def _run_freely(case: Case, times: FloatArray) -> Trajectory:
    """The states at `times` (k,) s, the first of them 0, each from a run of its own that stops nowhere before."""
    runs = []
    for time in times[1:]:
        runs.append(simulate(case.scene, case.engine, case.method, None, [0.0, time], **dict(case.settings)))
        if runs[-1].status != "ok":
            break
    ends = [runs[0].t[:1], *(run.t[1:] for run in runs)]
    parts: dict[str, Any] = {
        name: np.concatenate([getattr(runs[0], name)[:1], *(getattr(run, name)[1:] for run in runs)])
        for name in ("theta", "omega", "gap")
    }
    return replace(runs[-1], t=np.concatenate(ends), **parts)


def measure_long_run(case: Case, steps: int) -> Record:
    """Take `steps` steps and see what the energy does: over all of them, and in the first and the last tenth."""
    stride = max(1, steps // _LONG_SAMPLES)
    times = np.arange(0, steps + 1, stride) * (case.dt or 0.0)
    run = simulate(case.scene, case.engine, case.method, case.dt, times, **dict(case.settings))
    with np.errstate(over="ignore"):
        values, scale = energy(case.scene, run.theta, run.omega), energy_scale(case.scene)
    k = len(values)
    whole, tenth = drift(run.t, values, scale), max(1, k // 10)
    first, last = drift(run.t[:tenth], values[:tenth], scale), drift(run.t[-tenth:], values[-tenth:], scale)
    return {
        "status": run.status,
        "reason": run.reason,
        "steps": run.steps,
        "energy_drift_max": whole.largest,
        "energy_drift_band": whole.band,
        "energy_drift_slope_per_s": whole.slope,
        "energy_slope_share": abs(whole.slope) * float(run.t[-1]) / whole.band if k > 1 and whole.band > 0 else None,
        "energy_band_first_tenth": first.band,
        "energy_band_last_tenth": last.band,
        "curve": _curve(case.scene, run, np.zeros(0)),
    }


def measure_stability(case: Case, duration: float) -> Record:
    """Run the case for `duration` (s) and judge it."""
    scene = replace(case.scene, duration=duration)
    times = _times_to_judge(scene, case.dt)
    run = simulate(scene, case.engine, case.method, case.dt, times, **dict(case.settings))
    with np.errstate(over="ignore", invalid="ignore"):
        values, scale = energy(scene, run.theta, run.omega), energy_scale(scene)
        strays = (values - values[:1]) / scale if scale else values - values[:1]
    found = verdict_of(run.status, run.reason, run.t, strays, run.gap)
    return {
        "status": run.status,
        "reason": found.reason,
        "verdict": found.word,
        "broke_s": found.broke,
        "stays_s": _stays(scene, run),
        "energy_drift_max": _largest(np.abs(strays)),
        "gap_max": _largest(run.gap),
        "steps": run.steps,
    }


def _times_to_judge(scene: Scene, dt: float | None) -> FloatArray:
    """Every step, or as many samples as memory allows: what strays for a moment is to be seen."""
    most = max(1000, min(10_000, _JUDGED_NUMBERS // scene.n))
    if dt is None:
        return np.linspace(0.0, scene.duration, most + 1)
    total = max(1, math.floor(scene.duration / dt + 1e-6))
    counts = np.unique(np.linspace(0, total, min(total, most) + 1).round().astype(np.int64))
    return np.asarray(counts * dt, dtype=np.float64)


def _stays(scene: Scene, run: Trajectory) -> float | None:
    """When a chain released at rest, where nothing pulls it, had moved by `_MOVED`; its end where it never had."""
    pulled = np.abs(accelerations(scene, scene.angles, scene.rates)).max() > _PULLED
    if scene.rates.any() or pulled or not len(run.t):
        return None
    moved = np.flatnonzero(np.abs(run.theta - scene.angles).max(axis=1) > _MOVED)
    return float(run.t[moved[0]] if moved.size else run.t[-1])


def failed_stability(fault: Fault) -> Record:
    """The record of a run of which nothing came back."""
    return {"status": fault.status, "reason": fault.reason, "verdict": fault.status}


def measure_step_cost(case: Case, step: float, steps: int) -> Record:
    """What a step of the case costs, the memory it takes, and how far `steps` steps of `step` (s) are from the motion.

    For a method that chooses its steps: a step of its own, over the same time.
    """
    its, settings, until = engine(case.engine), dict(case.settings), step * steps
    run = simulate(case.scene, case.engine, case.method, case.dt, [until], **settings)
    if run.status != "ok":
        return failed_run(Fault(run.status, run.reason))
    exact = simulate(case.scene, "analytic", "taylor", None, [until], tolerance=1e-13)
    timing = time_case(its, case.scene, case.method, case.dt, settings, until)
    error = distance(case.scene.lengths, exact.theta, run.theta - exact.theta)
    found = energy(case.scene, run.theta, run.omega) - energy(case.scene, case.scene.angles, case.scene.rates)
    return {
        "status": "ok",
        "reason": "",
        "error_max": float(error.max()),
        "energy_drift_max": float(np.abs(found).max()) / energy_scale(case.scene),
        "memory_mb": _memory_taken(case, step) / 1e6,
        **_timing(timing, until),
    }


def _memory_taken(case: Case, step: float) -> float:
    """By how many bytes the process grows when the case is built and has taken a step (s), while it is there."""
    import psutil

    give_memory_back()
    before = psutil.Process().memory_info().rss
    run = engine(case.engine).build(case.scene, case.method, case.dt, **dict(case.settings))
    if isinstance(run, Simulation):
        run.advance(1)
    else:
        run.advance_to(step)
    return max(0.0, float(psutil.Process().memory_info().rss - before))


def measure_race(case: Case) -> Record:
    """Run the case against the clock: `held` where it keeps up with it, and its energy within 1 %."""
    scene, worst = case.scene, 0.0
    scale, first = energy_scale(scene), float(energy(scene, scene.angles, scene.rates))

    def is_lost(state: State) -> bool:
        nonlocal worst
        with np.errstate(over="ignore", invalid="ignore"):
            worst = max(worst, abs(float(energy(scene, state.theta, state.omega)) - first) / scale)
        return not (worst < HOLDS and state.gap < HOLDS)

    found = race(engine(case.engine), scene, case.method, case.dt, dict(case.settings), _RACE_SAMPLES, is_lost)
    outcome = "lost" if found.lost else "held" if found.spent <= scene.duration else "too slow"
    reason = {
        "lost": f"the energy, or a rod, is off by more than {HOLDS:.0%} at t = {found.reached:.3g} s",
        "too slow": f"{found.reached:.3g} s of motion took {found.spent:.3g} s",
        "held": "",
    }[outcome]
    if found.fault is not None:
        reason = f"{found.fault.status}: {found.fault.reason}"
    return {
        "outcome": outcome,
        "reason": reason,
        "reached_s": found.reached,
        "spent_s": found.spent,
        "energy_drift_max": worst,
    }


def failed_run(fault: Fault) -> Record:
    """The record of a run of which nothing came back."""
    return {"status": fault.status, "reason": fault.reason, "order_error": None}


def _errors(scene: Scene, run: Trajectory, truth: dict[str, FloatArray], at: Any) -> tuple[FloatArray, FloatArray]:
    """E and the largest wrapped angle error at each compared time that the run reached."""
    at = at[: len(run.t)]
    offset = (run.theta[: len(at)] - truth["theta"][at]) - truth["theta_low"][at]
    angle = np.abs(wrapped(offset)).max(axis=1, initial=0.0)
    return distance(scene.lengths, truth["theta"][at], offset), angle


def _too_good(case: Case, run: Trajectory, truth: dict[str, FloatArray], at: Any) -> str:
    """What no honest run can do, in words: take no steps, or stay on the truth to the last bit; empty for most runs."""
    at = at[: len(run.t)]
    if run.steps is not None and run.steps < (1 if _is_dense(case) else np.count_nonzero(run.t)):
        return f"{run.steps} steps to {np.count_nonzero(run.t)} different times"
    same = truth["t"][at] == run.t[: len(at)]  # the others are a rounding apart, and so are their angles
    at = at[same]
    offset = (run.theta[: len(same)][same] - truth["theta"][at]) - truth["theta_low"][at]
    rounding = 0.5 * np.spacing(np.abs(truth["theta"][at]))
    return "the truth, to the last bit" if len(at) >= _TELLING and np.all(np.abs(offset) <= rounding) else ""


def _is_dense(case: Case) -> bool:
    return engine(case.engine).methods[case.method].dense


def _divergence(t: FloatArray, error: FloatArray) -> Record:
    """When the error passes each threshold. A run that ended early has diverged then, if it ever began."""
    if not len(error):
        return {}
    ended = np.append(error, np.inf) if len(error) < len(t) else error
    crossings = [time_to(t[: len(ended)], ended, threshold) for threshold in THRESHOLDS]
    return {"crossings": [list(crossing) if crossing else None for crossing in crossings]}


def _energies(scene: Scene, run: Trajectory, horizon: float) -> Record:
    with np.errstate(over="ignore"):  # a run that blew up has an infinite energy
        values, scale = energy(scene, run.theta, run.omega), energy_scale(scene)
    whole = drift(run.t, values, scale)
    half = drift(run.t[run.t <= 0.5 * horizon], values[run.t <= 0.5 * horizon], scale)
    return {
        "energy_drift_max": whole.largest,
        "energy_drift_final": whole.final,
        "energy_drift_band": whole.band,
        "energy_drift_slope_per_s": whole.slope,
        "energy_drift_half": half.largest,
    }


def _curve(scene: Scene, run: Trajectory, error: FloatArray) -> list[list[float | None]]:
    """t, e and the energy's error of some of the samples; e is None past the horizon."""
    k = len(run.t)
    chosen = np.unique(np.linspace(0, max(k - 1, 0), min(k, _CURVE_POINTS)).astype(int))
    with np.errstate(over="ignore"):
        values, scale = energy(scene, run.theta, run.omega), energy_scale(scene)
    strays = (values - values[:1]) / scale if scale else values * 0
    return [
        [float(run.t[i]) for i in chosen],
        [float(error[i]) if i < len(error) else None for i in chosen],
        [float(strays[i]) for i in chosen],
    ]


def _largest(values: FloatArray) -> float | None:
    return float(values.max()) if len(values) else None


def _at(t: FloatArray, values: FloatArray, time: float) -> float | None:
    """The largest value up to `time`, or None where t does not get there."""
    return float(values[t <= time + 1e-9].max()) if len(t) and t[-1] >= time - 1e-9 else None
