"""The steps of implicit methods for long chains: formulas over whole rods, from the last steps to the next.

`implicit` says which methods these are and puts the steps in a row; `closing` has Newton's method. equations.md, (E58)
to (E65).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined
from pendbench.solvers.closing import (
    ALONG_Y,
    ANGLE,
    FORCE_X,
    FORCE_Y,
    GUESS,
    PULL,
    ROD_X,
    ROD_Y,
    SPARE,
    WANTED_X,
    WANTED_Y,
    Chain,
    Room,
    room_for,
    write_rods,
)
from pendbench.solvers.projection import across, solve_rods

#: A step is cut into so many parts at most.
FINEST = 1024

#: The members: implicit Euler, BDF2, and the one that conserves energy and momentum.
EULER, BDF2, CONSERVING = 1, 2, 3

#: What Newton's method begins with: the last turning and how it changed, for `bdf2` how that did, too; or the turning.
CHANGING, TURNING = 0, 1

#: What is no motion of a mass in a step, over the length of the chain up to it.
_STILL = 1e-9

#: Of a first step, the length squared times the largest angular acceleration, rad.
_FIRST_TURN = 0.2

# What `State.steps` has.
STEP, STEP_BEFORE, PART, CALM, OWN_SPEED, DESCENDED = range(6)

# The rows of the memory.
_ROD, _SPEED, _ROD_BEFORE, _SPEED_BEFORE = 0, 2, 4, 6
_TURNED, _TURNED_RATE, _TURNED_BEND, _TENSION, _TENSION_RATE = 8, 9, 10, 11, 12


class State(NamedTuple):
    """What is kept from step to step.

    q, v (n,): angles and rates after the last step. gap (1,): 0, for rods are those of angles. memory (13, n): the
    rods (x, y), m, their speeds (x, y), m/s, and both before the last step; the divided differences of the last angles,
    rad/s, rad/s^2 and rad/s^3; tensions, N, and how they changed, N/s.
    steps (6,): the length of the last two, s; the part of a step, of `FINEST`, to try next, 0 before the first; how
    many more steps are to be of order 1; the chain's own speed at the start, m/s (`_own_speed`); and whether any step
    took a descent. room: where steps are computed.
    """

    q: FloatArray
    v: FloatArray
    gap: FloatArray
    memory: FloatArray
    steps: FloatArray
    room: Room


class _Formula(NamedTuple):
    """A step: q = rod r + speed v + rod_before r_b + speed_before v_b, and v' = new r' + old r + older r_b.

    scale: how a tension moves a mass, s^2. share: where between old and new a rod pulls.
    """

    scale: float
    share: float
    rod: float
    speed: float
    rod_before: float
    speed_before: float
    new: float
    old: float
    older: float


def begin(q: FloatArray, v: FloatArray) -> State:
    """The state at the start, copied."""
    return State(q.copy(), v.copy(), np.zeros(1), np.zeros((13, len(q))), np.zeros(6), room_for(len(q)))


@inlined
def _formula(member: int, h: float, ratio: float) -> _Formula:
    """The step of h (s) after one that was shorter by the factor `ratio`. equations.md, (E61) to (E63)."""
    if member == EULER:
        return _Formula(h * h, 1.0, 1.0, h, 0.0, 0.0, 1.0 / h, -1.0 / h, 0.0)
    if member == CONSERVING:
        return _Formula(0.5 * h * h, 0.5, 1.0, h, 0.0, 0.0, 0.0, 0.0, 0.0)
    new, old, older = (1.0 + 2.0 * ratio) / (1.0 + ratio), -(1.0 + ratio), ratio * ratio / (1.0 + ratio)
    once, twice = 1.0 / new, h / (new * new)
    return _Formula(
        h * twice, 1.0, -old * once, -old * twice, -older * once, -older * twice, new / h, old / h, older / h
    )


@compiled
def write_rates(chain: Chain, state: State) -> None:
    """The rates of the motion nearest to the speeds that keeps the rods' lengths. equations.md, (E64)."""
    rows, memory, n = state.room.rows, state.memory, len(state.q)
    for i in range(n):
        rows[ROD_X, i], rows[ROD_Y, i] = memory[_ROD, i] / chain.lengths[i], memory[_ROD + 1, i] / chain.lengths[i]
        rows[SPARE, i] = rows[ROD_X, i] * memory[_SPEED, i] + rows[ROD_Y, i] * memory[_SPEED + 1, i]
    solve_rods(chain, rows, n)
    for i in range(n):
        state.v[i] = across(chain, rows, i, memory[_SPEED, i], memory[_SPEED + 1, i])


