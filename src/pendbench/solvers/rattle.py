"""RATTLE for a chain of points held by rods: Cartesian, symplectic, of order 2, O(n) a step.

Rod i between its two ends is r_i, its mean velocity over the step before v_i. A step of h after one of h' is

    r'_i = r_i + h v_i + k (g_i + (c_i + c_(i+1)) f_i r_i - c_(i+1) f_(i+1) r_(i+1) - c_i f_(i-1) r_(i-1))
    v'_i = (r'_i - r_i) / h             k = h (h + h') / 2, c_(i+1) = 1/m_i, c_1 = 0, g_1 gravity, the others 0

with multipliers f_i, -T_i / l_i, such that the new rods have their lengths (`multipliers`).
The halves of the kick that RATTLE gives after one step and before the next pull along the same rods, so they are one
here, and velocities that keep the rods' lengths are asked for at the end of a call alone.

Where the motion is too fast for the step, as where a whip cracks, it is taken in parts: these are halved where no
multipliers close one, where one turns a rod far, and where it is long beside the fastest oscillation that `frame`
bounds. Twice the part is tried again after many steps that would allow it, half as many more each time: a change costs
energy, since the error of the longer part stays, up to 6 % of the scale where steps are as long as they may be.
Between changes the step is constant, and up to h W = 0.5 the energy has a band and no slope; above, it can creep, by
13 % in 100,000 steps of a double pendulum with h W = 0.9 at most. `frame` does neither, for more steps.

Of 200 random chains (2 to 19 links, masses over eight decades at most, 120 steps of 5 ms) 53 come to the end of their
steps if these are not cut, and 181 if they are.

Sources: Andersen, J. Comput. Phys. 52 (1983), 24; Hairer, Lubich, Wanner, Geometric Numerical Integration, VII.1.4.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined, part
from pendbench.solvers.closing import ROD_X, ROD_Y, ROWS, SPARE, TURN, Chain
from pendbench.solvers.methods import FixedStep, Form, add
from pendbench.solvers.multipliers import (
    KEPT,
    SPEED_X,
    SPEED_Y,
    TURNS,
    Rows,
    X,
    Y,
    closes,
    extrapolate_forces,
    guess_forces,
    prepare_rows,
    pulls_within,
    rows_of,
    turns_within,
)
from pendbench.solvers.projection import across, solve_rods

#: A step is cut into so many parts at most.
FINEST = 16384

#: What to say where that is not enough, and what would help.
STUCK, REMEDY = f"the chain moves too fast for {FINEST} parts of a step", "a smaller step might"

# A part is halved where h W, or a rod's turn, rad, is above the first; twice it is tried where at the end of so many
# steps in a row both were below the second, and each time of as many more.
_LONGEST, _LONGEST_CALM = 1.0, 0.4
_FURTHEST, _FURTHEST_CALM = 0.5, 0.15
_PATIENCE, _RARER = 100, 1.5

_ONE: Any = np.int64(1)  # of a 1 numba makes a type of its own, and a second kernel


#: What is kept in `State.steps`: the length of the last step, s, 0 before the first; into how many parts steps are cut;
#: how many steps in a row would have allowed fewer, and how many have to (`frame` uses neither).
LAST, PARTS, CALM, PATIENCE = range(4)


class State(NamedTuple):
    """What is kept from step to step.

    q, v (n,): angles and rates after the last call. gap (1,): how far the worst rod was from its length then, relative
    to it. memory (KEPT, n + 2): the rows of `Rows` that are kept. steps (4,): see LAST. room (ROWS, n + 2): where steps
    are computed.
    """

    q: FloatArray
    v: FloatArray
    gap: FloatArray
    memory: FloatArray
    steps: FloatArray
    room: FloatArray


def begin(q: FloatArray, v: FloatArray) -> State:
    """The state at the start, copied."""
    n = len(q)
    memory, room = np.zeros((KEPT, n + 2)), np.zeros((ROWS, n + 2))
    return State(q.copy(), v.copy(), np.zeros(1), memory, np.array([0.0, 1.0, 0.0, _PATIENCE]), room)


def write_start(chain: Chain, state: State) -> None:
    """Before the first step, the rods, their speeds and turns, of the angles and rates."""
    if state.steps[LAST] == 0.0:
        x, y = chain.lengths * np.sin(state.q), -chain.lengths * np.cos(state.q)
        state.memory[X, 1:-1], state.memory[Y, 1:-1] = x, y
        state.memory[SPEED_X, :-2], state.memory[SPEED_Y, :-2] = -state.v * y, state.v * x
        state.memory[TURNS, :-2] = np.round((state.q - np.arctan2(x, -y)) / TURN)


@inlined
def accept(rows: Rows, h: float) -> None:
    """Go on from the new rods. One above the pivot whose x changes sign went over the top."""
    x, y, new_x, new_y, rate = rows.x, rows.y, rows.new_x, rows.new_y, 1.0 / h
    for i in range(len(new_x)):
        right, still = x[i + 1] >= 0.0, new_x[i] >= 0.0
        over = (1.0 if right else 0.0) - (1.0 if still else 0.0)
        rows.turns[i] += over if new_y[i] > 0.0 else 0.0
        rows.speed_x[i], rows.speed_y[i] = rate * (new_x[i] - x[i + 1]), rate * (new_y[i] - y[i + 1])
        x[i + 1], y[i + 1] = new_x[i], new_y[i]


@part
def take_steps(
    chain: Chain,
    memory: FloatArray,
    steps: FloatArray,
    room: FloatArray,
    h: float,
    count: int,
    furthest: float,
    quickest: float,
) -> int:
    """Take up to `count` steps of h s, and return how many were taken.

    Stops at the start of the first that no multipliers close, that turns a rod by more than `furthest`, rad, or whose
    multipliers have a W^2 above `quickest`, 1/s^2. In a kernel of its own, since next to copies its loops do not run in
    vector registers.
    """
    rows = rows_of(memory, room, len(chain.lengths))
    prepare_rows(chain, rows)
    for step in range(count):
        between, falling = 0.5 * (h + steps[LAST]), rows.speed_y[0]
        rows.speed_y[0] -= between * chain.gravity
        extrapolate_forces(rows)
        fast = not closes(chain, rows, h, h * between) or not turns_within(rows, furthest)
        if fast or not pulls_within(chain.couplings, rows.force, quickest):
            rows.speed_y[0] = falling
            guess_forces(rows, rows.force_before)
            return step
        accept(rows, h)
        steps[LAST] = h
    return count


@inlined
def _is_calm(chain: Chain, rows: Rows, h: float) -> bool:
    """Whether twice a step of h s can be tried after one; of a rod's turn, the chord is asked."""
    if not pulls_within(chain.couplings, rows.force, (_LONGEST_CALM / h) ** 2):
        return False
    beyond = 0
    for i in range(len(rows.off)):
        beyond += not h * np.hypot(rows.speed_x[i], rows.speed_y[i]) <= _FURTHEST_CALM * chain.lengths[i]
    return beyond == 0


