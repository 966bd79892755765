"""The chain's motion as a Taylor series in time, in O(n) for each order (docs/equations.md, (E32) to (E35)).

All series are built together, order by order: the term of order k of a product of two series is a convolution of the
lower orders with, at its ends, the two terms of order k itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.scene.scene import Scene
from pendbench.solvers.convolution import convolution, factors
from pendbench.solvers.trigonometry import direction, rounded_bend

# The products of each joint, left factor and right factor, a lane for each.
_JOINT_LANES = 12
_TURN_COSINE, _TURN_SINE, _SINE_SINE, _RATE_RATE, _COSINE_OWN, _OUTER_OWN = range(6)
_OUTER_PASSED, _OUTER_LOOSENESS, _PASSED_PULL, _SINE_FOLLOWING, _SINE_PULL = range(6, 11)
# Those of the pivot, where the first rod's angle takes the place of a bend, and of the tip.
_END_LANES = 4
_LOOSENESS_PULL, _TIP_RATE_RATE = 2, 3

#: Of chains of up to so many rods each number has kernels of its own, whose loops over the rods are written out: a step
#: takes 8 to 14 % less, and the first with another number waits for the compiler.
WRITTEN_OUT = 4

_joint_sums = convolution(_JOINT_LANES)
_end_sums = convolution(_END_LANES)


class SeriesSystem(NamedTuple):
    """A chain under gravity or free of it, with room for its series.

    lengths (n,) m and their inverses; ratios (n - 1,) of each mass to the next; gravity m/s^2. left and right (n - 1,
    orders, 12): the factors of each joint's products. sums (2 n - 2, 12): their convolutions, of an even order and then
    of the one after it. The same for both ends of the chain: (1, orders, 4) and (2, 4). few: a number for each of up to
    `WRITTEN_OUT` rods, so that how many there are is part of the type. One thread, one system.
    """

    lengths: FloatArray
    inverses: FloatArray
    ratios: FloatArray
    gravity: float
    left: FloatArray
    right: FloatArray
    sums: FloatArray
    end_left: FloatArray
    end_right: FloatArray
    end_sums: FloatArray
    few: tuple[int, ...]


def chain_series_of(scene: Scene, order: int) -> SeriesSystem:
    """The scene's chain under gravity or free of it, with room for series of that order."""
    masses, gravity = np.array(scene.masses), scene.effects.gravity
    joints = scene.n - 1
    return SeriesSystem(
        lengths=np.array(scene.lengths),
        inverses=1.0 / np.array(scene.lengths),
        ratios=masses[:-1] / masses[1:],
        gravity=0.0 if gravity is None else float(gravity),
        left=factors(joints, order, _JOINT_LANES),
        right=factors(joints, order, _JOINT_LANES),
        sums=factors(1, 2 * joints, _JOINT_LANES)[0],
        end_left=factors(1, order, _END_LANES),
        end_right=factors(1, order, _END_LANES),
        end_sums=np.zeros((2, _END_LANES)),
        few=(0,) * scene.n if scene.n <= WRITTEN_OUT else (),
    )


@inlined
def _tip(s: SeriesSystem) -> int:
    """The number of the last rod."""
    return len(s.few) - 1 if len(s.few) > 0 else len(s.lengths) - 1


@inlined
def _begin(s: SeriesSystem, theta: FloatArray, omega: FloatArray) -> float:
    """Order 0: write the angular accelerations into omega[1], and return 1 / looseness of the first rod."""
    tip = _tip(s)
    rate = omega[0, tip]
    s.end_left[0, 0, _TIP_RATE_RATE], s.end_right[0, 0, _TIP_RATE_RATE] = rate, rate
    looseness, motion = 1.0, s.lengths[tip] * rate * rate
    for i in range(tip - 1, -1, -1):
        bend, lost = rounded_bend(theta[i], theta[i + 1])
        c, sine = direction(bend)
        c, sine = c - sine * lost, sine + c * lost
        outer = s.ratios[i] * looseness
        near = 1.0 / (1.0 + outer)
        own, passed = motion * near, c * near
        looseness = (outer + sine * sine) * near
        rate = omega[0, i]
        motion = s.lengths[i] * rate * rate + c * own
        left, right = s.left[i, 0], s.right[i, 0]
        right[_TURN_COSINE], right[_TURN_SINE] = c, sine
        left[_SINE_SINE], left[_COSINE_OWN], left[_OUTER_OWN] = sine, c, near
        right[_OUTER_OWN], right[_OUTER_PASSED], right[_OUTER_LOOSENESS] = own, passed, looseness
        left[_PASSED_PULL] = passed
    c, sine = direction(theta[0])
    s.end_right[0, 0, _TURN_COSINE], s.end_right[0, 0, _TURN_SINE] = c, sine
    near = 1.0 / looseness
    pull = (motion + s.gravity * c) * near
    s.end_right[0, 0, _LOOSENESS_PULL] = pull
    start = s.gravity * sine
    for i in range(tip):
        left, right = s.left[i, 0], s.right[i, 0]
        following = right[_OUTER_OWN] + left[_PASSED_PULL] * pull
        omega[1, i] = (left[_SINE_SINE] * following - start) * s.inverses[i]
        right[_PASSED_PULL], right[_SINE_FOLLOWING] = pull, following
        start = left[_SINE_SINE] * pull
        pull = s.ratios[i] * following
    omega[1, tip] = -start * s.inverses[tip]
    return near


