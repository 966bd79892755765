"""The loop with error control for many runs side by side, each with its own steps.

Runs share nothing but the instructions: a lane takes a step of its own length, keeps or rejects it by itself, and when
its run is done it takes up the next one, so all lanes stay at work until none is left. The steps are those that
`adaptive.integrate` takes for one run, but for rounding, and but for runs whose angles are so many turns that their
last digits decide the error: `integrate` knows that, and here such a run ends where its steps become too small.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.compiled import compiled_for_threads, inlined
from pendbench.solvers.adaptive import FIRST_STEP, GROW_AT_MOST, SAFETY, SHRINK_AT_MOST
from pendbench.solvers.copying import copy
from pendbench.solvers.explicit import add_stages
from pendbench.solvers.outcome import CROSSED, DONE, NOT_FINITE, TOO_MANY, TOO_SMALL
from pendbench.solvers.problem import derivatives_of_many
from pendbench.solvers.tableaux import EmbeddedPair, Tableau

# The rows of what each lane knows of its time.
_T, _H, _STEP, _GROW = range(4)
# And of its work: which run it is at, which time comes next, how many steps it has taken.
_RUN, _NEXT, _TAKEN = range(3)
_IDLE = -1
# Of an interval that holds a crossing: to its rounding.
_HALVINGS = 50


class _Lanes(NamedTuple):
    """y and carry (d, lanes): the states, and what rounding left out of them. clock (4, lanes), work (3, lanes)."""

    y: FloatArray
    carry: FloatArray
    clock: FloatArray
    work: Any


class _Runs(NamedTuple):
    """What is to be run, and where it is written down: as in `integrate_many`."""

    starts: FloatArray
    times: FloatArray
    out: FloatArray
    outcomes: Any
    stopped: FloatArray


@inlined
def _clear(values: FloatArray) -> None:
    for i in range(len(values)):
        values[i] = 0.0


@inlined
def _times_step(slopes: FloatArray, step: FloatArray) -> None:
    """Multiply (d, lanes) by each lane's step: what is left of the method is the same for all lanes."""
    for i in range(slopes.shape[0]):
        for b in range(slopes.shape[1]):
            slopes[i, b] *= step[b]


@inlined
def _write_worst(part: FloatArray, y: FloatArray, relative: FloatArray, tolerance: float, out: FloatArray) -> None:
    """Write the largest of each lane's errors (d, lanes), each over what is allowed, into out (lanes,)."""
    _clear(out)
    for i in range(part.shape[0]):
        share = relative[i]
        for b in range(part.shape[1]):
            size = abs(part[i, b]) / (tolerance * (1.0 + share * abs(y[i, b])))
            out[b] = size if size > out[b] or np.isnan(size) else out[b]  # nan is kept


@inlined
def _combine(worst5: FloatArray, worst3: FloatArray) -> None:
    """Leave the two estimates, combined as in Hairer's DOP853, in the first."""
    for b in range(len(worst5)):
        together = np.sqrt(worst5[b] * worst5[b] + 0.01 * worst3[b] * worst3[b])
        worst5[b] = worst5[b] * worst5[b] / together if together > 0.0 else together


@inlined
def _factors(errors: FloatArray, out: FloatArray) -> None:
    """By how much each step may change: the eighth root, which vectorises as three square roots."""
    for b in range(len(out)):
        wanted = SAFETY / np.sqrt(np.sqrt(np.sqrt(errors[b])))
        wanted = GROW_AT_MOST if wanted > GROW_AT_MOST else wanted
        out[b] = wanted if wanted > SHRINK_AT_MOST else SHRINK_AT_MOST  # nan shrinks


@inlined
def _propose_all(lanes: _Lanes, times: FloatArray) -> bool:
    """The next step of every lane, none for an idle one; whether any is at work."""
    busy = False
    for b in range(lanes.clock.shape[1]):
        lanes.clock[_STEP, b] = 0.0
        if lanes.work[_RUN, b] != _IDLE:
            busy = True
            _propose(lanes.clock, b, times[lanes.work[_NEXT, b]])
    return busy


@inlined
def _propose(clock: FloatArray, b: int, end: float) -> None:
    """The next step of a lane, whose length is such that time does not slip: as in `adaptive.integrate`."""
    t, h = clock[_T, b], clock[_H, b]
    left = end - t
    if h < left:
        target = t + (0.5 * left if h > 0.5 * left else h)
        clock[_STEP, b] = target - t
    else:
        clock[_STEP, b] = left


