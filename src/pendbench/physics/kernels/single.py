"""The motion of a single pendulum as a Taylor series in time: `series` has the chains.

Nothing hangs on its rod, so two products are left, (E69), and an order waits for the one before the last only.
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

    pull: -g/l, 1/s^2; stiffness (orders + 1,): the series of -g/l cos(theta); shares (orders + 1,): 1/k, 1 for 0. One
    thread, one system.
    """

    pull: float
    stiffness: FloatArray
    shares: FloatArray


def single_system_of(scene: Scene, order: int) -> SingleSystem:
    """The scene's pendulum under gravity or free of it, with room for series of that order."""
    pull = -(scene.effects.gravity or 0.0) / float(scene.lengths[0])
    return SingleSystem(pull, np.zeros(order + 1), 1.0 / np.maximum(1.0, np.arange(order + 1.0)))


@inlined
def write_rate_series(s: SingleSystem, t: float, theta: FloatArray, omega: FloatArray) -> None:  # noqa: ARG001
    """From theta (1,) and omega[0] (1,), write the Taylor coefficients omega[1:] (order, 1), rad/s^(k + 1).

    Source: docs/equations.md, (E69).
    """
    stiffness, shares = s.stiffness, s.shares
    c, sine = direction(theta[0])
    stiffness[0], omega[1, 0] = s.pull * c, s.pull * sine
    for k in range(len(omega) - 2):
        if k > 0:
            square = 0.0  # half of it: each product is there twice, but for that of the middle
            for j in range((k + 1) // 2):
                square += omega[j, 0] * omega[k - j, 0]
            middle = omega[k // 2, 0] if k % 2 == 0 else 0.0
            stiffness[k] = -(square + 0.5 * middle * middle)
        even, odd, pairs = 0.0, 0.0, (k + 1) // 2
        for j in range(0, 2 * pairs, 2):
            even += stiffness[j] * omega[k - j, 0]
            odd += stiffness[j + 1] * omega[k - j - 1, 0]
        for j in range(2 * pairs, k + 1):
            even += stiffness[j] * omega[k - j, 0]
        omega[k + 2, 0] = (even + odd) * shares[k + 1] * shares[k + 2]
