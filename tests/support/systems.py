"""Systems with known solutions that are no pendulums: what a solver needs to know of them, it is told here."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendbench.base.compiled import compiled, specialise
from pendbench.solvers import problem
from pendbench.solvers.extended import extrapolation
from pendbench.solvers.extended.double_double import scale


class Oscillator(NamedTuple):
    """q'' = -w^2 q. State (q, v)."""

    frequency: float

    def exact(self, start: np.ndarray, t: float) -> np.ndarray:
        """The state (2,) at time t."""
        (q, v), w = start, self.frequency
        c, s = math.cos(w * t), math.sin(w * t)
        return np.array([q * c + v / w * s, v * c - q * w * s])


class Growth(NamedTuple):
    """y' = rate y^power + drive cos t. State (1,)."""

    rate: float
    power: float
    drive: float


@compiled
def _oscillate(system: Oscillator, t: float, y: np.ndarray, dy: np.ndarray) -> None:  # noqa: ARG001
    dy[0] = y[1]
    dy[1] = -(system.frequency**2) * y[0]


@compiled
def _pull(system: Oscillator, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> None:  # noqa: ARG001
    a[0] = -(system.frequency**2) * q[0]


@compiled
def _expand(system: Oscillator, t: float, q: np.ndarray, v: np.ndarray) -> None:  # noqa: ARG001
    before = q
    for k in range(len(v) - 1):
        v[k + 1, 0] = -(system.frequency**2) * before[0] / (k + 1)
        before = v[k] / (k + 1)


@compiled
def _oscillate_extended(system: Oscillator, y: np.ndarray, dy: np.ndarray) -> None:
    dy[0, 0], dy[0, 1] = y[1, 0], y[1, 1]
    dy[1, 0], dy[1, 1] = scale(scale((y[0, 0], y[0, 1]), -system.frequency), system.frequency)


@compiled
def _grow(system: Growth, t: float, y: np.ndarray, dy: np.ndarray) -> None:
    dy[0] = system.rate * y[0] ** system.power + system.drive * math.cos(t)


specialise(problem.derivative, Oscillator, _oscillate)
specialise(problem.acceleration, Oscillator, _pull)
specialise(problem.rate_series, Oscillator, _expand)
specialise(extrapolation.extended_derivative, Oscillator, _oscillate_extended)
specialise(problem.derivative, Growth, _grow)


def order(steps: np.ndarray, errors: np.ndarray) -> float:
    """The slope of log error over log step."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