@inlined
def _write_motion(
    chain: Chain, memory: FloatArray, rows: FloatArray, angles: FloatArray, v: FloatArray, at: int
) -> None:
    """Write the rods at angles (n,) and, with rates v (n,), their speeds into four rows of the memory."""
    write_rods(angles, rows, ROD_Y)
    for i in range(len(v)):
        x, y = chain.lengths[i] * rows[ROD_X, i], chain.lengths[i] * rows[ROD_Y, i]
        memory[at, i], memory[at + 1, i], memory[at + 2, i], memory[at + 3, i] = x, y, -v[i] * y, v[i] * x


@compiled
def restart(chain: Chain, state: State) -> None:
    """Go on from speeds that keep the rods' lengths, those of the rates."""
    _write_motion(chain, state.memory, state.room.rows, state.q, state.v, _ROD)


@inlined
def _own_speed(chain: Chain, memory: FloatArray) -> float:
    """How fast the chain moves of itself, m/s: from how fast its masses do, and how fast it falls by its own length."""
    x, y, reach, mass, twice_kinetic = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(chain.lengths)):
        x, y, reach = x + memory[_SPEED, i], y + memory[_SPEED + 1, i], reach + chain.lengths[i]
        mass += 1.0 / chain.couplings[i + 1]
        twice_kinetic += (x * x + y * y) / chain.couplings[i + 1]
    return float(np.sqrt(twice_kinetic / mass + abs(chain.gravity) * reach))


@compiled
def start(chain: Chain, state: State, dt: float) -> None:
    """What a first step looks back on: the motion before the start, from the accelerations there.

    It is so short a part of dt (s) that no rod turns far in it.
    """
    rows, memory, n = state.room.rows, state.memory, len(state.q)
    _write_motion(chain, memory, rows, state.q, state.v, _ROD)
    for i in range(n):
        pull = -chain.gravity * rows[ROD_Y, i] if i == 0 else 0.0
        memory[_TENSION, i] = pull + chain.lengths[i] * state.v[i] * state.v[i]
        rows[SPARE, i] = memory[_TENSION, i]
    solve_rods(chain, rows, n)
    size, most = FINEST, 0.0
    for i in range(n):
        memory[_TENSION, i] = rows[SPARE, i]
        fall = -chain.gravity if i == 0 else 0.0
        rows[WANTED_X, i] = across(chain, rows, i, 0.0, fall)
        most = max(most, abs(rows[WANTED_X, i]))
    while size > 1 and (dt * size / FINEST) ** 2 * most > _FIRST_TURN:
        size //= 2
    h = dt * size / FINEST
    for i in range(n):
        turning = rows[WANTED_X, i]
        memory[_TURNED, i] = state.v[i] - 0.5 * h * turning
        memory[_TURNED_RATE, i] = 0.5 * turning
        rows[ANGLE, i] = state.q[i] - h * state.v[i] + 0.5 * h * h * turning
        rows[GUESS, i] = state.v[i] - h * turning
    _write_motion(chain, memory, rows, rows[ANGLE, :n], rows[GUESS, :n], _ROD_BEFORE)
    state.steps[STEP], state.steps[STEP_BEFORE], state.steps[PART] = h, h, size
    state.steps[OWN_SPEED] = max(_own_speed(chain, memory), _STILL * chain.length / abs(dt))


@inlined
def _followed(memory: FloatArray, first: int, last: int) -> tuple[FloatArray, ...]:
    """What guesses go on from: the divided differences of angles; tensions, and how they changed."""
    return (
        memory[_TURNED, first:last],
        memory[_TURNED_RATE, first:last],
        memory[_TURNED_BEND, first:last],
        memory[_TENSION, first:last],
        memory[_TENSION_RATE, first:last],
    )


