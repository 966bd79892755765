"""Why an error does not fall as it should: whether states are of another time than they are said to be."""

from __future__ import annotations

from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.conformance.truth import SAMPLES, truth
from pendbench.engines.protocol import State
from pendbench.physics.dense import accelerations
from pendbench.physics.geometry import wrapped
from pendbench.scene.scene import Scene

# A delay has to explain all but so much of an error.
_LEFT: Final = 0.1
_NONE: Final = 0.02  # a delay of fewer steps is none


def delay(scene: Scene, dt: float, states: tuple[State, ...]) -> str | None:
    """By what delay states at the quarters of a second, with steps of dt s, differ from the truth; or None."""
    right = truth(scene)
    times = np.arange(1, SAMPLES + 1) / SAMPLES
    theta = np.array([wrapped(now.theta - then.theta) for now, then in zip(states, right, strict=True)])
    omega = np.array([now.omega - then.omega for now, then in zip(states, right, strict=True)])
    rates = np.array([state.omega for state in right])
    pulls = np.array([accelerations(scene, *state[:2], t) for state, t in zip(right, times, strict=True)])
    late = _steps_late(theta, rates, dt), _steps_late(omega, pulls, dt)
    if None not in late:
        angles, speeds = (0.0 if each is None else each for each in late)
        return _said(angles, speeds)
    running = _steps_late(np.hstack([theta, omega]), np.hstack([rates, pulls]) * times[:, None], dt)
    return None if running is None else f"its clock is slow: a second of it has {1.0 - running * dt:.6g} s"


def _said(angles: float, rates: float) -> str | None:
    angles, rates = (0.0 if abs(each) < _NONE else each for each in (angles, rates))
    if not angles and not rates:
        return None
    if abs(angles - rates) < 0.1:
        which = "too few" if angles > 0 else "too many"
        return f"{abs(angles):.2g} of a step {which}: angles and rates are of another time"
    parts = [
        f"{what} are {abs(by):.2g} of a step {'late' if by > 0 else 'early'}"
        for what, by in (("angles", angles), ("rates", rates))
        if by
    ]
    return " and ".join(parts)


def _steps_late(off: FloatArray, pace: FloatArray, dt: float) -> float | None:
    """The number s that makes -s dt pace of an error; None where none does. Both (k, m)."""
    size = float((pace * pace).sum())
    late = -float((off * pace).sum()) / size / dt if size else 0.0
    left = float(np.abs(off + late * dt * pace).max())
    whole = float(np.abs(off).max())
    return late if left <= _LEFT * whole or abs(late) < _NONE else None
