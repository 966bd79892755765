"""Implicit methods for long chains: steps far beyond the fastest oscillation, in O(n), with whole rods.

Each follows the rods r_i and their relative velocities v_i in the plane; a step is a formula in those before, and the
angles and pulls that close the chain (`closing`):

- `implicit_euler`, order 1: v' = (r' - r)/h, a' = (v' - v)/h. The floor: it damps whatever moves.
- `bdf2`, order 2: both derivatives by the formula over the last two steps, of any ratio. It damps what is too fast for
  the step and nearly nothing else. A step that has no solution, as where a whip cracks, is taken with order 1.
- `energy_momentum`, order 2: the mean of the velocities carries the rods, and rods pull along the mean of old and new.
  Then pulls do no work on rods that keep their lengths, and gravity exactly its own: the energy of the velocities in
  the plane is that at the start, to what Newton's method leaves.

A step that does not close is cut in two, and so is one of `bdf2` that misses what the motion before suggests by more
than `FAR_OFF` of the chain; after one that does, twice the step is tried. Velocities of rods between two steps have a
part along them, of the size of the method's error; rates are those of the nearest motion, in the masses' metric, that
keeps the rods' lengths.

Sources: Hairer, Wanner, Solving Ordinary Differential Equations II, VII.3 (BDF for constrained systems); Hairer,
Norsett, Wanner I, III.5 (variable steps); Gonzalez, J. Nonlinear Sci. 6 (1996), 449, and Betsch and Steinmann, Int. J.
Numer. Meth. Engng 53 (2002), 2271 (energy and momentum of constrained systems). equations.md, (E58) to (E64).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

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
    close,
    room_for,
    write_rods,
)
from pendbench.solvers.methods import FixedStep, Form, add

#: A step is cut into so many parts at most.
FINEST = 1024

#: And into so many where it closes, but misses.
MOST_FOR_A_MISS = 4

#: How far, in lengths of the chain, a step of `bdf2` may take a point from where the motion before would.
FAR_OFF = 7e-4

_EULER, _BDF2, _CONSERVING = 1, 2, 3

#: Of a first step, the length squared times the largest angular acceleration, rad.
_FIRST_TURN = 0.2

# Changes of angles, rad, that end Newton's method: what is left is of the order of their square.
_CLOSE, _EXACT = 1e-4, 1e-9


# The rows of the memory.
_ROD, _SPEED, _ROD_BEFORE, _SPEED_BEFORE, _TURNED, _TURNED_BEFORE, _TENSION, _TENSION_RATE = 0, 2, 4, 6, 8, 9, 10, 11


class _State(NamedTuple):
    """What is kept from step to step.

    q, v (n,): angles and rates after the last step. memory (12, n): the rods (x, y), m, their speeds (x, y), m/s, and
    both before the last step; the mean rates of the last two steps, rad/s; tensions, N, and how they changed, N/s.
    steps (3,): the length of the last two, s, and the part of a step, of `FINEST`, to try next; 0 before the first.
    """

    q: FloatArray
    v: FloatArray
    memory: FloatArray
    steps: FloatArray


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


def begin(q: FloatArray, v: FloatArray) -> _State:
    """The state at the start, copied."""
    return _State(q.copy(), v.copy(), np.zeros((12, len(q))), np.zeros(3))


@inlined
def _formula(member: int, h: float, ratio: float) -> _Formula:
    """The step of h (s) after one that was shorter by the factor `ratio`. equations.md, (E61) to (E63)."""
    if member == _EULER:
        return _Formula(h * h, 1.0, 1.0, h, 0.0, 0.0, 1.0 / h, -1.0 / h, 0.0)
    if member == _CONSERVING:
        return _Formula(0.5 * h * h, 0.5, 1.0, h, 0.0, 0.0, 0.0, 0.0, 0.0)
    new, old, older = (1.0 + 2.0 * ratio) / (1.0 + ratio), -(1.0 + ratio), ratio * ratio / (1.0 + ratio)
    once, twice = 1.0 / new, h / (new * new)
    return _Formula(
        h * twice, 1.0, -old * once, -old * twice, -older * once, -older * twice, new / h, old / h, older / h
    )


@inlined
def _solve_rods(chain: Chain, rows: FloatArray, n: int) -> None:
    """Forces along the rods (ROD of `rows`) that change their speeds along them by SPARE, in place.

    The change of rod i is a_i f_i - c_(i+1) f_(i+1) - c_i f_(i-1), with f along the rods.
    """
    couplings = chain.couplings
    rows[PULL, 0] = 1.0 / couplings[1]
    for i in range(1, n):
        beside = -couplings[i] * (rows[ROD_X, i] * rows[ROD_X, i - 1] + rows[ROD_Y, i] * rows[ROD_Y, i - 1])
        ratio = beside * rows[PULL, i - 1]
        rows[PULL, i] = 1.0 / (couplings[i] + couplings[i + 1] - ratio * beside)
        rows[SPARE, i] -= ratio * rows[SPARE, i - 1]
    rows[SPARE, n - 1] *= rows[PULL, n - 1]
    for i in range(n - 2, -1, -1):
        beside = -couplings[i + 1] * (rows[ROD_X, i] * rows[ROD_X, i + 1] + rows[ROD_Y, i] * rows[ROD_Y, i + 1])
        rows[SPARE, i] = (rows[SPARE, i] - beside * rows[SPARE, i + 1]) * rows[PULL, i]
    for i in range(n):
        rows[FORCE_X, i + 1] = rows[SPARE, i] * rows[ROD_X, i]
        rows[FORCE_Y, i + 1] = rows[SPARE, i] * rows[ROD_Y, i]
    rows[FORCE_X, n + 1], rows[FORCE_Y, n + 1] = 0.0, 0.0


@inlined
def _across(chain: Chain, rows: FloatArray, i: int, x: float, y: float) -> float:
    """How fast rod i turns with (x, y) less what FORCE does to it, over a length."""
    c_in, c_out = chain.couplings[i], chain.couplings[i + 1]
    x -= (c_in + c_out) * rows[FORCE_X, i + 1] - c_in * rows[FORCE_X, i] - c_out * rows[FORCE_X, i + 2]
    y -= (c_in + c_out) * rows[FORCE_Y, i + 1] - c_in * rows[FORCE_Y, i] - c_out * rows[FORCE_Y, i + 2]
    across: float = rows[ROD_X, i] * y - rows[ROD_Y, i] * x
    return across / float(chain.lengths[i])


@compiled
def _write_rates(chain: Chain, state: _State, room: Room) -> None:
    """The rates of the motion nearest to the speeds that keeps the rods' lengths. equations.md, (E64)."""
    rows, memory, n = room.rows, state.memory, len(state.q)
    write_rods(state.q, rows, ROD_Y)
    for i in range(n):
        rows[SPARE, i] = rows[ROD_X, i] * memory[_SPEED, i] + rows[ROD_Y, i] * memory[_SPEED + 1, i]
    _solve_rods(chain, rows, n)
    for i in range(n):
        state.v[i] = _across(chain, rows, i, memory[_SPEED, i], memory[_SPEED + 1, i])


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
def _restart(chain: Chain, state: _State, room: Room) -> None:
    """Go on from speeds that keep the rods' lengths, those of the rates."""
    _write_motion(chain, state.memory, room.rows, state.q, state.v, _ROD)


