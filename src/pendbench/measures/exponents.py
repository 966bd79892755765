"""Finite-time Lyapunov exponents of many starts of one chain at once, over its energies."""

from __future__ import annotations

import itertools
import math
from functools import partial
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.analytic.ensemble import simulate_ensemble
from pendbench.measures.lyapunov import partings, time_unit
from pendbench.physics.energy import energy, energy_scale
from pendbench.scene.scene import Scene

_APART: Final = 1e-8  # small enough to stay linear, large enough above the solver's own errors
_TOLERANCE: Final = 1e-13
_INTERVAL: Final = 1.5  # between two returns to that distance, in units of sqrt(L / g)
_SETTLING: Final = 0.1
_DRAWN: Final = 4096
_MOST_DRAWS: Final = 1000


def energy_shares(scene: Scene, angles: FloatArray) -> FloatArray:
    """The energy of release at rest from angles (k, n) rad: 0 for the hanging chain, 1 for the upright one."""
    still = np.zeros_like(angles)
    lowest = energy(scene, still[:1], still[:1])
    return np.asarray((energy(scene, angles, still) - lowest) / energy_scale(scene))


def starts_between(scene: Scene, low: float, high: float, count: int, seed: int) -> FloatArray:
    """Release angles (count, n) rad, evenly spread over those whose energy share lies between `low` and `high`.

    Raises LookupError where hardly any does.
    """
    rng = np.random.default_rng(seed)
    found, total = [], 0
    for _ in range(_MOST_DRAWS):
        angles = rng.uniform(-math.pi, math.pi, (_DRAWN, scene.n))
        share = energy_shares(scene, angles)
        found.append(angles[(share >= low) & (share < high)])
        total += len(found[-1])
        if total >= count:
            return np.concatenate(found)[:count]
    raise LookupError(f"hardly any release has an energy between {low:g} and {high:g} of the range")


def largest_exponents(scene: Scene, angles: FloatArray, seconds: float) -> FloatArray:
    """The largest Lyapunov exponent over `seconds` of the motion from each of angles (k, n) rad at rest, (k,) 1/s.

    Neighbours are 1e-8 apart, and are brought back to that every 1.5 sqrt(L / g) or a little sooner, after a tenth of
    the time to settle; nan where a run could not be followed.
    """
    unit = time_unit(scene)
    count = max(1, math.ceil(seconds / (_INTERVAL * unit)))
    settling = math.ceil(_SETTLING * count)
    starts = np.concatenate([angles, np.zeros_like(angles)], axis=1)
    every = partings(partial(_advanced, scene, seconds / count), starts, unit, _APART)
    return sum(itertools.islice(every, settling, settling + count), np.zeros(len(angles))) / seconds


def regular_below(scene: Scene, seconds: float) -> float:
    """Below this, 1/s, an exponent over `seconds` is not told from regular motion: three times ln(T) / T."""
    return 3.0 * math.log(seconds / time_unit(scene)) / seconds


def _advanced(scene: Scene, interval: float, y: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The states (k, 2n) of both after `interval` s, each pair less the same whole turns."""
    n, both = scene.n, np.concatenate([y, other])
    run = simulate_ensemble(scene, both[:, :n], both[:, n:], times=[interval], tolerance=_TOLERANCE, threads=1)
    after = np.concatenate([run.theta[0], run.omega[0]], axis=1)
    first, second = after[: len(y)], after[len(y) :]
    turns = 2.0 * math.pi * np.round(first[:, :n] / (2.0 * math.pi))
    first[:, :n] -= turns
    second[:, :n] -= turns
    return first, second
