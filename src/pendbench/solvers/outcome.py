"""How a solver that chooses its own steps says how it ended, and how Python calls its compiled loop.

Python answers an interrupt (Ctrl-C, a notebook's stop button) between two calls of compiled code and nowhere else. So a
loop stops after a bounded amount of work, and is called again. And it returns a plain tuple: for a NamedTuple numba
calls Python before it has returned, does not see that an interrupt made that call fail, and the process crashes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

DONE, TOO_SMALL, TOO_MANY, NOT_FINITE = 0, 1, 2, 3
#: Not a way to give up: the run was to end where its state passes a limit.
CROSSED = 4
#: Neither: the loop has done its share of work and wants to be called again.
PAUSED = 5

#: What each outcome but DONE is called: a status of `faults.STATUSES`, and the reason.
REASONS = {
    TOO_SMALL: ("work limit", "the step fell below the smallest allowed"),
    TOO_MANY: ("work limit", "more steps than allowed"),
    NOT_FINITE: ("not finite", "the derivative is not finite"),
}

#: What a compiled loop returns: the fields of `Reached`.
Ended = tuple[int, float, float, int, int]

# Floating-point numbers that a loop may write between two calls: some tens of milliseconds of work.
_WORK = 2_000_000


class Reached(NamedTuple):
    """How an integration ended: DONE or why not, the time reached, the next step (s), steps accepted and rejected."""

    outcome: int
    t: float
    h: float
    accepted: int
    rejected: int


def steps_at_once(numbers: int) -> int:
    """After how many steps a loop that writes so many numbers in each should return to Python."""
    return max(1, _WORK // numbers)


def run_in_parts(loop: Callable[[float, float, int], Ended], t: float, h: float, most_steps: int) -> Reached:
    """Call `loop(t, h, steps left)` until it is no longer PAUSED; t: where it begins, s, h: its first step, s."""
    so_far = Reached(PAUSED, t, h, 0, 0)
    while so_far.outcome == PAUSED:
        part = Reached(*loop(so_far.t, so_far.h, most_steps - so_far.accepted - so_far.rejected))
        so_far = part._replace(accepted=so_far.accepted + part.accepted, rejected=so_far.rejected + part.rejected)
    return so_far