@compiled_for_threads
def integrate_many(
    system: Any,
    method: EmbeddedPair,
    starts: FloatArray,
    times: FloatArray,
    tolerance: float,
    relative: FloatArray,
    smallest: float,
    most_steps: int,
    lanes: int,
    out: FloatArray,
    outcomes: Any,
    stopped: FloatArray,
    limit: float,
) -> None:
    """Run from each of `starts` (K, d) at time 0 and write its states at `times` (m,) s, rising, into out (m, K, d).

    outcomes (K,), integers: how each run ended; one that gave up leaves nan where it has no states. stopped (K,): the
    time it reached, s. A run that passes `limit` in one of the first d / 2 components of its state is over: its outcome
    is CROSSED, and stopped the time of the crossing, from the cubic through the states at both ends of the step, which
    is also what says that a run passed the limit and came back within one step. The other arguments are those of
    `adaptive.integrate`; method must be of order 8. The system has room for `lanes`.
    """
    d, stages = starts.shape[1], len(method.b)
    y, inner, slopes = np.zeros((d, lanes)), np.zeros((d, lanes)), np.zeros((stages, d, lanes))
    before, factor, room = np.zeros((d, lanes)), np.zeros(lanes), np.zeros((2, lanes))
    # The same memory flat, for what does not care which number is whose.
    flat_y, flat_inner, flat_slopes = y.reshape(-1), inner.reshape(-1), slopes.reshape(stages, -1)
    all_lanes = _Lanes(y, np.zeros((d, lanes)), np.zeros((4, lanes)), np.full((3, lanes), _IDLE))
    runs = _Runs(starts, times, out, outcomes, stopped)
    step, error = all_lanes.clock[_STEP], room[0]
    waiting = 0
    for b in range(lanes):
        waiting = _take_up(b, waiting, all_lanes, runs)
    while _propose_all(all_lanes, times):
        for s in range(stages):
            copy(flat_y, flat_inner)
            add_stages(method.a[s], s, 1.0, flat_slopes, flat_inner)
            derivatives_of_many(system, inner, slopes[s])
            _times_step(slopes[s], step)
        for weights, worst in ((method.error5, error), (method.error3, room[1])):
            _clear(flat_inner)
            add_stages(weights, stages, 1.0, flat_slopes, flat_inner)
            _write_worst(inner, y, relative, tolerance, worst)
        _combine(error, room[1])
        _factors(error, factor)
        _clear(flat_inner)
        add_stages(method.b, stages, 1.0, flat_slopes, flat_inner)
        _advance_all(all_lanes, inner, error, before)
        for b in range(lanes):
            if all_lanes.work[_RUN, b] != _IDLE:
                how = _judge(b, error[b], factor[b], times, smallest, most_steps, all_lanes)
                if limit < np.inf and error[b] <= 1.0:
                    _look_for_crossing(b, before, all_lanes, limit, runs)
                    if outcomes[all_lanes.work[_RUN, b]] == CROSSED:
                        waiting = _take_up(b, waiting, all_lanes, runs)
                        continue
                waiting = _settle(b, how, waiting, all_lanes, runs)


@inlined
def _advance_all(lanes: _Lanes, change: FloatArray, error: FloatArray, before: FloatArray) -> None:
    """Add the change (d, lanes) to the state of each lane whose error allows it; keep what it was in `before`."""
    y, carry = lanes.y, lanes.carry
    for i in range(y.shape[0]):
        for b in range(y.shape[1]):
            small = change[i, b] + carry[i, b] if error[b] <= 1.0 else 0.0
            before[i, b] = y[i, b]
            total = y[i, b] + small
            carry[i, b] = small - (total - y[i, b]) if error[b] <= 1.0 else carry[i, b]
            y[i, b] = total


@inlined
def _judge(
    b: int, error: float, factor: float, times: FloatArray, smallest: float, most_steps: int, lanes: _Lanes
) -> int:
    """Move a lane's clock on, or shrink its step; and whether it has to give up: DONE where not."""
    clock, work = lanes.clock, lanes.work
    end, t, h, step = times[work[_NEXT, b]], clock[_T, b], clock[_H, b], clock[_STEP, b]
    last = h >= end - t
    work[_TAKEN, b] += 1
    if error <= 1.0:
        clock[_T, b] = end if last else t + step
        grown = step * min(factor, clock[_GROW, b])
        clock[_H, b] = max(h, grown) if last else grown
        clock[_GROW, b] = GROW_AT_MOST
    else:
        clock[_GROW, b] = 1.0
        clock[_H, b] = step * min(factor, 1.0)
        if not np.isfinite(error) and work[_TAKEN, b] > 1 and clock[_H, b] < smallest:
            return NOT_FINITE
        if clock[_H, b] < smallest or t + 0.1 * clock[_H, b] == t:
            return TOO_SMALL
    return DONE if work[_TAKEN, b] < most_steps else TOO_MANY


@inlined
def _look_for_crossing(b: int, before: FloatArray, lanes: _Lanes, limit: float, runs: _Runs) -> None:
    """Where the step of a lane took it past the limit, be it for a moment, write down when."""
    y = lanes.y
    angles, step, earliest = y.shape[0] // 2, lanes.clock[_STEP, b], np.inf
    for i in range(angles):
        q0, v0, q1, v1 = before[i, b], step * before[angles + i, b], y[i, b], step * y[angles + i, b]
        # The cubic stays within the hull of its control points, q0 + v0 / 3 and q1 - v1 / 3 being the inner ones.
        if max(abs(q1), abs(q0 + v0 / 3.0), abs(q1 - v1 / 3.0)) > limit:
            earliest = min(earliest, _first_crossing(q0, v0, q1, v1, limit))
    if earliest < np.inf:
        run = lanes.work[_RUN, b]
        runs.outcomes[run] = CROSSED
        runs.stopped[run] = lanes.clock[_T, b] - (1.0 - earliest) * step


