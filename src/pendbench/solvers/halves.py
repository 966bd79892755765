"""Rods that close, with two threads: each eliminates the chain from one of its ends to the middle, as `closing` does.

The operations are those of one thread, in the same order. Where one thread works from both ends in turn, each end waits
less for its own results, and to wake the other thread takes as long as a thousand rods and more: two are faster from
some 30,000 rods on (docs/speed.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled_for_threads
from pendbench.base.second_thread import both
from pendbench.solvers.closing import (
    MOST_ITERATIONS,
    Carried,
    Chain,
    Room,
    closed,
    eliminate,
    keep_guess,
    lost,
    meet,
    pulled_along,
    settle,
    substitute,
    write_pulls,
)
from pendbench.solvers.rods import (
    CONSERVING,
    EULER,
    STEP,
    STEP_BEFORE,
    State,
    accelerate,
    accept_some,
    propose_some,
    pull_along_means,
    rise,
)

_Result = TypeVar("_Result")


def _each_half(kernel: Callable[..., _Result], *args: Any, rods: int) -> tuple[_Result, _Result]:
    """What a kernel of rods `first` to `last` - 1 returns for each half."""
    middle = rods // 2
    return both(kernel, (*args, 0, middle), (*args, middle, rods))


@compiled_for_threads
def _propose(chain: Chain, state: State, member: int, h: float, guess: int, first: int, last: int) -> None:
    propose_some(chain, state, member, h, guess, first, last)


@compiled_for_threads
def _keep_guess(room: Room, angles: FloatArray, first: int, last: int) -> float:
    return keep_guess(room, angles, first, last)


@compiled_for_threads
def _settle(room: Room, share: float, first: int, last: int) -> None:
    settle(room, share, first, last)


@compiled_for_threads
def _pull_along_means(state: State, h: float, first: int, last: int) -> None:
    pull_along_means(state, h, first, last)


@compiled_for_threads
def _accelerate(chain: Chain, state: State, h: float, first: int, last: int) -> None:
    accelerate(chain, state, h, first, last)


@compiled_for_threads
def _accept(chain: Chain, state: State, member: int, h: float, first: int, last: int) -> None:
    accept_some(chain, state, member, h, first, last)


@compiled_for_threads
def _pull_middle(room: Room, angles: FloatArray, share: float) -> None:
    """Write how the rod in the middle pulls, which both halves read."""
    middle = len(angles) // 2
    write_pulls(room.rows, angles, share, middle, middle + 1)


@compiled_for_threads
def _eliminate_half(chain: Chain, room: Room, angles: FloatArray, share: float, outer: bool) -> Carried:
    """Eliminate the rods on one side of the middle towards it."""
    n, along, couplings = len(angles), pulled_along(share), chain.couplings
    middle, carried = n // 2, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if outer:
        write_pulls(room.rows, angles, share, middle + 1, n)
        for i in range(n - 1, middle, -1):
            carried = eliminate(chain, room, along, share, i, couplings[i], carried)
    else:
        write_pulls(room.rows, angles, share, 0, middle)
        for i in range(middle):
            carried = eliminate(chain, room, along, share, i, couplings[i + 1], carried)
    return carried


@compiled_for_threads
def _meet(
    chain: Chain, room: Room, angles: FloatArray, share: float, left: Carried, right: Carried
) -> tuple[float, float, float]:
    return meet(chain, room, share, len(angles) // 2, left, right)


@compiled_for_threads
def _substitute_half(
    chain: Chain, room: Room, angles: FloatArray, share: float, x: float, y: float, outer: bool
) -> float:
    """Change the rods on one side of the middle, whose pull changed by (x, y); the largest turn, rad."""
    n, along, couplings, kept, worst = len(angles), pulled_along(share), chain.couplings, room.kept, 0.0
    middle = n // 2
    if outer:
        for i in range(middle + 1, n):
            r_x, r_y = kept[i, 4] + couplings[i] * x, kept[i, 5] + couplings[i] * y
            x, y, worst = substitute(room, along, i, r_x, r_y, worst)
    else:
        for i in range(middle - 1, -1, -1):
            r_x, r_y = kept[i, 4] + couplings[i + 1] * x, kept[i, 5] + couplings[i + 1] * y
            x, y, worst = substitute(room, along, i, r_x, r_y, worst)
    return worst


def largest(*turns: float) -> float:
    """The largest of them, or nan."""
    return math.nan if any(map(math.isnan, turns)) else max(turns)


def _iterate(chain: Chain, room: Room, angles: FloatArray, share: float) -> float:
    """One of Newton's steps; returns the largest change of an angle, rad, or nan."""
    its = (chain, room, angles, share)
    _pull_middle(room, angles, share)
    left, right = both(_eliminate_half, (*its, False), (*its, True))
    x, y, turn = _meet(*its, left, right)
    return largest(turn, *both(_substitute_half, (*its, x, y, False), (*its, x, y, True)))


def propose_halves(chain: Chain, state: State, member: int, h: float, guess: int) -> None:
    """The same as `rods.propose`."""
    _each_half(_propose, chain, state, member, h, guess, rods=len(state.q))


def close_halves(chain: Chain, room: Room, angles: FloatArray, share: float, tolerance: float) -> bool:
    """The same as `closing.close`."""
    n, before = len(angles), math.inf
    turn = max(_each_half(_keep_guess, room, angles, rods=n))
    for count in range(MOST_ITERATIONS):
        worst = _iterate(chain, room, angles, share)
        if closed(worst, before, min(tolerance, turn * turn)):
            _each_half(_settle, room, share, rods=n)
            return True
        if lost(worst, before, count):
            return False
        before = worst
    return False


def accept_halves(chain: Chain, state: State, member: int, h: float) -> None:
    """The same as `rods.accept`."""
    n = len(state.q)
    if member == CONSERVING:
        _each_half(_pull_along_means, state, h, rods=n)
        _each_half(_accelerate, chain, state, h, rods=n)
    _each_half(_accept, chain, state, member, h, rods=n)
    state.steps[STEP_BEFORE], state.steps[STEP] = state.steps[STEP], h


def accept_calm_halves(chain: Chain, state: State, h: float, most: float) -> bool:
    """The same as `rods.accept_calm`."""
    if most < math.inf and rise(chain, state, EULER, h) > most:
        return False
    accept_halves(chain, state, EULER, h)
    return True