@compiled
def _start(chain: Chain, state: _State, room: Room, dt: float) -> None:
    """What a first step looks back on: the motion before the start, from the accelerations there.

    It is so short a part of dt (s) that no rod turns far in it.
    """
    rows, memory, n = room.rows, state.memory, len(state.q)
    _write_motion(chain, memory, rows, state.q, state.v, _ROD)
    for i in range(n):
        pull = -chain.gravity * rows[ROD_Y, i] if i == 0 else 0.0
        memory[_TENSION, i] = pull + chain.lengths[i] * state.v[i] * state.v[i]
        rows[SPARE, i] = memory[_TENSION, i]
    _solve_rods(chain, rows, n)
    size, most = FINEST, 0.0
    for i in range(n):
        memory[_TENSION, i] = rows[SPARE, i]
        fall = -chain.gravity if i == 0 else 0.0
        rows[WANTED_X, i] = _across(chain, rows, i, 0.0, fall)
        most = max(most, abs(rows[WANTED_X, i]))
    while size > 1 and (dt * size / FINEST) ** 2 * most > _FIRST_TURN:
        size //= 2
    h = dt * size / FINEST
    for i in range(n):
        turning = rows[WANTED_X, i]
        memory[_TURNED, i] = state.v[i] - 0.5 * h * turning
        memory[_TURNED_BEFORE, i] = state.v[i] - 1.5 * h * turning
        rows[ANGLE, i] = state.q[i] - h * state.v[i] + 0.5 * h * h * turning
        rows[GUESS, i] = state.v[i] - h * turning
    _write_motion(chain, memory, rows, rows[ANGLE, :n], rows[GUESS, :n], _ROD_BEFORE)
    state.steps[0], state.steps[1], state.steps[2] = h, h, size