@compiled_for_threads
def _first_crossing(q0: float, v0: float, q1: float, v1: float, limit: float) -> float:
    """Where, from 0 to 1, the cubic with values q and slopes v at its ends passes +-limit; inf where it does not.

    q0 is within the limit. Where q1 is too, the cubic may turn back beyond it: where its slope, of one sign before and
    of the other after, is 0. A cubic that turns twice within the step is not followed: steps are too short for that.
    """
    turn = 1.0
    if abs(q1) <= limit:
        if v0 * v1 >= 0.0:
            return np.inf
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            turn = 0.5 * (low + high)
            low, high = (turn, high) if _slope(q0, v0, q1, v1, turn) * v0 > 0.0 else (low, turn)
    furthest = _cubic(q0, v0, q1, v1, turn)
    if abs(furthest) <= limit:
        return np.inf
    side = 1.0 if furthest > 0.0 else -1.0
    low, high = 0.0, turn
    for _ in range(_HALVINGS):
        s = 0.5 * (low + high)
        low, high = (low, s) if side * _cubic(q0, v0, q1, v1, s) > limit else (s, high)
    return high


@inlined
def _cubic(q0: float, v0: float, q1: float, v1: float, s: float) -> float:
    """Hermite's cubic at s, from 0 to 1."""
    r = 1.0 - s
    return r * r * (1.0 + 2.0 * s) * q0 + s * s * (3.0 - 2.0 * s) * q1 + s * r * (r * v0 - s * v1)


@inlined
def _slope(q0: float, v0: float, q1: float, v1: float, s: float) -> float:
    """The slope of that cubic."""
    r = 1.0 - s
    return 6.0 * s * r * (q1 - q0) + r * (1.0 - 3.0 * s) * v0 + s * (3.0 * s - 2.0) * v1


@inlined
def _settle(b: int, how: int, waiting: int, lanes: _Lanes, runs: _Runs) -> int:
    """Write down the states that a lane has reached; where its run is over, give it the next one."""
    work, times = lanes.work, runs.times
    run = work[_RUN, b]
    runs.stopped[run] = lanes.clock[_T, b]
    if lanes.clock[_T, b] == times[work[_NEXT, b]]:
        for i in range(len(lanes.y)):
            runs.out[work[_NEXT, b], run, i] = lanes.y[i, b]
        work[_NEXT, b] += 1
        if work[_NEXT, b] == len(times):
            runs.outcomes[run] = DONE
            return _take_up(b, waiting, lanes, runs)
    if how != DONE:
        runs.outcomes[run] = how
        return _take_up(b, waiting, lanes, runs)
    return waiting


@compiled_for_threads
def _take_up(b: int, waiting: int, lanes: _Lanes, runs: _Runs) -> int:
    """Give a lane the next run that waits, and return which one waits then; without one the lane is idle."""
    clock, work, times = lanes.clock, lanes.work, runs.times
    work[_RUN, b] = _IDLE
    while waiting < len(runs.starts):
        run = waiting
        waiting += 1
        for i in range(len(lanes.y)):
            lanes.y[i, b], lanes.carry[i, b] = runs.starts[run, i], 0.0
        clock[_T, b], clock[_H, b], clock[_GROW, b] = 0.0, FIRST_STEP, GROW_AT_MOST
        first = 0
        if times[0] == 0.0:
            for i in range(len(lanes.y)):
                runs.out[0, run, i] = runs.starts[run, i]
            first = 1
        work[_NEXT, b], work[_TAKEN, b] = first, 0
        runs.outcomes[run], runs.stopped[run] = DONE, 0.0
        if first < len(times):
            work[_RUN, b] = run
            return waiting
    return waiting


@compiled_for_threads
def runge_kutta_many(
    system: Any, method: Tableau, starts: FloatArray, counts: Any, dt: float, lanes: int, out: FloatArray
) -> None:
    """Run from each of `starts` (K, d) with steps of dt (s), and write the states into out (m, K, d).

    counts (m,), rising: after how many steps. The system has room for `lanes` states.
    """
    runs, d = starts.shape
    stages = len(method.b)
    y, inner, slopes = np.zeros((d, lanes)), np.zeros((d, lanes)), np.zeros((stages, d, lanes))
    flat_y, flat_inner, flat_slopes = y.reshape(-1), inner.reshape(-1), slopes.reshape(stages, -1)
    for first in range(0, runs, lanes):
        for b in range(lanes):
            for i in range(d):
                y[i, b] = starts[min(first + b, runs - 1), i]
        taken = 0
        for at in range(len(counts)):
            for _ in range(counts[at] - taken):
                for s in range(stages):
                    copy(flat_y, flat_inner)
                    add_stages(method.a[s], s, dt, flat_slopes, flat_inner)
                    derivatives_of_many(system, inner, slopes[s])
                add_stages(method.b, stages, dt, flat_slopes, flat_y)
            taken = counts[at]
            for b in range(min(lanes, runs - first)):
                for i in range(d):
                    out[at, first + b, i] = y[i, b]
