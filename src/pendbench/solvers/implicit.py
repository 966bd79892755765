"""Implicit methods for long chains: steps far beyond the fastest oscillation, in O(n), with whole rods.

Each follows the rods r_i and their relative velocities v_i in the plane; a step is a formula in those before, and the
angles and pulls that close the chain (`closing`):

- `implicit_euler`, order 1: v' = (r' - r)/h, a' = (v' - v)/h. The floor: it damps whatever moves, but where rods push.
- `bdf2`, order 2: both derivatives by the formula over the last two steps, of any ratio. It damps what is too fast for
  the step and nearly nothing else. Where a step has no solution, as where a whip cracks, some are taken with order 1.
- `energy_momentum`, order 2: the mean of the velocities carries the rods, and rods pull along the mean of old and new.
  Then pulls do no work on rods that keep their lengths, and gravity exactly its own: the energy of the velocities in
  the plane is that at the start, to what Newton's method leaves.

A step that does not close is cut in two, and so is one of order 1 that raises the energy, and one of `bdf2` that misses
what the motion before suggests (`FAR_OFF`); after one that does well, twice the step is tried. Parts
of order 1 are not cut for ever: they always have a solution, and a descent finds it (`closing.descend`) unless masses
differ by more than some eight decades.
Velocities of rods between two steps have a part along them, of the size of the method's error; rates are those of the
nearest motion, in the masses' metric, that keeps the rods' lengths.

Sources: Hairer, Wanner, Solving Ordinary Differential Equations II, VII.3 (BDF for constrained systems); Hairer,
Norsett, Wanner I, III.5 (variable steps); Gonzalez, J. Nonlinear Sci. 6 (1996), 449, and Betsch and Steinmann, Int. J.
Numer. Meth. Engng 53 (2002), 2271 (energy and momentum of constrained systems). equations.md, (E58) to (E65).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.solvers.closing import Chain, close, descend
from pendbench.solvers.halves import accept_calm_halves, accept_halves, close_halves, propose_halves
from pendbench.solvers.methods import FixedStep, Form, add
from pendbench.solvers.rods import (
    BDF2,
    CALM,
    CHANGING,
    CONSERVING,
    DESCENDED,
    EULER,
    FINEST,
    OWN_SPEED,
    PART,
    TURNING,
    State,
    accept,
    accept_calm,
    begin,
    miss,
    propose,
    restart,
    rise,
    start,
    write_rates,
)

#: A step is cut into so many parts at most where it closes, but misses: before the first descent, and after it. From
#: there on the motion cannot be followed, and a sharper crack is only harder to close.
MOST_FOR_A_MISS = (8, 2)

#: After a step that misses by less than this part of what it may, twice the step is tried. In the cracks of a rope that
#: misses by some four times as much.
LONGER = 0.2

#: Cutting pays where it makes a miss smaller by this factor at least. It does not where a whip cracks.
PAYS = 0.6

#: How far a step of `bdf2` may take a point from where the motion before would, over what the chain's own speed at the
#: start covers in the whole step: errors of steps add up, so shorter ones may miss by less.
FAR_OFF = 0.014

#: By what part of itself and the weights' the energy may rise in a step of order 2 that misses. Some chains of masses
#: over four decades would gain 150 times their energy in 60 steps of 0.03 s, and the finer such steps are, the more of
#: them there are to gain in.
#: In one of order 1 it rises where rods push: 13 of 3000 chains of masses over eight decades that spin freely would
#: gain 1 % to 640 times their energy in 30 steps of 0.02 s.
MOST_RISE = 0.0005

#: How many steps are of order 1 after one of order 2 has no solution, or would gain energy.
CALMING = 6

#: Steps of order 1 are cut into so many parts before their solution is sought at any cost. In longer ones it is further
#: away than a descent goes, and energy rises by 3 % in a chain of 10,000 links at 1/240 s.
SETTLED = 4

# Changes of angles, rad, that end Newton's method: what is left is of the order of their square.
_CLOSE, _EXACT = 3e-3, 1e-9

_ONE_THREAD = (propose, close, accept, accept_calm)
_TWO_THREADS = (propose_halves, close_halves, accept_halves, accept_calm_halves)


class _Run:
    """A chain and its state, for the length of a call."""

    def __init__(self, chain: Chain, state: State, member: int, threads: int) -> None:
        self.chain, self.state, self.member = chain, state, member
        self.propose, self.close, self.accept, self.accept_calm = _ONE_THREAD if threads == 1 else _TWO_THREADS
        self.far, self.missed = math.inf, math.inf
        self.kept: list[FloatArray] = []

    def closes(self, member: int, h: float, guess: int) -> bool:
        """Whether a step of h (s) of that member does, from that guess."""
        share, tolerance = (0.5, _EXACT) if member == CONSERVING else (1.0, _CLOSE)
        self.propose(self.chain, self.state, member, h, guess)
        return bool(self.close(self.chain, self.state.room, self.state.q, share, tolerance))

    def settles(self, h: float) -> bool:
        """The same for one of order 1, however far its guess is."""
        self.propose(self.chain, self.state, EULER, h, TURNING)
        descend(self.chain, self.state.room, self.state.q)
        self.state.steps[DESCENDED] = 1.0
        return bool(self.close(self.chain, self.state.room, self.state.q, 1.0, _CLOSE))

    def step(self, h: float, parts: int) -> float | None:
        """Take a step of h (s), one of so many parts: by how much the next may be longer; None: it has to be cut."""
        rough = self.state.steps[CALM] > 0
        if self.member != EULER and not rough and self.closes(self.member, h, CHANGING):
            missed = miss(self.chain, self.state, h) if self.member == BDF2 else 0.0
            if (
                missed > self.far
                and parts < MOST_FOR_A_MISS[int(self.state.steps[DESCENDED])]
                and missed < PAYS * self.missed
            ):
                self.missed = missed
                return None
            if missed <= self.far or rise(self.chain, self.state, BDF2, h) <= MOST_RISE:
                self.accept(self.chain, self.state, self.member, h)
                return 2.0 if missed < LONGER * self.far or missed >= PAYS * self.missed else 1.0
        if self.member == CONSERVING:
            return None
        if not (self.closes(EULER, h, TURNING) or (parts >= SETTLED and self.settles(h))):
            return None
        if not self.accept_calm(self.chain, self.state, h, MOST_RISE if parts < FINEST else math.inf):
            return None
        self.state.steps[CALM] = self.state.steps[CALM] - 1 if rough else CALMING
        return 2.0

    def make_whole(self) -> None:
        """Take from the speeds what stretches rods: a shorter step would have to undo it at once."""
        if self.member != CONSERVING:
            write_rates(self.chain, self.state)
            restart(self.chain, self.state)

    def frame(self, dt: float) -> bool:
        """Take a step of dt (s), in as many parts as it needs; False, and at its start, where none is short enough."""
        left, kept, steps = FINEST, None, self.state.steps
        self.far, self.missed = FAR_OFF * float(steps[OWN_SPEED]) * abs(dt), math.inf
        while left > 0:
            size = math.gcd(left, int(steps[PART]))
            if kept is None and size < FINEST:
                kept = self.keep()
            longer = self.step(dt * size / FINEST, FINEST // size)
            if longer is not None:
                left -= size
                steps[PART] = min(FINEST, longer * size)
            elif size > 1:
                kept = kept or self.keep()
                steps[PART] = size // 2
                self.make_whole()
            else:
                self.go_back(kept or self.keep())
                return False
        return True

    def keep(self) -> list[FloatArray]:
        """The state as it is, in the room of the one that was kept before."""
        self.kept = self.kept or [np.empty_like(array) for array in self.state[:-1]]
        for room, array in zip(self.kept, self.state[:-1], strict=True):
            room[:] = array
        return self.kept

    def go_back(self, before: list[FloatArray]) -> None:
        """To a state that was kept."""
        for array, kept in zip(self.state[:-1], before, strict=True):
            array[:] = kept


def take_steps(chain: Chain, state: State, member: int, dt: float, steps: int, threads: int = 1) -> int:
    """Take steps of dt (s), and return how many could be taken. threads: 1, or 2 (`halves`).

    From Python, since a step of a long chain takes milliseconds: kernels that hold each other take long to compile.
    """
    run, taken = _Run(chain, state, member, threads), 0
    if state.steps[PART] == 0.0:
        start(chain, state, dt)
    while taken < steps and run.frame(dt):
        taken += 1
    write_rates(chain, state)
    return taken


def _method(name: str, member: int, order: int, note: str) -> FixedStep:
    def advance(system: Any, state: State, first: int, dt: float, steps: int, threads: int = 1) -> int:  # noqa: ARG001
        return take_steps(system, state, member, dt, steps, threads)

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
        conserves=member == CONSERVING,
        threads=2,
    )


add(_method("implicit_euler", EULER, 1, "implicit Euler on the constrained system: damps"))
add(_method("bdf2", BDF2, 2, "BDF2 on the constrained system: for very large n, damps what is too fast for the step"))
add(_method("energy_momentum", CONSERVING, 2, "midpoint with discrete gradients: keeps energy, rods pull along means"))
