"""The motion of a single pendulum as a Taylor series in time: (E34) and no more, since nothing hangs on its rod.

`series` has the chains. Here an order is two sums, and what a chain needs besides would take most of the time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.scene.scene import Scene
from pendbench.solvers.trigonometry import direction


class SingleSystem(NamedTuple):
    """A pendulum with one rod, and room for its series.

    pull: -g/l, 1/s^2; cosine, sine (orders + 1,): the series of both; shares (orders + 1,): 1/k. One thread, one
    system.
    """

    pull: float
    cosine: FloatArray
    sine: FloatArray
    shares: FloatArray


def single_system_of(scene: Scene, order: int) -> SingleSystem:
    """The scene's pendulum under gravity or free of it, with room for series of that order."""
    pull = -(scene.effects.gravity or 0.0) / float(scene.lengths[0])
    shares = 1.0 / np.maximum(1.0, np.arange(order + 1.0))
    return SingleSystem(pull, np.zeros(order + 1), np.zeros(order + 1), shares)


@inlined
def write_rate_series(s: SingleSystem, t: float, theta: FloatArray, omega: FloatArray) -> None:  # noqa: ARG001
    """From theta (1,) and omega[0] (1,), write the Taylor coefficients omega[1:] (order, 1), rad/s^(k + 1).

    Source: docs/equations.md, (E34), and theta'' = -g/l sin(theta).
    """
    cosine, sine = s.cosine, s.sine
    cosine[0], sine[0] = direction(theta[0])
    omega[1, 0] = s.pull * sine[0]
    for k in range(1, len(omega) - 1):
        # What has only just been written comes last, and by itself: the other terms need not wait for it.
        c, turned = 0.0, 0.0
        for j in range(k - 1):
            c += omega[j, 0] * sine[k - 1 - j]
            turned += omega[j, 0] * cosine[k - 1 - j]
        cosine[k] = -(c + omega[k - 1, 0] * sine[0]) * s.shares[k]
        sine[k] = (turned + omega[k - 1, 0] * cosine[0]) * s.shares[k]
        omega[k + 1, 0] = s.pull * sine[k] * s.shares[k + 1]
