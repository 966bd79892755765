"""The loop with error control, for embedded Runge-Kutta pairs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.compiled import compiled
from pendbench.solvers.explicit import stage_state
from pendbench.solvers.outcome import DONE, NOT_FINITE, TOO_MANY, TOO_SMALL, Progress
from pendbench.solvers.problem import derivative
from pendbench.solvers.tableaux import EmbeddedPair

#: A first step to try, s. Error control shrinks it where it is too large.
FIRST_STEP = 1e-3

#: The next step: so much of what error control would allow, and so many times the last one at most and at least.
SAFETY = 0.9
GROW_AT_MOST = 5.0
SHRINK_AT_MOST = 0.2

_EPS = 2.0**-52

# A step is not to be better than so many times what the last digits of its start make of it. Where nothing else was
# left (angles of a million turns), the errors of 1800 steps had 0.7 times that for their median and 5 for the worst.
_ROUNDINGS = 4.0


@compiled
def _scaled_error(method: EmbeddedPair, h: float, k: FloatArray, scale: FloatArray) -> float:
    """The largest component of the two error estimates, combined as in Hairer's DOP853, over what is allowed."""
    worst5, worst3 = 0.0, 0.0
    for i in range(len(scale)):
        e5, e3 = 0.0, 0.0
        for s in range(len(method.b)):
            e5 += method.error5[s] * k[s, i]
            e3 += method.error3[s] * k[s, i]
        worst5 = max(worst5, abs(e5 / scale[i]))
        worst3 = max(worst3, abs(e3 / scale[i]))
        if not (np.isfinite(e5) and np.isfinite(e3)):
            return np.inf
    if worst5 == 0.0:
        return 0.0
    return abs(h) * worst5 * worst5 / math.hypot(worst5, 0.1 * worst3)


@compiled
def _rounding_error(
    system: Any, t: float, h: float, y: FloatArray, k: FloatArray, scale: FloatArray, near: FloatArray, out: FloatArray
) -> float:
    """The scaled change of y within h (s) where its last digits are others; 0 where that is not finite.

    k (d,): the derivative at y. near and out (d,): room for the other state and its derivative. Neighbours in y, such
    as the angles of two rods, are moved apart: that changes most.
    """
    for i in range(len(y)):
        near[i] = y[i] + (_EPS if i % 2 else -_EPS) * abs(y[i])
    derivative(system, t, near, out)
    worst = 0.0
    for i in range(len(y)):
        size = abs(out[i] - k[i]) / scale[i]
        worst = worst if size <= worst else size  # nan is kept
    return abs(h) * worst if worst < np.inf else 0.0


@compiled
def _step_factor(error: float, order: int) -> float:
    """By how much the step may change after one with this scaled error."""
    if error == 0.0:
        return GROW_AT_MOST
    if not np.isfinite(error):
        return SHRINK_AT_MOST
    wanted: float = SAFETY * error ** (-1.0 / order)
    return min(GROW_AT_MOST, max(SHRINK_AT_MOST, wanted))


@compiled
def _add(y: FloatArray, carry: FloatArray, change: FloatArray) -> None:
    """Add `change` to y with the rounding errors kept in `carry` (compensated summation, Kahan 1965)."""
    for i in range(len(y)):
        small = change[i] + carry[i]
        total = y[i] + small
        carry[i] = small - (total - y[i])
        y[i] = total


@compiled
def integrate(
    system: Any,
    method: EmbeddedPair,
    t: float,
    end: float,
    h: float,
    y: FloatArray,
    carry: FloatArray,
    tolerance: float,
    relative: FloatArray,
    smallest: float,
    most_steps: int,
) -> Progress:
    """Advance y (d,), in place, from time t to exactly `end` with steps that keep the local error allowed.

    h: the first step to try (s). carry (d,): what rounding left out of y, kept between calls. relative (d,): the error
    allowed in y[i] is `tolerance (1 + relative[i] |y[i]|)`, or what the rounding of y makes of a step where that is
    more: that falls no faster than the step does, so shorter steps would add up to as much. Gives up where it needs a
    step below `smallest` (s) or below the rounding of t (only the last step, onto `end`, may be as short as it likes),
    after `most_steps` accepted or rejected, or at a state that is not finite.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.4 (step control) and II.10.
    """
    stages, d = len(method.b), len(y)
    k = np.empty((stages, d))
    inner, scale, change = np.empty(d), np.empty(d), np.empty(d)
    accepted, rejected = 0, 0
    grow = GROW_AT_MOST
    h = max(h, smallest)
    while t < end:
        if accepted + rejected >= most_steps:
            return Progress(TOO_MANY, t, h, accepted, rejected)
        left = end - t
        last = h >= left
        step = left if last else (0.5 * left if h > 0.5 * left else h)
        target = end if last else t + step
        step = target - t  # what rounding makes of it, so that time does not slip
        if not last and (h < smallest or t + 0.1 * h == t):
            return Progress(TOO_SMALL, t, h, accepted, rejected)
        for i in range(d):
            scale[i] = tolerance * (1.0 + relative[i] * abs(y[i]))
        for s in range(stages):
            stage_state(method.a, s, step, y, k, inner)
            derivative(system, t + method.c[s] * step, inner, k[s])
        if not np.all(np.isfinite(k[0])):
            return Progress(NOT_FINITE, t, h, accepted, rejected)
        error = _scaled_error(method, step, k, scale)
        if 1.0 < error < np.inf:
            rounding = _rounding_error(system, t, step, y, k[0], scale, inner, change)
            error /= max(1.0, _ROUNDINGS * rounding)
        factor = _step_factor(error, method.order)
        if error <= 1.0:
            change[:] = 0.0
            for s in range(stages):
                for i in range(d):
                    change[i] += step * method.b[s] * k[s, i]
            _add(y, carry, change)
            t = target
            accepted += 1
            # A step cut short to land on `end` says little about the next one.
            h = max(h, step * min(factor, grow)) if last else step * min(factor, grow)
            grow = GROW_AT_MOST
        else:
            rejected += 1
            grow = 1.0
            h = step * min(factor, 1.0)
    return Progress(DONE, t, h, accepted, rejected)
