"""Taylor's method: the series of the motion itself, as far as the accuracy asks for, and as long as it holds.

There is no step to reject: the series says how far it holds before the step is taken. It holds at every moment on the
way too, so a state between two steps costs nothing but its evaluation, and asking for one changes no step.

Source: Jorba and Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods,
Experimental Mathematics 14 (2005), 99.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined
from pendbench.solvers.compensated import add
from pendbench.solvers.control import Limits, too_short
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
from pendbench.solvers.problem import rate_series
from pendbench.solvers.rough_logarithm import rough_log2

#: A series' step before the series is known: none yet.
NO_STEP = -1.0

# The last orders that say how far a series holds. In a motion that time reversal or a reflection leaves as it is, three
# of four orders in a row can be zero.
_LAST_ORDERS = 4

# log2 of the smallest number: a term of a motion so slow that it is 0 is below it.
_LEAST = -1074.0


class Series(NamedTuple):
    """A state and how it goes on.

    q (d,) and v[0] (d,): the state where the series begins; v (order + 1, d): the Taylor coefficients of the rates
    there; carry (2, d): what rounding left out of q and v[0].
    """

    q: FloatArray
    v: FloatArray
    carry: FloatArray


def series_from(q: FloatArray, v: FloatArray, order: int) -> Series:
    """The state q (d,), v (d,), copied, with room for a series of that order."""
    series = Series(q.copy(), np.zeros((order + 1, len(q))), np.zeros((2, len(q))))
    series.v[0] = v
    return series


def order_for(tolerance: float) -> int:
    """The order at which a step of this tolerance gets furthest for its work.

    Measured on chains of 1 to 50 links, from 1e-2 to 1e-10: 0.9 orders for each digit and 4 more. The theory, which
    counts the products and nothing else, has 1.15 for each digit and 1 more (Jorba and Zou, section 3).
    """
    return math.ceil(4.0 - 0.9 * math.log10(tolerance))


@inlined
def _moves(v: FloatArray) -> bool:
    """Whether any term of the series v (order + 1, d) changes the rates."""
    for k in range(1, len(v)):
        for i in range(v.shape[1]):
            if v[k, i] != 0.0:
                return True
    return False


@inlined
def _reach(v: FloatArray, allowed: float, relative: float, shares: FloatArray) -> float:
    """How long (s) the series v (order + 1, d) holds; nan where it is not finite, inf where nothing moves.

    allowed: log2 of the tolerance over the number of the first order left out; shares: 1 / (k + 1). Each of the last
    orders limits the step by what it adds to q and by what it adds to v. And terms have to fall: close to an
    equilibrium the last ones can be as small as you like while those that are left out are larger. A nan in one
    of the last orders makes it nan.
    """
    order = len(v) - 1
    most, late = -np.inf, 0.0
    for k in range(max(1, order - _LAST_ORDERS + 1), order + 1):
        worst_q, worst_v, unknown = 0.0, 0.0, 0
        for i in range(v.shape[1]):
            size = abs(v[k, i])
            scaled = size / (1.0 + relative * abs(v[0, i]))
            worst_v = worst_v if scaled <= worst_v else scaled
            worst_q = worst_q if size <= worst_q else size
            unknown += int(not scaled < np.inf)
        if unknown:
            return np.nan
        if worst_v > 0.0:
            most = max(most, rough_log2(worst_v) * shares[k - 1], rough_log2(worst_q * shares[k]) * shares[k])
        late += worst_q
    if late == 0.0:
        return float(2.0 ** (allowed - _LEAST * shares[order])) if _moves(v) else np.inf
    early = 0.0
    for k in range(max(0, order - 2 * _LAST_ORDERS + 1), order - _LAST_ORDERS + 1):
        for i in range(v.shape[1]):
            early = max(early, abs(v[k, i]))
    reach = float(2.0 ** (allowed - most))
    falls = 4.0 * reach * reach
    if late * falls * falls <= early or early == 0.0:
        return reach
    return 0.5 * math.sqrt(math.sqrt(early / late))


@inlined
def _shares(orders: int) -> FloatArray:
    shares = np.empty(orders)
    for k in range(orders):
        shares[k] = 1.0 / (k + 1)
    return shares


@inlined
def _changes(v: FloatArray, i: int, h: float, shares: FloatArray) -> tuple[float, float]:
    """What the series i adds to q and to v within h (s); shares are 1 / (k + 1), the factors of integration."""
    # Even and odd powers by themselves: while one waits for its product, the other goes on.
    square, highest = h * h, len(v) - 1
    q_even, q_odd, v_even, v_odd = 0.0, 0.0, 0.0, 0.0
    if highest % 2 == 1:
        q_even, v_even = v[highest, i] * shares[highest], v[highest, i]
        highest -= 1
    for k in range(highest, 0, -2):
        q_odd, q_even = q_odd * square + v[k, i] * shares[k], q_even * square + v[k - 1, i] * shares[k - 1]
        v_odd, v_even = v_odd * square + v[k, i], v_even * square + v[k - 1, i]
    return ((q_odd * h + q_even) * h + v[0, i]) * h, (v_odd * h + v_even) * h


def integrate(system: Any, limits: Limits, t: float, h: float, end: float, series: Series) -> Reached:
    """Take steps until the series that begins at the time reached holds up to `end` (s).

    t and h: where the last series began and how long it holds; h is `NO_STEP` before the first. The series is changed
    in place. The local error allowed is `tolerance` in q and `tolerance (1 + relative |v|)` in v, where
    `limits.relative` is one number. Gives up where a series holds for less than the smallest step or than the rounding
    of t, after `most_steps` series, or at one that is not finite. `state_at` gives the state at `end`.
    """
    pause = steps_at_once(len(series.v) ** 2 * len(series.q))
    tolerance, relative, smallest, most_steps = limits

    def loop(t: float, h: float, left: int) -> Ended:
        # A group costs Python a microsecond and more, so it passes numbers and arrays.
        return _integrate(system, t, h, end, tolerance, relative, smallest, left, *series, pause)

    return run_in_parts(loop, t, h, most_steps)


@compiled
def _integrate(
    system: Any,
    t: float,
    h: float,
    end: float,
    tolerance: float,
    relative: float,
    smallest: float,
    most_steps: int,
    q: FloatArray,
    v: FloatArray,
    carry: FloatArray,
    pause: int,
) -> Ended:
    """The same, for `pause` series at most."""
    shares = _shares(len(v))
    allowed = math.log2(tolerance) / len(v)
    taken = 0
    while True:
        if h == NO_STEP:
            if taken >= most_steps:
                return TOO_MANY, t, h, taken, 0
            if taken >= pause:
                return PAUSED, t, h, taken, 0
            rate_series(system, t, q, v)
            taken += 1
            h = _reach(v, allowed, relative, shares)
        if not h >= 0.0:
            return NOT_FINITE, t, h, taken, 0
        if t + h >= end:
            return DONE, t, h, taken, 0
        if too_short(t, h, smallest):
            return TOO_SMALL, t, h, taken, 0
        target = t + h
        step = target - t  # what rounding makes of it, so that time does not slip
        for i in range(len(q)):
            q_change, v_change = _changes(v, i, step, shares)
            q[i], carry[0, i] = add(q[i], carry[0, i], q_change)
            v[0, i], carry[1, i] = add(v[0, i], carry[1, i], v_change)
        t, h = target, NO_STEP


def state_at(h: float, series: Series, q_then: FloatArray, v_then: FloatArray) -> None:
    """Write the state h (s) after the series began into q_then (d,), v_then (d,)."""
    _state_at(h, *series, q_then, v_then)


@compiled
def _state_at(
    h: float, q: FloatArray, v: FloatArray, carry: FloatArray, q_then: FloatArray, v_then: FloatArray
) -> None:
    shares = _shares(len(v))
    for i in range(len(q)):
        q_change, v_change = _changes(v, i, h, shares)
        q_then[i] = q[i] + (q_change + carry[0, i])
        v_then[i] = v[0, i] + (v_change + carry[1, i])
