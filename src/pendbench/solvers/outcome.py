"""How a solver that chooses its own steps says how it ended."""

from __future__ import annotations

from typing import NamedTuple

DONE, TOO_SMALL, TOO_MANY, NOT_FINITE = 0, 1, 2, 3
#: Not a way to give up: the run was to end where its state passes a limit.
CROSSED = 4

#: What each outcome but DONE is called: a status of `trajectory.STATUSES`, and the reason.
REASONS = {
    TOO_SMALL: ("work limit", "the step fell below the smallest allowed"),
    TOO_MANY: ("work limit", "more steps than allowed"),
    NOT_FINITE: ("not finite", "the derivative is not finite"),
}


class Progress(NamedTuple):
    """How an integration ended: DONE or why not, the time reached, the next step (s), steps accepted and rejected."""

    outcome: int
    t: float
    h: float
    accepted: int
    rejected: int
