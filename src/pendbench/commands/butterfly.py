"""Neighbours of a scene's start, side by side, and the moment at which they fan out."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendbench import __version__
from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.commands.takes import LEFT, body_of, ghost, thinned, truth_of
from pendbench.engines.analytic.ensemble import Ensemble, simulate_ensemble
from pendbench.measures.divergence import time_to
from pendbench.measures.energy import conserves_energy, energy_balance
from pendbench.physics.geometry import positions
from pendbench.report.numbers import number_text
from pendbench.report.plots import blended
from pendbench.report.stage.records import Act, Curve, Stage
from pendbench.scene.scene import Scene
from pendbench.scene.trajectory import Trajectory

#: How far the last angle of a neighbour is from the next one's, rad.
APART: Final = 1e-6
MOST: Final = 2000
_SAMPLES: Final = 600
_SPREAD: Final = "Spread: the farthest any mass is from the middle neighbour's, in lengths of the chain"
_ENERGY: Final = "Energy: the worst neighbour's, in units of the scene's"


def butterfly(scene: Scene, count: int) -> Stage:
    """The stage of `count` chains whose last angles are 1e-6 rad apart. Raises `InputError` for too few or many."""
    if not 2 <= count <= MOST:
        raise InputError(f"--butterfly is {count}; allowed: 2 to {MOST} neighbours")
    found = _neighbours(scene, count)
    spread = Curve(found.t, spread_of(scene, found.theta))
    crossing = time_to(spread.t, spread.values, LEFT)
    fans = math.nan if crossing is None else crossing.time
    truth = truth_of(scene, [_one(found, count // 2)])
    return Stage(
        title=scene.title,
        name=scene.name,
        links=scene.n,
        duration=scene.duration,
        length=scene.total_length,
        acts=(_act(scene, found, spread, fans),),
        truth=ghost(scene, truth, count + 1),
        error_says=_SPREAD,
        energy_says=_ENERGY if conserves_energy(scene) else f"{_ENERGY}; what is missing from its balance",
        words=_words(scene, count, fans),
        facts=(("pendbench", __version__), ("scene", f"{scene.name}, {scene.digest}")),
        now_says="apart now",
    )


def _neighbours(scene: Scene, count: int) -> Ensemble:
    starts = np.tile(scene.angles, (count, 1))
    starts[:, -1] += APART * (np.arange(count) - count // 2)
    rates = np.tile(scene.rates, (count, 1))
    return simulate_ensemble(scene, starts, rates, times=np.linspace(0.0, scene.duration, _SAMPLES + 1))


def spread_of(scene: Scene, theta: FloatArray) -> FloatArray:
    """The farthest that any mass is from that of the middle neighbour, (k,), in lengths. theta: (k, K, n) rad."""
    middle = positions(scene.lengths, theta[:, theta.shape[1] // 2])
    farthest = np.zeros(len(theta))
    for each in range(theta.shape[1]):
        apart = positions(scene.lengths, theta[:, each]) - middle
        farthest = np.fmax(farthest, np.hypot(apart[..., 0], apart[..., 1]).max(axis=-1))
    return np.asarray(farthest / scene.total_length)


def _one(found: Ensemble, which: int) -> Trajectory:
    """One of the neighbours, as far as it went."""
    known = np.isfinite(found.theta[:, which]).all(axis=-1)
    theta, omega = found.theta[known, which], found.omega[known, which]
    return Trajectory(found.t[known], theta, omega, np.zeros(int(known.sum())))


def _act(scene: Scene, found: Ensemble, spread: Curve, fans: float) -> Act:
    count = found.theta.shape[1]
    runs = [_one(found, each) for each in range(count)]
    bodies = tuple(
        body_of(scene, run.t, run.theta, count + 1, colour)
        for run, colour in zip(runs, blended(count), strict=True)
        if len(run.t)
    )
    energy = np.zeros(len(found.t))
    for run in runs:
        own = np.abs(energy_balance(scene, run).error)
        energy[: len(own)] = np.fmax(energy[: len(own)], own)
    detail = f"{number_text(APART)} rad apart in the last angle"
    ended = sorted({str(status) for status in found.status} - {"ok"})
    return Act(
        f"{count} neighbours", detail, blended(3)[1], bodies, thinned(spread), thinned(Curve(found.t, energy)),
        leaves=fans, ended=", ".join(ended),
    )  # fmt: skip


def _words(scene: Scene, count: int, fans: float) -> tuple[str, ...]:
    begin = f"{scene.title}. {count} neighbours begin {number_text(APART)} rad apart in their last angle."
    if math.isnan(fans):
        return begin, "None of them is ever 1 % of the chain's length from the middle one."
    return begin, f"They fan out: after {number_text(fans)} s one is 1 % of the chain's length from the middle one."
