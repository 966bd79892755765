"""RATTLE with steps that follow how fast the rods turn, on the way back as on the way there: of order 2, O(n) a step.

A step of h s turns rod i by phi_i, the chord of it over its length, and is as long as

    1 / h^2 = 1 / b^2 + (phi / (a h))^2          phi^8 = sum_i phi_i^8

asks: the longest step b where rods rest, and a turn of a rad where they turn fast. phi_i are the turns of that very
step, so that the way back asks for the same steps, up to what one round leaves: h is found once, with the multipliers
that close the step. A step that follows the one before it is long where an error in energy is made and short where it
would be taken back; each crack of a whip then costs energy, as it does where steps are halved and doubled (`rattle`).

Eighth powers, since the largest of the turns itself has a kink wherever another rod becomes the fastest.

Tensions without turns, as in a rope that hangs at rest, ask for short steps as well. So b is the step that was asked
for, cut into two, four, eight parts where it decides and h W is too large, with the bound W of `frame`, or no step
closes; and, as there, not joined again. Where turns decide and a step fails, it alone is begun again with half of what
was tried.

Where the motion is asked for between two steps, a step aside is taken from the one before. The run itself goes on as if
nobody had looked.

Sources: Huang, Leimkuhler, SIAM J. Sci. Comput. 18 (1997), 239; Hairer, Lubich, Wanner, Geometric Numerical
Integration, VIII.3.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined
from pendbench.solvers import rattle
from pendbench.solvers.closing import Chain
from pendbench.solvers.copying import copy_rows
from pendbench.solvers.methods import FixedStep, Form, add
from pendbench.solvers.multipliers import (
    CLOSE,
    MOST_ITERATIONS,
    Rows,
    closes,
    correct,
    eliminate,
    prepare_rows,
    pulls,
    pulls_within,
    rows_of,
    turns_within,
    write_new_rods,
)
from pendbench.solvers.rattle import FINEST, accept

TURN = 0.2  #: by how much a step turns the fastest rods, rad

_LONGEST, _LONGEST_AT_REST = 1.5, 1.0  # the largest h W where turns decide, and where b does
_FURTHEST = 0.3  # rad: a step that turned a rod further is not the one that was asked for

_CLOSE = 1e-6  # how far a rod may be from its length after such a step, relative to it; less after less, by the cube
_ROUGH = 1e-2  # from where on the first iteration's matrix will not do for the next
_NEAR = 1e-4  # so near, rods tell the step, and are corrected together with what it changes; and later matrices do
_FRESH = 4  # iterations with one matrix; where these are not enough, each has its own
_CHANGE = 1.25  # of a step from one to the next, as a first guess
_GROWTH = 1.2  # of a step over that: where rods turn back, their turns say nothing; and what is far less is begun again
_AT_REST = 0.9  # of b: longer steps are hardly limited by turns
_THERE = 1e-5  # of a step: so near to the output no step aside is taken, since the mean speed in it would be rounding

#: What is kept in `State.steps`: the length of the last step, s, and of the two before, 0 where there is none; a first
#: guess of the next; how far the run has come, s; and into how many parts b is cut.
_LAST, _BEFORE, _OLDER, _NEXT, _TIME, _PARTS = range(6)


class State(NamedTuple):
    """What is kept from step to step, as `rattle.State` says, and the same rows of the step aside to the output."""

    q: FloatArray
    v: FloatArray
    gap: FloatArray
    memory: FloatArray
    steps: FloatArray
    room: FloatArray
    aside: FloatArray


def begin(q: FloatArray, v: FloatArray) -> State:
    """The state at the start, copied."""
    start, steps = rattle.begin(q, v), np.zeros(6)
    steps[_PARTS] = 1.0
    return State(start.q, start.v, start.gap, start.memory, steps, start.room, np.zeros_like(start.memory))


@inlined
def _extrapolate_forces(rows: Rows, last: float, before: float, older: float) -> None:
    """The next multipliers, by the parabola through the last three, `last` s after them; the oldest are kept aside."""
    to_before, to_older = last + before, last + before + older
    share, share_before, share_older = 1.0, 0.0, 0.0
    if before > 0.0 and older > 0.0:
        share = to_before * to_older / (before * (before + older))
        share_before = -last * to_older / (before * older)
        share_older = last * to_before / ((before + older) * older)
    force, force_before, force_older, fallen = rows.force, rows.force_before, rows.force_older, rows.spare_x
    for i in range(len(force)):
        extrapolated = share * force[i] + share_before * force_before[i] + share_older * force_older[i]
        fallen[i], force_older[i] = force_older[i], force_before[i]
        force_before[i], force[i] = force[i], extrapolated


@inlined
def _forget_forces(rows: Rows) -> None:
    """Go back to before that."""
    force, force_before, force_older, fallen = rows.force, rows.force_before, rows.force_older, rows.spare_x
    for i in range(len(fallen)):
        force[i], force_before[i], force_older[i] = force_before[i], force_older[i], fallen[i]


@inlined
def _turn(rows: Rows) -> float:
    """By how much the new rods have turned, rad: the eighth root of the sum of eighth powers.

    The sum is folded in halves: one that runs from end to end does not run in vector registers.
    """
    n, spare = len(rows.off), rows.spare_y
    for i in range(n):
        x, y = rows.new_x[i] - rows.x[i + 1], rows.new_y[i] - rows.y[i + 1]
        square = rows.inverse_square[i] * (x * x + y * y)
        spare[i] = square * square * square * square
    while n > 1:
        rest = (n + 1) // 2
        for i in range(n // 2):
            spare[i] += spare[rest + i]
        n = rest
    turn: float = np.sqrt(np.sqrt(np.sqrt(spare[0])))
    return turn


@inlined
def _closes(chain: Chain, rows: Rows, steps: FloatArray, longest: float) -> float:
    """The length of the next step, s, with multipliers that close it; leaves the new rods. 0 where none are found."""
    last, falling = steps[_LAST], rows.speed_y[0]
    h: float = min(steps[_NEXT], longest)
    again, followed, close = True, False, _CLOSE
    for iteration in range(MOST_ITERATIONS):
        between = 0.5 * (h + last)
        rows.speed_y[0] = falling - between * chain.gravity
        open_rods, rough = write_new_rods(chain, rows, h, h * between, close, _ROUGH if iteration == 0 else _NEAR)
        if open_rods == 0 and followed:
            return h
        if again or iteration >= _FRESH:
            eliminate(chain, rows, h * between)
            again = rough > 0
        if iteration > 0 and rough == 0 and not followed:
            share = _turn(rows) / TURN
            change = 1.0 / np.hypot(h / longest, share)
            if change * _GROWTH < 1.0:
                break
            h *= min(change, _GROWTH)
            followed, close = True, max(CLOSE, _CLOSE * share * share * share)
        else:
            correct(rows)
    rows.speed_y[0] = falling
    return 0.0


@inlined
def _step(chain: Chain, rows: Rows, steps: FloatArray, dt: float) -> float:
    """The length of the next step, s, that leaves the new rods; 0 where even the finest does not close.

    Multipliers can close a step on another motion than the one they come from, that turns rods by far more than asked.
    """
    falling, finest = rows.speed_y[0], dt / FINEST
    while steps[_NEXT] >= finest:
        longest = dt / steps[_PARTS]
        _extrapolate_forces(rows, steps[_LAST], steps[_BEFORE], steps[_OLDER])
        h = _closes(chain, rows, steps, longest)
        tried = h if h > 0.0 else min(steps[_NEXT], longest)
        rests = tried > _AT_REST * longest
        if h >= finest and turns_within(rows, _FURTHEST):
            most = _LONGEST_AT_REST if rests else _LONGEST
            if pulls_within(chain.couplings, rows.force, (most / h) ** 2):
                return h
        rows.speed_y[0] = falling
        _forget_forces(rows)
        steps[_PARTS] *= 2.0 if rests else 1.0
        steps[_NEXT] = 0.5 * min(steps[_NEXT], tried)
    return 0.0


@inlined
def _run(
    chain: Chain, memory: FloatArray, steps: FloatArray, room: FloatArray, aside: FloatArray, dt: float, end: float
) -> bool:
    """Take steps as long as they end before `end`, s; False where one cannot be taken.

    Leaves the rods aside, with the multipliers of the step that would have been the next.
    """
    rows = rows_of(memory, room, len(chain.lengths))
    prepare_rows(chain, rows)
    while True:
        falling, last = rows.speed_y[0], steps[_LAST]
        h = _step(chain, rows, steps, dt)
        if h == 0.0:
            return False
        if steps[_TIME] + h > end:
            rows.speed_y[0] = falling
            copy_rows(memory, aside)
            _forget_forces(rows)
            return True
        accept(rows, h)
        steps[_NEXT] = h * min(max(h / last, 1.0 / _CHANGE), _CHANGE) if last > 0.0 else h
        steps[_OLDER], steps[_BEFORE], steps[_LAST] = steps[_BEFORE], last, h
        steps[_TIME] += h


@inlined
def _accept_by_kick(chain: Chain, rows: Rows, h: float, between: float) -> None:
    """Go on from the new rods; their speeds by what changed them, since over a short step differences are rounding."""
    couplings, force, x, y = chain.couplings, rows.force, rows.x, rows.y
    new_speed_x, new_speed_y = rows.spare_x, rows.spare_y
    for i in range(len(rows.off)):
        own, out, back = pulls(couplings, force, i, between)
        new_speed_x[i] = rows.speed_x[i] + own * x[i + 1] - out * x[i + 2] - back * x[i]
        new_speed_y[i] = rows.speed_y[i] + own * y[i + 1] - out * y[i + 2] - back * y[i]
    accept(rows, h)
    for i in range(len(rows.off)):
        rows.speed_x[i], rows.speed_y[i] = new_speed_x[i], new_speed_y[i]


@inlined
def _look(chain: Chain, memory: FloatArray, aside: FloatArray, room: FloatArray, last: float, ahead: float) -> float:
    """Take the rods aside `ahead` s further, and return the length of the last step; 0 where that cannot be done.

    What is left of the rods' lengths becomes speed over the step, which can be short: so a correction at least.
    """
    if ahead <= _THERE * last:
        return last
    rows, parts = rows_of(aside, room, len(chain.lengths)), 1
    while parts <= FINEST:
        h, before, taken = ahead / parts, last, 0
        while taken < parts:
            between = 0.5 * (h + before)
            rows.speed_y[0] -= between * chain.gravity
            if not closes(chain, rows, h, h * between, 1) or not turns_within(rows, _FURTHEST):
                break
            _accept_by_kick(chain, rows, h, between)
            before, taken = h, taken + 1
        if taken == parts:
            return h
        copy_rows(memory, aside)
        parts *= 2
    return 0.0


@compiled
def _advance(
    chain: Chain, memory: FloatArray, steps: FloatArray, room: FloatArray, aside: FloatArray, dt: float, end: float
) -> float:
    """Run to before `end`, s, in steps of dt s at most, and leave the rods of then aside.

    Returns the length of the step aside, s, or of the last one where none was needed; 0 where the run is stuck.
    """
    if not _run(chain, memory, steps, room, aside, dt, end):
        return 0.0
    return _look(chain, memory, aside, room, steps[_LAST], end - steps[_TIME])


def write_start(chain: Chain, state: State, dt: float) -> None:
    """Before the first step, the rods and what `rattle` keeps of them, and a first guess of the step."""
    if state.steps[_NEXT] == 0.0:
        rattle.write_start(chain, rattle.State(*state[:6]))
        state.steps[_NEXT] = dt / np.hypot(1.0, dt * np.abs(state.v).max() / TURN)


def adaptive_rattle(chain: Chain, state: State, first: int, dt: float, steps: int) -> int:
    """Take steps as `methods.FixedStep` says, each in as many as the motion asks for."""
    write_start(chain, state, dt)
    memory, kept, taken = state.memory.copy(), state.steps.copy(), steps
    last = _advance(chain, *state[3:], dt, (first + taken) * dt)
    if last == 0.0:  # to the last output before it is stuck
        taken = max(math.ceil(state.steps[_TIME] / dt) - 1 - first, 0)
        state.memory[:], state.steps[:] = memory, kept
        last = _advance(chain, *state[3:], dt, (first + taken) * dt) if taken > 0 else 0.0
    if last == 0.0:
        state.memory[:], state.steps[:] = memory, kept
        return 0
    rattle.write_state(chain, rattle.State(*state[:3], state.aside, np.array([last]), state.room))
    return taken


add(
    FixedStep(
        "adaptive_rattle",
        order=2,
        note="RATTLE with reversible steps that follow the motion",
        form=Form.RODS,
        begin=begin,
        advance=adaptive_rattle,
        stuck=rattle.STUCK,
        remedy=rattle.REMEDY,
        substeps=True,
    )
)
