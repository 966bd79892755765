"""The jobs of the study `effects`, which run in a worker process. Each returns a record of JSON's types."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.engines.registry import engine
from pendbench.physics.acting import power
from pendbench.physics.energy import energy, energy_scale
from pendbench.physics.geometry import distance
from pendbench.recording import simulate
from pendbench.scene import Scene
from pendbench.study.case import Case
from pendbench.study.clock import time_case
from pendbench.study.store import Store
from pendbench.trajectory import Trajectory
from pendbench.truth import reference

Record = dict[str, Any]

#: Errors are taken at multiples of this, s.
GRID_S: Final = 0.01
_BETWEEN: Final = 20
_MOST_SAMPLES: Final = 20_000
_ROUNDS: Final = 3
_FEWEST: Final = 4  # samples that a spline needs


def measure_effect_truth(scene: Scene, times: FloatArray, store: Store, key: str) -> Record:
    """Compute the truth at `times`, save its arrays under `key`, and say how good it is."""
    truth = reference(scene, times)
    store.save_arrays(key, {name: getattr(truth, name) for name in ("t", "theta", "theta_low")})
    return {
        "horizon": truth.horizon,
        "error": float(truth.error),
        "moved_max_rad": float(np.abs(truth.theta - scene.angles).max()),
        "status": truth.status,
        "reason": truth.reason,
    }


def measure_effect(case: Case, truth_key: str, store: Store) -> Record:
    """Run the case, compare it with the truth saved under `truth_key`, and balance its energy."""
    truth = store.load_arrays(truth_key)
    if truth is None:
        raise LookupError("no truth to compare with")
    run = simulate(case.scene, case.engine, case.method, case.dt, _times(case), **dict(case.settings))
    record: Record = {"status": run.status, "reason": run.reason, "steps": run.steps}
    if not len(run.t):
        return record
    at = np.searchsorted(run.t, truth["t"] - 1e-9)
    met = at < len(run.t)
    met[met] = np.abs(run.t[at[met]] - truth["t"][met]) < 1e-9  # a step need not divide the grid
    known = {name: array[met] for name, array in truth.items()}
    offset = (run.theta[at[met]] - known["theta"]) - known["theta_low"]
    with np.errstate(over="ignore", invalid="ignore"):
        if np.any(known["t"] > 0.0):
            record["error_max"] = float(distance(case.scene.lengths, known["theta"], offset).max())
        else:
            record["reason"] = record["reason"] or f"no step ends at a multiple of {GRID_S:g} s, where errors are taken"
        record |= {"gap_max": float(run.gap.max())}
        record |= {"moved_max_rad": float(np.abs(run.theta - case.scene.angles).max())}
        record |= _balance(case.scene, run)
    return record


def _times(case: Case) -> FloatArray:
    """Every step, or as many as memory allows; of a method that chooses its steps, some between the truth's times."""
    step = GRID_S / _BETWEEN if case.dt is None else case.dt
    steps = round(case.scene.duration / step)
    return np.asarray(np.arange(0, steps + 1, -(-steps // _MOST_SAMPLES)) * step, dtype=np.float64)


def truth_times(scene: Scene) -> FloatArray:
    """The times at which errors are taken."""
    return np.asarray(np.arange(round(scene.duration / GRID_S) + 1) * GRID_S, dtype=np.float64)


def _balance(scene: Scene, run: Trajectory) -> Record:
    """How far the energy is from what the effects' power leaves of it, and how well the integral of power is known.

    In units of the scene's energy, or of the largest change where that is larger; nothing where there are too few
    samples, no energy, or more than a float can hold. The floor is what half of the samples would have given.
    """
    change = energy(scene, run.theta, run.omega)
    change = change - change[0]
    given = power(scene, run.t, run.theta, run.omega)
    scale = max(energy_scale(scene), float(np.abs(change).max()))
    if len(run.t) < _FEWEST or not scale or not np.all(np.isfinite(change)) or not np.all(np.isfinite(given)):
        return {}
    work = _integral(run.t, given)
    rough = _integral(run.t[::2], given[::2])
    return {
        "balance_error": float(np.abs(change - work).max()) / scale,
        "balance_floor": float(np.abs(work[::2] - rough).max()) / 15 / scale,
    }


def _integral(t: FloatArray, values: FloatArray) -> FloatArray:
    """The integral (k,) of values (k,) from the first time, by the cubic spline through them: of order 4."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(t, values).antiderivative()(t))


def measure_prices(cases: dict[str, Case], bare: str) -> Record:
    """What a step of each case costs, us, and its ratio to the case called `bare`: the median of rounds in turn."""
    first = cases[bare]
    its, costs = engine(first.engine), {label: np.zeros(_ROUNDS) for label in cases}
    for round_number in range(_ROUNDS):
        for label, case in cases.items():
            timing = time_case(its, case.scene, case.method, case.dt, dict(case.settings), case.scene.duration)
            costs[label][round_number] = timing.step_us
    ratios = {label: cost / costs[bare] for label, cost in costs.items()}
    return {
        "prices": {
            label: {
                "step_us": float(np.median(cost)),
                "step_price": float(np.median(ratios[label])),
                "price_spread": float(np.ptp(ratios[label])),
            }
            for label, cost in costs.items()
        },
        "status": "ok",
        "reason": "",
    }
