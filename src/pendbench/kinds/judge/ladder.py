"""Which step to try next, coarse to fine, and which to recommend.

A rung is a step of the interval over 2^rung, so that all runs have the very times that are compared in common; of a
method that chooses its steps, it is a tolerance of 10^-(rung + 2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

#: A run takes no more steps than these, nor links times steps than those.
_MOST_STEPS: Final = 1e5
_MOST_WORK: Final = 1e6
_LOOSEST, _TIGHTEST = 2, 14
#: From here down the error tells how it falls.
_SMALL: Final = 0.05

#: The largest error with each rung that was tried; nan where the run did not reach the end.
Errors = Mapping[int, float]


def last_rung(n: int, span: float, interval: float) -> int:
    """The finest rung of a fixed step for n links over `span` (s), with samples every `interval` (s)."""
    most = max(min(_MOST_STEPS, _MOST_WORK / n), 100.0)
    return max(0, math.floor(math.log2(most * interval / span)))


def last_tolerance() -> int:
    """The finest rung of a tolerance."""
    return _TIGHTEST - _LOOSEST


def step(interval: float, rung: int) -> float:
    """The step of a rung, s."""
    return math.ldexp(interval, -rung)


def tolerance(rung: int) -> float:
    """The tolerance of a rung."""
    return float(f"1e-{rung + _LOOSEST}")


def recommended(errors: Errors, goal: float, last: int) -> int | None:
    """The coarsest rung that reaches the goal, as do all finer ones that were tried, of which there is one at least.

    A coarse step can be good by chance: two errors cancel. Where there is one rung alone, nothing can confirm it.
    """
    reached = None
    for rung in sorted(errors, reverse=True):
        if not errors[rung] <= goal:
            break
        reached = rung
    return None if reached == max(errors, default=None) and last else reached


def next_rung(errors: Errors, goal: float, last: int) -> int | None:
    """The rung to try next; None where the goal is reached and confirmed, or out of reach."""
    if not errors:
        return 0
    if recommended(errors, goal, last) is not None:
        return None
    tried = max(errors)
    return None if tried >= last or tried + needed(errors, goal) > last + 1 else tried + 1


def needed(errors: Errors, goal: float) -> int:
    """How many rungs more the goal would take, by the order with which the error falls; 1 where that is not known."""
    rungs = sorted(errors)[-3:]
    values = [errors[rung] for rung in rungs]
    if len(rungs) < 3 or not all(goal < value < _SMALL for value in values):
        return 1
    falls = min(math.log(values[0] / values[1]), math.log(values[1] / values[2]))
    return math.ceil(math.log(values[2] / goal) / falls) if falls > 0.1 else 1
