"""The loop with error control, for embedded Runge-Kutta pairs."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined, part
from pendbench.solvers.compensated import Sum, add
from pendbench.solvers.control import (
    GROW_AT_MOST,
    Limits,
    allowed_after,
    allowed_instead,
    next_step,
    step_factor,
    too_short,
)
from pendbench.solvers.dop853 import EmbeddedPair
from pendbench.solvers.explicit import add_stages, stage_state
from pendbench.solvers.outcome import (
    DONE,
    NOT_FINITE,
    PAUSED,
    TOO_MANY,
    TOO_SMALL,
    Ended,
    Reached,
    run_in_parts,
    steps_at_once,
)
from pendbench.solvers.problem import derivative

_EPS = 2.0**-52

# A step is not to be better than so many times what the last digits of its start make of it. Where nothing else was
# left (angles of a million turns), the errors of 1800 steps had 0.7 times that for their median and 5 for the worst.
_ROUNDINGS = 4.0


class _Room(NamedTuple):
    """k (s, d): the stages' derivatives; fineness (d,): one over the error allowed; inner, change (d,): for a while."""

    k: FloatArray
    fineness: FloatArray
    inner: FloatArray
    change: FloatArray


@inlined
def _largest(values: FloatArray) -> float:
    """The largest of some numbers from 0 on, (n,), four at a time: none waits for the one before. nan counts as 0."""
    most0, most1, most2, most3 = 0.0, 0.0, 0.0, 0.0
    together = len(values) - len(values) % 4
    for i in range(0, together, 4):
        most0, most1 = max(most0, values[i]), max(most1, values[i + 1])
        most2, most3 = max(most2, values[i + 2]), max(most3, values[i + 3])
    for i in range(together, len(values)):
        most0 = max(most0, values[i])
    return max(most0, most1, most2, most3)


@part
def _scaled_error(method: EmbeddedPair, h: float, room: _Room) -> float:
    """The largest component of the two error estimates, combined as in Hairer's DOP853, over what is allowed."""
    e5, e3, unknown = room.inner, room.change, 0
    for i in range(len(e5)):
        e5[i], e3[i] = 0.0, 0.0
    add_stages(method.error5, len(method.b), 1.0, room.k, e5)
    add_stages(method.error3, len(method.b), 1.0, room.k, e3)
    for i in range(len(e5)):
        e5[i], e3[i] = abs(e5[i] * room.fineness[i]), abs(e3[i] * room.fineness[i])
        unknown += int(not e5[i] + e3[i] < np.inf)  # a count, since it lets the loop vectorise
    worst5, worst3 = _largest(e5), _largest(e3)
    if unknown:
        return np.inf
    if worst5 == 0.0:
        return 0.0
    return abs(h) * worst5 * worst5 / math.hypot(worst5, 0.1 * worst3)


@part
def _rounding_error(system: Any, t: float, h: float, y: FloatArray, room: _Room) -> float:
    """The scaled change of y within h (s) where its last digits are others; 0 where that is not finite.

    Neighbours in y, such as the angles of two rods, are moved apart: that changes most. Takes the derivative at y from
    `room.k[0]`.
    """
    near, out = room.inner, room.change
    for i in range(len(y)):
        near[i] = y[i] + (_EPS if i % 2 else -_EPS) * abs(y[i])
    derivative(system, t, near, out)
    worst = 0.0
    for i in range(len(y)):
        size = abs(out[i] - room.k[0, i]) * room.fineness[i]
        worst = size if size > worst or np.isnan(size) else worst  # nan is kept
    return abs(h) * worst if worst < np.inf else 0.0


@inlined
def _all_finite(values: FloatArray) -> bool:
    """As a loop: numba takes a second to compile `np.all(np.isfinite(values))`."""
    finite = True
    for i in range(len(values)):
        finite = finite and bool(np.isfinite(values[i]))
    return finite


@inlined
def _add_step(method: EmbeddedPair, h: float, y: Sum, room: _Room) -> None:
    change = room.change
    for i in range(len(change)):
        change[i] = 0.0
    add_stages(method.b, len(method.b), h, room.k, change)
    for i in range(len(change)):
        y.value[i], y.carry[i] = add(y.value[i], y.carry[i], change[i])


def integrate(system: Any, method: EmbeddedPair, limits: Limits, t: float, h: float, end: float, y: Sum) -> Reached:
    """Advance y, in place, from time t to exactly `end` (s) with steps that keep the local error allowed.

    h: the first step to try (s). limits.relative is (d,). Where what the rounding of y makes of a step is more than the
    error allowed, that is allowed: it falls no faster than the step does, so shorter steps would add up to as much.
    Gives up at its limits, below the rounding of t, or at a state that is not finite. Only the last step, onto `end`,
    may be as short as it likes.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.4 (step control) and II.10.
    """
    pause = steps_at_once(len(method.b) * len(y.value))
    tolerance, relative, smallest, most_steps = limits

    def loop(t: float, h: float, left: int) -> Ended:
        # A group costs Python a microsecond and more, so it passes numbers and arrays.
        return _integrate(system, method, t, h, end, tolerance, relative, smallest, left, *y, pause)

    return run_in_parts(loop, t, h, most_steps)


@compiled
def _integrate(
    system: Any,
    method: EmbeddedPair,
    t: float,
    h: float,
    end: float,
    tolerance: float,
    relative: FloatArray,
    smallest: float,
    most_steps: int,
    value: FloatArray,
    carry: FloatArray,
    pause: int,
) -> Ended:
    """The same, for `pause` accepted steps at most."""
    limits, y = Limits(tolerance, relative, smallest, most_steps), Sum(value, carry)
    stages, d = len(method.b), len(y.value)
    room = _Room(np.empty((stages, d)), np.empty(d), np.empty(d), np.empty(d))
    accepted, rejected, most = 0, 0, GROW_AT_MOST
    h = max(h, limits.smallest)
    while t < end:
        if accepted + rejected >= limits.most_steps:
            return TOO_MANY, t, h, accepted, rejected
        if accepted >= pause:  # never after a rejection, which the next step has to know of
            return PAUSED, t, h, accepted, rejected
        step = next_step(t, end, h)
        if not step.last and too_short(t, h, limits.smallest):
            return TOO_SMALL, t, h, accepted, rejected
        for i in range(d):
            room.fineness[i] = 1.0 / (limits.tolerance * (1.0 + limits.relative[i] * abs(y.value[i])))
        for s in range(stages):
            stage_state(method.a, s, step.length, y.value, room.k, room.inner)
            derivative(system, t + method.c[s] * step.length, room.inner, room.k[s])
        if not _all_finite(room.k[0]):
            return NOT_FINITE, t, h, accepted, rejected
        error = _scaled_error(method, step.length, room)
        if 1.0 < error < np.inf:
            error /= max(1.0, _ROUNDINGS * _rounding_error(system, t, step.length, y.value, room))
        factor = step_factor(error, method.order)
        if error <= 1.0:
            _add_step(method, step.length, y, room)
            accepted += 1
            t, h, most = step.target, allowed_after(h, step, min(factor, most)), GROW_AT_MOST
        else:
            rejected += 1
            h, most = allowed_instead(step, factor), 1.0
    return DONE, t, h, accepted, rejected
