"""Where the small chains really are: the dense form of the equations by scipy, which shares no code with any engine."""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.protocol import State
from pendbench.physics.dense import accelerations
from pendbench.scene.scene import Scene

#: How many samples of a second there are.
SAMPLES: Final = 4

_known: dict[str, tuple[State, ...]] = {}


def truth(scene: Scene) -> tuple[State, ...]:
    """The chain at each quarter of the first second, to 1e-12 or so; computed once for each chain."""
    key = scene.digest
    if key not in _known:
        _known[key] = _solved(scene)
    return _known[key]


def _solved(scene: Scene) -> tuple[State, ...]:
    """equations.md (E6), by Dormand and Prince's method of order 8."""
    from scipy.integrate import solve_ivp

    def slope(t: float, y: FloatArray) -> FloatArray:
        theta, omega = np.split(y, 2)
        return np.concatenate([omega, accelerations(scene, theta, omega, t)])

    times, y = np.arange(1, SAMPLES + 1) / SAMPLES, np.concatenate([scene.angles, scene.rates])
    found = solve_ivp(slope, (0.0, 1.0), y, method="DOP853", t_eval=times, rtol=1e-13, atol=1e-14).y.T
    return tuple(State(row[: scene.n], row[scene.n :]) for row in found)


@cache
def names_of_effects() -> tuple[str, ...]:
    """All effects there are, and rigid links."""
    from pendbench.effects import names
    from pendbench.scene.links import LINKS

    return (*names(), LINKS)
