"""The largest Lyapunov exponent: how fast neighbouring starts part. Benettin's method, and that of one scene."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.analytic.adapter import AnalyticEngine
from pendbench.measures.energy import conserves_energy, is_driven
from pendbench.scene.scene import Scene

#: Some states (k, 2n) and their neighbours, both an interval later.
Advance = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

_APART: Final = 1e-7  # rad: small enough to stay linear, large enough above the solver's own errors
_INTERVAL: Final = 0.5  # between two returns to that distance, in units of sqrt(L / g)
_SETTLING: Final = 10  # a tenth of the time
_BLOCKS: Final = 10


class Exponent(NamedTuple):
    """rate: 1/s. error: its standard error over blocks of time. chaotic: whether it is told from regular motion."""

    rate: float
    error: float
    chaotic: bool


def time_unit(scene: Scene) -> float:
    """sqrt(L / g), s: of the size of a swing."""
    return 1.0 / math.sqrt((scene.effects.gravity or 1.0) / scene.total_length)


def partings(advance: Advance, y: FloatArray, unit: float, apart: float) -> Iterator[FloatArray]:
    """The logarithm (k,) of the factor by which neighbours part in an interval, for one interval after the other.

    y (k, 2n): the starts. Neighbours begin `apart` from them and are brought back to that distance after each interval,
    in the direction in which they have parted. Distances mix angles, rad, and rates times `unit`, s. Source: Benettin,
    Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980).
    """
    n = y.shape[1] // 2
    weight = np.concatenate([np.ones(n), np.full(n, unit)])
    other = y + apart / math.sqrt(2 * n) / weight
    while True:
        y, other = advance(y, other)
        distance = np.linalg.norm((other - y) * weight, axis=1)
        yield np.log(distance / apart)
        other = y + (other - y) * (apart / distance)[:, None]


def lyapunov_exponent(scene: Scene, seconds: float) -> Exponent:
    """The exponent over `seconds` of the scene's motion, after a tenth of that to settle.

    Neighbours are 1e-7 apart, and are brought back to that every sqrt(L / g) / 2. Regular motion parts linearly in
    time, which looks like a rate of ln(T) / T: a rate is called chaotic above three times that, and above three times
    its standard error. A single pendulum that keeps its energy never is: that leaves it no room, however unstable its
    upper equilibrium. Where damping wins, neighbours meet again and the rate is negative. Drives go on from interval to
    interval; where nothing depends on the time, each interval begins at time 0.
    """
    unit = time_unit(scene)
    interval = _INTERVAL * unit
    count = max(_BLOCKS, math.ceil(seconds / interval))
    settling = count // _SETTLING
    start = np.concatenate([scene.angles, scene.rates])[None]
    every = partings(_Clocked(scene, interval), start, unit, _APART)
    logs = [float(log[0]) for log in itertools.islice(every, settling, settling + count)]
    rates = np.array([block.mean() for block in np.array_split(logs, _BLOCKS)]) / interval
    rate, error = float(rates.mean()), float(rates.std(ddof=1) / math.sqrt(_BLOCKS))
    total = count * interval
    has_room = scene.n > 1 or not conserves_energy(scene)
    chaotic = has_room and rate > 3 * error and rate > 3 * math.log(total / unit) / total
    return Exponent(rate, error, chaotic)


@dataclass
class _Clocked:
    """Advances states (1, 2n) by an interval, s, from where the last one ended: what drives the chain goes on."""

    scene: Scene
    interval: float
    intervals: int = 0

    def __call__(self, y: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Both an interval later."""
        begin = self.intervals * self.interval if is_driven(self.scene) else 0.0
        self.intervals += 1
        return self._advanced(y[0], begin)[None], self._advanced(other[0], begin)[None]

    def _advanced(self, y: FloatArray, begin: float) -> FloatArray:
        from pendbench.engines.analytic.runs import Adaptive  # compiles or loads the kernels

        n = self.scene.n
        settings = AnalyticEngine.methods["adaptive"].with_defaults({"tolerance": 1e-11})
        run = Adaptive(self.scene.with_start(y[:n], y[n:]), settings, begin)
        run.advance_to(begin + self.interval)
        return np.concatenate(run.state()[:2])