@compiled
def _propose(chain: Chain, state: _State, room: Room, member: int, h: float, plainly: bool) -> None:
    """Write what a step of h (s) of a member wants, and a guess. plainly: that the last goes on, not how it changed."""
    rows, memory, n, last, before = room.rows, state.memory, len(state.q), state.steps[0], state.steps[1]
    f = _formula(member, h, h / last)
    ahead = 0.0 if plainly else (h + last) / (last + before)
    later = 0.0 if plainly else h
    for axis in range(2):
        for i in range(n):
            rows[WANTED_X + axis, i] = f.rod * memory[_ROD + axis, i] + f.speed * memory[_SPEED + axis, i]
        if member == _BDF2:
            for i in range(n):
                rods, speeds = memory[_ROD_BEFORE + axis, i], memory[_SPEED_BEFORE + axis, i]
                rows[WANTED_X + axis, i] += f.rod_before * rods + f.speed_before * speeds
    rows[WANTED_Y, 0] -= f.scale * chain.gravity
    for i in range(n):
        rate = memory[_TURNED, i]
        rows[ANGLE, i] = state.q[i] + h * (rate + ahead * (rate - memory[_TURNED_BEFORE, i]))
        rows[PULL, i] = f.scale * (memory[_TENSION, i] + later * memory[_TENSION_RATE, i])


@compiled
def _miss(chain: Chain, state: _State, room: Room, h: float) -> float:
    """How far (m) the points are from where speeds and their last change would take them."""
    rows, memory, lengths = room.rows, state.memory, chain.lengths
    x, y, worst, half = 0.0, 0.0, 0.0, 0.5 * h * h / state.steps[0]
    for i in range(len(lengths)):
        v_x, v_y = memory[_SPEED, i], memory[_SPEED + 1, i]
        x += lengths[i] * rows[ROD_X, i] - memory[_ROD, i] - h * v_x - half * (v_x - memory[_SPEED_BEFORE, i])
        y += lengths[i] * rows[ROD_Y, i] - memory[_ROD + 1, i] - h * v_y - half * (v_y - memory[_SPEED_BEFORE + 1, i])
        worst = max(worst, x * x + y * y)
    return float(np.sqrt(worst))


@compiled
def _accelerate(chain: Chain, state: _State, room: Room, h: float) -> None:
    """Change the speeds by what pulls along the mean of old and new rods, and gravity, do in a step of h (s).

    (E63) says the same by positions, whose rounding errors over h would add up where nothing damps.
    """
    rows, couplings, n = room.rows, chain.couplings, len(state.q)
    for i in range(n):
        rows[SPARE, i] = 0.5 * (state.q[i] + rows[ANGLE, i])
    write_rods(rows[SPARE, :n], rows, ALONG_Y)
    for i in range(n):
        force = 2.0 * rows[PULL, i] / h
        rows[FORCE_X, i + 1], rows[FORCE_Y, i + 1] = force * rows[ALONG_Y + 1, i], force * rows[ALONG_Y, i]
    for row, force_row in ((_SPEED, FORCE_X), (_SPEED + 1, FORCE_Y)):
        for i in range(n):
            pulled = (couplings[i] + couplings[i + 1]) * rows[force_row, i + 1]
            pulled -= couplings[i] * rows[force_row, i] + couplings[i + 1] * rows[force_row, i + 2]
            state.memory[row, i] -= pulled
    state.memory[_SPEED + 1, 0] -= h * chain.gravity


@compiled
def _accept(chain: Chain, state: _State, room: Room, member: int, h: float) -> None:
    """Go on to what closed."""
    rows, memory, n = room.rows, state.memory, len(state.q)
    f = _formula(member, h, h / state.steps[0])
    for axis in range(2):
        rod_row = ROD_X if axis == 0 else ROD_Y
        for i in range(n):
            rod, speed = memory[_ROD + axis, i], memory[_SPEED + axis, i]
            new = chain.lengths[i] * rows[rod_row, i]
            older = f.older * memory[_ROD_BEFORE + axis, i]
            if member != _CONSERVING:
                memory[_SPEED + axis, i] = f.new * new + f.old * rod + older
            memory[_ROD + axis, i] = new
            memory[_ROD_BEFORE + axis, i], memory[_SPEED_BEFORE + axis, i] = rod, speed
    for i in range(n):
        memory[_TURNED_BEFORE, i] = memory[_TURNED, i]
        memory[_TURNED, i] = (rows[ANGLE, i] - state.q[i]) / h
        tension = rows[PULL, i] / f.scale
        memory[_TENSION_RATE, i] = (tension - memory[_TENSION, i]) / h
        memory[_TENSION, i] = tension
        state.q[i] = rows[ANGLE, i]
    state.steps[1], state.steps[0] = state.steps[0], h