@inlined
def _in_parts(chain: Chain, memory: FloatArray, steps: FloatArray, room: FloatArray, rows: Rows, dt: float) -> bool:
    """Take a step of dt s in as many parts as it asks for; False where even the finest do not close."""
    left = 1.0
    while left > 0.0:
        h = dt / steps[PARTS]
        if take_steps(chain, memory, steps, room, h, _ONE, _FURTHEST, (_LONGEST / h) ** 2) == 1:
            left -= 1.0 / steps[PARTS]
        elif steps[PARTS] < FINEST:
            steps[PARTS], steps[CALM] = 2.0 * steps[PARTS], 0.0
        else:
            return False
    steps[CALM] = steps[CALM] + 1.0 if _is_calm(chain, rows, h) else 0.0
    if steps[CALM] >= steps[PATIENCE]:
        steps[PARTS], steps[CALM], steps[PATIENCE] = 0.5 * steps[PARTS], 0.0, _RARER * steps[PATIENCE]
        guess_forces(rows, rows.force)
    return True


@compiled
def _write_state(chain: Chain, state: State) -> None:
    """The angles, the rates that the rods' lengths allow, and the gap."""
    s, n, lengths, rows = state.room, len(state.q), chain.lengths, rows_of(state.memory, state.room, len(state.q))
    # What steps had in the room is of no use any more: `closing` has it now, by rows of its own.
    state.gap[0] = 0.0
    for i in range(n):
        x, y = rows.x[i + 1], rows.y[i + 1]
        state.q[i] = np.arctan2(x, -y) + TURN * rows.turns[i]
        state.gap[0] = max(state.gap[0], abs(np.hypot(x, y) / lengths[i] - 1.0))
    between = rows.speed_y[0]
    rows.speed_y[0] -= 0.5 * state.steps[LAST] * chain.gravity
    for i in range(n):
        s[ROD_X, i], s[ROD_Y, i] = rows.x[i + 1] / lengths[i], rows.y[i + 1] / lengths[i]
        s[SPARE, i] = s[ROD_X, i] * rows.speed_x[i] + s[ROD_Y, i] * rows.speed_y[i]
    solve_rods(chain, s, n)
    for i in range(n):
        state.v[i] = across(chain, s, i, rows.speed_x[i], rows.speed_y[i])
    rows.speed_y[0] = between


def write_state(chain: Chain, state: State) -> None:
    """The same after a call; what no step has changed stays as it was."""
    if state.steps[LAST] > 0.0:
        _write_state(chain, state)


@compiled
def _advance(chain: Chain, memory: FloatArray, steps: FloatArray, room: FloatArray, dt: float, count: int) -> int:
    """Take steps of dt s, and return how many; where not all could be taken, what is left is of no use."""
    rows, taken = rows_of(memory, room, len(chain.lengths)), 0
    while taken < count:
        if steps[PARTS] == 1.0:
            taken += take_steps(chain, memory, steps, room, dt, count - taken, _FURTHEST, (_LONGEST / dt) ** 2)
        if taken < count:
            if steps[PARTS] == 1.0:
                steps[PARTS], steps[CALM] = 2.0, 0.0
            if not _in_parts(chain, memory, steps, room, rows, dt):
                return taken
            taken += 1
    return taken


def rattle(chain: Chain, state: State, first: int, dt: float, steps: int) -> int:  # noqa: ARG001
    """Take steps as `methods.FixedStep` says."""
    write_start(chain, state)
    memory, lengths = state.memory.copy(), state.steps.copy()
    taken: int = _advance(chain, state.memory, state.steps, state.room, dt, steps)
    if taken < steps:  # to the start of the one that could not be
        state.memory[:], state.steps[:] = memory, lengths
        _advance(chain, state.memory, state.steps, state.room, dt, taken)
    write_state(chain, state)
    return taken


add(
    FixedStep(
        "rattle",
        order=2,
        note="constrained Cartesian Stormer-Verlet: symplectic, for large n",
        form=Form.RODS,
        begin=begin,
        advance=rattle,
        stuck=STUCK,
        remedy=REMEDY,
        substeps=True,
    )
)
