"""Where a motion between two states passes a border: on the cubic through both."""

from __future__ import annotations

import numpy as np

from pendbench.base.compiled import compiled_for_threads, inlined

# Of an interval that holds a crossing: to its rounding.
_HALVINGS = 50


@compiled_for_threads
def first_crossing(q0: float, v0: float, q1: float, v1: float, border: float) -> float:
    """Where, from 0 to 1, the cubic with values q and slopes v at its ends passes +-border; inf where it does not.

    q0 is within the border. Where q1 is too, the cubic may turn back beyond it: where its slope, of one sign before and
    of the other after, is 0. A cubic that turns twice within the step is not followed: steps are too short for that.
    """
    turn = 1.0
    if abs(q1) <= border:
        if v0 * v1 >= 0.0:
            return np.inf
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            turn = 0.5 * (low + high)
            low, high = (turn, high) if _slope(q0, v0, q1, v1, turn) * v0 > 0.0 else (low, turn)
    furthest = _cubic(q0, v0, q1, v1, turn)
    if abs(furthest) <= border:
        return np.inf
    side = 1.0 if furthest > 0.0 else -1.0
    low, high = 0.0, turn
    for _ in range(_HALVINGS):
        s = 0.5 * (low + high)
        low, high = (low, s) if side * _cubic(q0, v0, q1, v1, s) > border else (s, high)
    return high


@inlined
def _cubic(q0: float, v0: float, q1: float, v1: float, s: float) -> float:
    """Hermite's cubic at s, from 0 to 1."""
    r = 1.0 - s
    return r * r * (1.0 + 2.0 * s) * q0 + s * s * (3.0 - 2.0 * s) * q1 + s * r * (r * v0 - s * v1)


@inlined
def _slope(q0: float, v0: float, q1: float, v1: float, s: float) -> float:
    """The slope of that cubic."""
    r = 1.0 - s
    return 6.0 * s * r * (q1 - q0) + r * (1.0 - 3.0 * s) * v0 + s * (3.0 * s - 2.0) * v1