@inlined
def propose_some(chain: Chain, state: State, member: int, h: float, guess: int, first: int, last: int) -> None:
    """What `propose` does, of rods `first` to `last` - 1."""
    rows, memory, h_last, h_before = state.room.rows, state.memory, state.steps[STEP], state.steps[STEP_BEFORE]
    f = _formula(member, h, h / h_last)
    later = h if guess == CHANGING else 0.0
    second = later * (h + h_last)
    third = second * (h + h_last + h_before)
    for axis in range(2):
        wanted, rod, speed = (
            rows[WANTED_X + axis, first:last],
            memory[_ROD + axis, first:last],
            memory[_SPEED + axis, first:last],
        )
        for i in range(last - first):
            wanted[i] = f.rod * rod[i] + f.speed * speed[i]
        if member == BDF2:
            rod, speed = memory[_ROD_BEFORE + axis, first:last], memory[_SPEED_BEFORE + axis, first:last]
            for i in range(last - first):
                wanted[i] += f.rod_before * rod[i] + f.speed_before * speed[i]
    if first == 0 < last:
        rows[WANTED_Y, 0] -= f.scale * chain.gravity
    angle, pull, q = rows[ANGLE, first:last], rows[PULL, first:last], state.q[first:last]
    turned, rate, bent, tension, tension_rate = _followed(memory, first, last)
    for i in range(last - first):
        angle[i] = q[i] + h * turned[i] + second * rate[i] + third * bent[i]
        pull[i] = f.scale * (tension[i] + later * tension_rate[i])


@compiled
def propose(chain: Chain, state: State, member: int, h: float, guess: int) -> None:
    """Write what a step of h (s) of a member wants, and one of the guesses."""
    propose_some(chain, state, member, h, guess, 0, len(state.q))


@compiled
def miss(chain: Chain, state: State, h: float) -> float:
    """How far (m) the points are from where speeds and their last change would take them."""
    rows, memory, lengths = state.room.rows, state.memory, chain.lengths
    x, y, worst, half = 0.0, 0.0, 0.0, 0.5 * h * h / state.steps[STEP]
    for i in range(len(lengths)):
        v_x, v_y = memory[_SPEED, i], memory[_SPEED + 1, i]
        x += lengths[i] * rows[ROD_X, i] - memory[_ROD, i] - h * v_x - half * (v_x - memory[_SPEED_BEFORE, i])
        y += lengths[i] * rows[ROD_Y, i] - memory[_ROD + 1, i] - h * v_y - half * (v_y - memory[_SPEED_BEFORE + 1, i])
        worst = max(worst, x * x + y * y)
    return float(np.sqrt(worst))


@compiled
def rise(chain: Chain, state: State, member: int, h: float) -> float:
    """By how much a step of `bdf2` or `implicit_euler` raises the energy.

    Over the kinetic energy before it, the largest of the weights, and what a motion by `_STILL` in the step has: a
    chain at rest moves by rounding.
    """
    rows, memory, f = state.room.rows, state.memory, _formula(member, h, h / state.steps[STEP])
    x, y, new_x, new_y, height, reach, change, scale = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    still = 0.5 * (_STILL / h) ** 2
    for i in range(len(state.q)):
        length, mass = chain.lengths[i], 1.0 / chain.couplings[i + 1]
        new, rod, before = length * rows[ROD_X, i], memory[_ROD, i], memory[_ROD_BEFORE, i]
        x, new_x = x + memory[_SPEED, i], new_x + f.new * new + f.old * rod + f.older * before
        new, rod, before = length * rows[ROD_Y, i], memory[_ROD + 1, i], memory[_ROD_BEFORE + 1, i]
        y, new_y = y + memory[_SPEED + 1, i], new_y + f.new * new + f.old * rod + f.older * before
        height, reach, kinetic = height + new - rod, reach + length, 0.5 * (x * x + y * y)
        change += mass * (0.5 * (new_x * new_x + new_y * new_y) - kinetic + chain.gravity * height)
        scale += mass * (kinetic + abs(chain.gravity) * reach + still * reach * reach)
    return change / scale if change > 0.0 else 0.0


