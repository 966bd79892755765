"""The loop with error control for many runs side by side, each with its own steps.

Runs share nothing but the instructions: a lane takes a step of its own length, keeps or rejects it by itself, and when
its run is done it takes up the next one, so all lanes stay at work until none is left. The steps are those that
`adaptive.integrate` takes for one run, but for rounding, and but for runs whose angles are so many turns that their
last digits decide the error: `integrate` knows that, and here such a run ends where its steps become too small.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled_for_threads, inlined
from pendbench.solvers.compensated import add
from pendbench.solvers.control import (
    FIRST_STEP,
    GROW_AT_MOST,
    SAFETY,
    SHRINK_AT_MOST,
    Limits,
    allowed_after,
    allowed_instead,
    next_step,
    too_short,
)
from pendbench.solvers.copying import copy
from pendbench.solvers.crossing import first_crossing
from pendbench.solvers.dop853 import EmbeddedPair
from pendbench.solvers.explicit import Tableau, add_stages
from pendbench.solvers.outcome import CROSSED, DONE, NOT_FINITE, TOO_MANY, TOO_SMALL
from pendbench.solvers.problem import ensemble_derivatives

# The rows of what each lane knows of its time.
_T, _H, _STEP, _GROW = range(4)
# And of its work: which run it is at, which time comes next, how many steps it has taken.
_RUN, _NEXT, _TAKEN = range(3)
_IDLE = -1


class _Lanes(NamedTuple):
    """y and carry (d, lanes): the states, and what rounding left out of them. clock (4, lanes), work (3, lanes)."""

    y: FloatArray
    carry: FloatArray
    clock: FloatArray
    work: Any


class Runs(NamedTuple):
    """What is to be run, and where it is written down.

    starts (K, d) at time 0; times (m,) s, rising; out (m, K, d): the states at those times, nan where a run ended
    before. outcomes (K,), integers: how each run ended; stopped (K,): the time it reached, s.
    """

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
def _write_worst(part: FloatArray, y: FloatArray, limits: Limits, out: FloatArray) -> None:
    """Write the largest of each lane's errors (d, lanes), each over what is allowed, into out (lanes,)."""
    tolerance = limits.tolerance
    _clear(out)
    for i in range(part.shape[0]):
        share = limits.relative[i]
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
def _propose(lanes: _Lanes, times: FloatArray) -> bool:
    """The next step of every lane, none for an idle one; whether any is at work."""
    busy, clock = False, lanes.clock
    for b in range(clock.shape[1]):
        clock[_STEP, b] = 0.0
        if lanes.work[_RUN, b] != _IDLE:
            busy = True
            clock[_STEP, b] = next_step(clock[_T, b], times[lanes.work[_NEXT, b]], clock[_H, b]).length
    return busy


@compiled_for_threads
def integrate_ensemble(
    system: Any,
    method: EmbeddedPair,
    limits: Limits,
    runs: Runs,
    lanes: int,
    border: float,
    halt: Any,
) -> None:
    """Run from each of the starts, as `adaptive.integrate` does for one, and write down the states and how it ended.

    A run that passes `border` in one of the first d / 2 components of its state is over: its outcome is CROSSED, and
    stopped the time of the crossing, from the cubic through the states at both ends of the step, which is also what
    says that a run passed the border and came back within one step. method must be of order 8. halt (1,), an integer:
    where another thread makes it other than 0, all is left as it is. The system has room for `lanes`.
    """
    d, stages, times = runs.starts.shape[1], len(method.b), runs.times
    y, inner, slopes = np.zeros((d, lanes)), np.zeros((d, lanes)), np.zeros((stages, d, lanes))
    before, factor, room = np.zeros((d, lanes)), np.zeros(lanes), np.zeros((2, lanes))
    # The same memory flat, for what does not care which number is whose.
    flat_y, flat_inner, flat_slopes = y.reshape(-1), inner.reshape(-1), slopes.reshape(stages, -1)
    all_lanes = _Lanes(y, np.zeros((d, lanes)), np.zeros((4, lanes)), np.full((3, lanes), _IDLE))
    step, error = all_lanes.clock[_STEP], room[0]
    waiting = 0
    for b in range(lanes):
        waiting = _take_up(b, waiting, all_lanes, runs)
    while halt[0] == 0 and _propose(all_lanes, times):
        for s in range(stages):
            copy(flat_y, flat_inner)
            add_stages(method.a[s], s, 1.0, flat_slopes, flat_inner)
            ensemble_derivatives(system, inner, slopes[s])
            _times_step(slopes[s], step)
        for weights, worst in ((method.error5, error), (method.error3, room[1])):
            _clear(flat_inner)
            add_stages(weights, stages, 1.0, flat_slopes, flat_inner)
            _write_worst(inner, y, limits, worst)
        _combine(error, room[1])
        _factors(error, factor)
        _clear(flat_inner)
        add_stages(method.b, stages, 1.0, flat_slopes, flat_inner)
        _advance_all(all_lanes, inner, error, before)
        for b in range(lanes):
            if all_lanes.work[_RUN, b] != _IDLE:
                how = _judge(b, error[b], factor[b], all_lanes, runs, limits)
                if border < np.inf and error[b] <= 1.0:
                    _look_for_crossing(b, before, all_lanes, runs, border)
                    if runs.outcomes[all_lanes.work[_RUN, b]] == CROSSED:
                        waiting = _take_up(b, waiting, all_lanes, runs)
                        continue
                waiting = _settle(b, how, waiting, all_lanes, runs)


