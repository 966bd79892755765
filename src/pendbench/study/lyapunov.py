"""The largest Lyapunov exponent of a scene: how fast neighbouring starts part."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.engines.analytic import AnalyticEngine
from pendbench.engines.protocol import AdaptiveSimulation
from pendbench.physics.acting import check_plain
from pendbench.scene import Scene

_APART = 1e-7  # rad: small enough to stay linear, large enough above the solver's own errors
_BLOCKS = 10


class Exponent(NamedTuple):
    """rate: 1/s. error: its standard error over blocks of time. chaotic: whether it is told from regular motion."""

    rate: float
    error: float
    chaotic: bool


def _advanced(scene: Scene, y: FloatArray, interval: float) -> FloatArray:
    n = scene.n
    simulation = AnalyticEngine().build(scene.with_start(y[:n], y[n:]), "adaptive", None, tolerance=1e-11)
    assert isinstance(simulation, AdaptiveSimulation)
    simulation.advance_to(interval)
    state = simulation.state()
    return np.concatenate([state.theta, state.omega])


def lyapunov_exponent(scene: Scene, seconds: float) -> Exponent:
    """The exponent over `seconds` of the scene's motion, after a tenth of that to settle.

    Two solutions start 1e-7 apart and are brought back to that distance at short intervals; the exponent is the mean
    rate at which they part (Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15, 1980). Distances mix angles and rates
    in units of sqrt(g / L). Regular motion parts linearly in time, which looks like a rate of ln(T) / T: a rate is
    called chaotic above three times that, and above three times its standard error. A single pendulum never is: its
    energy leaves it no room, however unstable its upper equilibrium. Raises InputError where more than gravity acts:
    each interval begins at time 0.
    """
    check_plain(scene, "this exponent")
    gravity = scene.effects.gravity or 1.0
    swing = math.sqrt(gravity / scene.total_length)
    weight = np.concatenate([np.ones(scene.n), np.full(scene.n, 1.0 / swing)])
    interval = 0.5 / swing
    count = max(_BLOCKS, math.ceil(seconds / interval))
    y = np.concatenate([scene.angles, scene.rates])
    other = y + _APART / math.sqrt(2 * scene.n) / weight
    logs = []
    for _ in range(count + count // 10):
        y, other = _advanced(scene, y, interval), _advanced(scene, other, interval)
        apart = (other - y) * weight
        distance = float(np.linalg.norm(apart))
        logs.append(math.log(distance / _APART))
        other = y + (other - y) * (_APART / distance)
    rates = np.array([block.mean() for block in np.array_split(logs[-count:], _BLOCKS)]) / interval
    rate, error = float(rates.mean()), float(rates.std(ddof=1) / math.sqrt(_BLOCKS))
    total = count * interval
    chaotic = scene.n > 1 and rate > 3 * error and rate > 3 * math.log(total * swing) / total
    return Exponent(rate, error, chaotic)