@inlined
def pull_along_means(state: State, h: float, first: int, last: int) -> None:
    """Write what pulls along the mean of old and new rods do in a step of h (s)."""
    rows = state.room.rows
    for i in range(first, last):
        rows[SPARE, i] = 0.5 * (state.q[i] + rows[ANGLE, i])
    write_rods(rows[SPARE, first:last], rows, ALONG_Y, first)
    for i in range(first, last):
        force = 2.0 * rows[PULL, i] / h
        rows[FORCE_X, i + 1], rows[FORCE_Y, i + 1] = force * rows[ALONG_Y + 1, i], force * rows[ALONG_Y, i]


@inlined
def accelerate(chain: Chain, state: State, h: float, first: int, last: int) -> None:
    """Change the speeds by what those pulls, and gravity, do in a step of h (s).

    (E63) says the same by positions, whose rounding errors over h would add up where nothing damps.
    """
    rows, couplings = state.room.rows, chain.couplings
    for row, force_row in ((_SPEED, FORCE_X), (_SPEED + 1, FORCE_Y)):
        for i in range(first, last):
            pulled = (couplings[i] + couplings[i + 1]) * rows[force_row, i + 1]
            pulled -= couplings[i] * rows[force_row, i] + couplings[i + 1] * rows[force_row, i + 2]
            state.memory[row, i] -= pulled
    if first == 0 < last:
        state.memory[_SPEED + 1, 0] -= h * chain.gravity


@inlined
def accept_some(chain: Chain, state: State, member: int, h: float, first: int, last: int) -> None:
    """Go on to what closed, but for the speeds of the member that conserves."""
    rows, memory = state.room.rows, state.memory
    f = _formula(member, h, h / state.steps[STEP])
    lengths = chain.lengths[first:last]
    for axis in range(2):
        closed = rows[ROD_X if axis == 0 else ROD_Y, first:last]
        rod, speed = memory[_ROD + axis, first:last], memory[_SPEED + axis, first:last]
        rod_before, speed_before = memory[_ROD_BEFORE + axis, first:last], memory[_SPEED_BEFORE + axis, first:last]
        for i in range(last - first):
            new, old_speed = lengths[i] * closed[i], speed[i]
            if member != CONSERVING:
                speed[i] = f.new * new + f.old * rod[i] + f.older * rod_before[i]
            rod_before[i], speed_before[i] = rod[i], old_speed
            rod[i] = new
    angle, pull, q = rows[ANGLE, first:last], rows[PULL, first:last], state.q[first:last]
    turned, rate, bent, tension, tension_rate = _followed(memory, first, last)
    second, third = h + state.steps[STEP], h + state.steps[STEP] + state.steps[STEP_BEFORE]
    # An error of order 1 looks like a bend; and where only one guess is made, a cubic leads astray more often.
    smooth = 1.0 if member == BDF2 else 0.0
    for i in range(last - first):
        mean = (angle[i] - q[i]) / h
        changed = (mean - turned[i]) / second
        bent[i] = smooth * (changed - rate[i]) / third
        turned[i], rate[i] = mean, changed
        pulled = pull[i] / f.scale
        tension_rate[i] = (pulled - tension[i]) / h
        tension[i] = pulled
        q[i] = angle[i]


@compiled
def accept(chain: Chain, state: State, member: int, h: float) -> None:
    """Go on to what closed."""
    n = len(state.q)
    if member == CONSERVING:
        pull_along_means(state, h, 0, n)
        accelerate(chain, state, h, 0, n)
    accept_some(chain, state, member, h, 0, n)
    state.steps[STEP_BEFORE], state.steps[STEP] = state.steps[STEP], h


@compiled
def accept_calm(chain: Chain, state: State, h: float, most: float) -> bool:
    """Go on to what closed with order 1, unless that raises the energy by more than `most` (`rise`): then False."""
    if most < np.inf and rise(chain, state, EULER, h) > most:
        return False
    accept(chain, state, EULER, h)
    return True