@inlined
def _advance_all(lanes: _Lanes, change: FloatArray, error: FloatArray, before: FloatArray) -> None:
    """Add the change (d, lanes) to the state of each lane whose error allows it; keep what it was in `before`."""
    y, carry = lanes.y, lanes.carry
    for i in range(y.shape[0]):
        for b in range(y.shape[1]):
            before[i, b] = y[i, b]
            total, rest = add(y[i, b], carry[i, b], change[i, b])
            carry[i, b] = rest if error[b] <= 1.0 else carry[i, b]
            y[i, b] = total if error[b] <= 1.0 else y[i, b]


@inlined
def _judge(b: int, error: float, factor: float, lanes: _Lanes, runs: Runs, limits: Limits) -> int:
    """Move a lane's clock on, or shrink its step; and whether it has to give up: DONE where not."""
    clock, work = lanes.clock, lanes.work
    end, t, h = runs.times[work[_NEXT, b]], clock[_T, b], clock[_H, b]
    step = next_step(t, end, h)
    work[_TAKEN, b] += 1
    if error <= 1.0:
        clock[_T, b] = end if step.last else t + step.length
        clock[_H, b] = allowed_after(h, step, min(factor, clock[_GROW, b]))
        clock[_GROW, b] = GROW_AT_MOST
    else:
        clock[_GROW, b] = 1.0
        clock[_H, b] = allowed_instead(step, factor)
        if not np.isfinite(error) and work[_TAKEN, b] > 1 and clock[_H, b] < limits.smallest:
            return NOT_FINITE
        if too_short(t, clock[_H, b], limits.smallest):
            return TOO_SMALL
    return DONE if work[_TAKEN, b] < limits.most_steps else TOO_MANY


@inlined
def _look_for_crossing(b: int, before: FloatArray, lanes: _Lanes, runs: Runs, border: float) -> None:
    """Where the step of a lane took it past the border, be it for a moment, write down when."""
    y = lanes.y
    angles, step, earliest = y.shape[0] // 2, lanes.clock[_STEP, b], np.inf
    for i in range(angles):
        q0, v0, q1, v1 = before[i, b], step * before[angles + i, b], y[i, b], step * y[angles + i, b]
        # The cubic stays within the hull of its control points, q0 + v0 / 3 and q1 - v1 / 3 being the inner ones.
        if max(abs(q1), abs(q0 + v0 / 3.0), abs(q1 - v1 / 3.0)) > border:
            earliest = min(earliest, first_crossing(q0, v0, q1, v1, border))
    if earliest < np.inf:
        run = lanes.work[_RUN, b]
        runs.outcomes[run] = CROSSED
        runs.stopped[run] = lanes.clock[_T, b] - (1.0 - earliest) * step


@inlined
def _settle(b: int, how: int, waiting: int, lanes: _Lanes, runs: Runs) -> int:
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
def _take_up(b: int, waiting: int, lanes: _Lanes, runs: Runs) -> int:
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
def runge_kutta_ensemble(
    system: Any, method: Tableau, starts: FloatArray, counts: Any, dt: float, lanes: int, out: FloatArray, halt: Any
) -> None:
    """Run from each of `starts` (K, d) with steps of dt (s), and write the states into out (m, K, d).

    counts (m,), rising: after how many steps. halt (1,) ends it as in `integrate_ensemble`. The system has room for
    `lanes` states.
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
                if halt[0] != 0:
                    return
                for s in range(stages):
                    copy(flat_y, flat_inner)
                    add_stages(method.a[s], s, dt, flat_slopes, flat_inner)
                    ensemble_derivatives(system, inner, slopes[s])
                add_stages(method.b, stages, dt, flat_slopes, flat_y)
            taken = counts[at]
            for b in range(min(lanes, runs - first)):
                for i in range(d):
                    out[at, first + b, i] = y[i, b]