@inlined
def _inwards(s: SeriesSystem, k: int, omega: FloatArray) -> tuple[float, float]:
    """Order k of all that depends on the rods further out; returns that of looseness and motion of the first rod."""
    tip, inverse = _tip(s), 1.0 / k
    row = (k % 2) * tip
    rate = omega[k, tip]
    first = s.end_left[0, 0, _TIP_RATE_RATE]
    s.end_left[0, k, _TIP_RATE_RATE], s.end_right[0, k, _TIP_RATE_RATE] = rate, rate
    looseness, motion = 0.0, s.lengths[tip] * (2.0 * first * rate + s.end_sums[k % 2, _TIP_RATE_RATE])
    for i in range(tip - 1, -1, -1):
        left, right, sums = s.left[i, k], s.right[i, k], s.sums[row + i]
        left0, right0 = s.left[i, 0], s.right[i, 0]
        c0, sine0, near, own0 = right0[_TURN_COSINE], right0[_TURN_SINE], left0[_OUTER_OWN], right0[_OUTER_OWN]
        turn = omega[k - 1, i + 1] - omega[k - 1, i]
        c = -(sums[_TURN_SINE] + turn * sine0) * inverse
        sine = (sums[_TURN_COSINE] + turn * c0) * inverse
        outer = s.ratios[i] * looseness
        own = (motion - sums[_OUTER_OWN] - outer * own0) * near
        passed = (c - sums[_OUTER_PASSED] - outer * right0[_OUTER_PASSED]) * near
        squared = sums[_SINE_SINE] + 2.0 * sine0 * sine
        looseness = (outer + (squared - sums[_OUTER_LOOSENESS]) - outer * right0[_OUTER_LOOSENESS]) * near
        rate = omega[k, i]
        whirl = s.lengths[i] * (sums[_RATE_RATE] + 2.0 * omega[0, i] * rate)
        motion = (whirl + sums[_COSINE_OWN]) + c * own0 + c0 * own
        left[_TURN_COSINE], left[_TURN_SINE], right[_TURN_COSINE], right[_TURN_SINE] = turn, turn, c, sine
        left[_SINE_SINE], right[_SINE_SINE], left[_RATE_RATE], right[_RATE_RATE] = sine, sine, rate, rate
        left[_COSINE_OWN], right[_COSINE_OWN] = c, own
        left[_OUTER_OWN], left[_OUTER_PASSED], left[_OUTER_LOOSENESS] = outer, outer, outer
        right[_OUTER_OWN], right[_OUTER_PASSED], right[_OUTER_LOOSENESS] = own, passed, looseness
        left[_PASSED_PULL], left[_SINE_FOLLOWING], left[_SINE_PULL] = passed, sine, sine
    return looseness, motion


@inlined
def _outwards(s: SeriesSystem, k: int, pull: float, start: float, omega: FloatArray) -> None:
    """Carry order k of the first rod's pull to the tip, and write order k + 1 of the rates."""
    tip, inverse = _tip(s), 1.0 / (k + 1)
    row = (k % 2) * tip
    for i in range(tip):
        left, right, sums = s.left[i, k], s.right[i, k], s.sums[row + i]
        left0, right0 = s.left[i, 0], s.right[i, 0]
        passed, sine, sine0 = left[_PASSED_PULL], left[_SINE_FOLLOWING], right0[_TURN_SINE]
        own, pull0 = right[_OUTER_OWN], right0[_PASSED_PULL]
        following = (own + sums[_PASSED_PULL]) + passed * pull0 + left0[_PASSED_PULL] * pull
        across = (sums[_SINE_FOLLOWING] - start) + sine * right0[_SINE_FOLLOWING] + sine0 * following
        omega[k + 1, i] = across * (s.inverses[i] * inverse)
        right[_PASSED_PULL], right[_SINE_FOLLOWING], right[_SINE_PULL] = pull, following, pull
        start = sums[_SINE_PULL] + sine * pull0 + sine0 * pull
        pull = s.ratios[i] * following
    omega[k + 1, tip] = -start * (s.inverses[tip] * inverse)


@inlined
def write_rate_series(s: SeriesSystem, t: float, theta: FloatArray, omega: FloatArray) -> None:  # noqa: ARG001
    """From theta (n,) and omega[0] (n,), write the Taylor coefficients omega[1:] (order, n), rad/s^(k + 1).

    Source: docs/equations.md, (E32) to (E35).
    """
    near = _begin(s, theta, omega)
    end_left, end_right = s.end_left[0], s.end_right[0]
    for k in range(1, len(omega) - 1):
        tip = _tip(s)
        for i in range(tip):
            _joint_sums(s.left, s.right, i, k, s.sums, i, tip + i)
        _end_sums(s.end_left, s.end_right, 0, k, s.end_sums, 0, 1)
        looseness, motion = _inwards(s, k, omega)
        inverse, turn, sums = 1.0 / k, omega[k - 1, 0], s.end_sums[k % 2]
        c = -(sums[_TURN_SINE] + turn * end_right[0, _TURN_SINE]) * inverse
        sine = (sums[_TURN_COSINE] + turn * end_right[0, _TURN_COSINE]) * inverse
        known = sums[_LOOSENESS_PULL] + looseness * end_right[0, _LOOSENESS_PULL]
        pull = (motion + s.gravity * c - known) * near
        end_left[k, _TURN_COSINE], end_left[k, _TURN_SINE], end_left[k, _LOOSENESS_PULL] = turn, turn, looseness
        end_right[k, _TURN_COSINE], end_right[k, _TURN_SINE], end_right[k, _LOOSENESS_PULL] = c, sine, pull
        _outwards(s, k, pull, s.gravity * sine, omega)