class _Run:
    """A chain, its state and where steps are computed, for the length of a call."""

    def __init__(self, chain: Chain, state: _State, member: int) -> None:
        self.chain, self.state, self.room, self.member = chain, state, room_for(len(state.q)), member
        self.far = FAR_OFF * float(chain.lengths.sum())

    def closes(self, member: int, h: float, plainly: bool) -> bool:
        """Whether a step of h (s) of that member does."""
        _propose(self.chain, self.state, self.room, member, h, plainly)
        share, tolerance = (0.5, _EXACT) if member == _CONSERVING else (1.0, _CLOSE)
        closed: bool = close(self.chain, self.room, self.state.q, share, tolerance)
        return closed

    def step(self, h: float, cuttable: bool) -> float | None:
        """Take a step of h (s): by how much the next may be longer; None where it has to be cut.

        cuttable: whether it is long enough to be cut for no more than a miss.
        """
        if self.closes(self.member, h, False):
            miss = _miss(self.chain, self.state, self.room, h) if self.member == _BDF2 else 0.0
            if miss > self.far and cuttable:
                return None
            if self.member == _CONSERVING:
                _accelerate(self.chain, self.state, self.room, h)
            _accept(self.chain, self.state, self.room, self.member, h)
            return 2.0 if miss < 0.1 * self.far else 1.0
        if self.member != _CONSERVING and self.closes(_EULER, h, True):
            _accept(self.chain, self.state, self.room, _EULER, h)
            return 2.0
        return None

    def make_whole(self) -> None:
        """Take from the speeds what stretches rods: a shorter step would have to undo it at once."""
        if self.member != _CONSERVING:
            _write_rates(self.chain, self.state, self.room)
            _restart(self.chain, self.state, self.room)

    def frame(self, dt: float) -> bool:
        """Take a step of dt (s), in as many parts as it needs; False, and at its start, where that are too many."""
        left, kept, steps = FINEST, None, self.state.steps
        while left > 0:
            size = math.gcd(left, int(steps[2]))
            if size < left == FINEST:
                kept = [array.copy() for array in self.state]
            longer = self.step(dt * size / FINEST, cuttable=size * MOST_FOR_A_MISS > FINEST)
            if longer is not None:
                left -= size
                steps[2] = min(FINEST, longer * size)
            elif size > 1:
                steps[2] = size // 2
                self.make_whole()
            else:
                for array, before in zip(self.state, kept or (), strict=True):
                    array[:] = before
                return False
        return True


def take_steps(chain: Chain, state: _State, member: int, dt: float, steps: int) -> int:
    """Take steps of dt (s), and return how many could be taken.

    From Python, since a step of a long chain takes milliseconds: kernels that hold each other take long to compile.
    """
    run, taken = _Run(chain, state, member), 0
    if state.steps[2] == 0.0:
        _start(chain, state, run.room, dt)
    while taken < steps and run.frame(dt):
        taken += 1
    _write_rates(chain, state, run.room)
    return taken


def _method(name: str, member: int, order: int, note: str) -> FixedStep:
    def advance(system: Any, state: _State, first: int, dt: float, steps: int) -> int:  # noqa: ARG001
        return take_steps(system, state, member, dt, steps)

    return FixedStep(
        name,
        order=order,
        note=note,
        form=Form.RODS,
        begin=begin,
        advance=advance,
        stuck=f"no angles close the chain, not even in {FINEST} parts of the step",
        remedy="a smaller step might",
        substeps=True,
        conserves=member == _CONSERVING,
    )


add(_method("implicit_euler", _EULER, 1, "implicit Euler on the constrained system: damps"))
add(_method("bdf2", _BDF2, 2, "BDF2 on the constrained system: for very large n, damps what is too fast for the step"))
add(_method("energy_momentum", _CONSERVING, 2, "midpoint with discrete gradients: keeps energy, rods pull along means"))
