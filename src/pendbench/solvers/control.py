"""Step control, for every method that chooses its steps: what is allowed, how far to go, and what an error says.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.4.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.compiled import inlined

#: A first step to try, s. Error control shrinks it where it is too large.
FIRST_STEP = 1e-3

#: The next step: so much of what error control would allow, and so many times the last one at most and at least.
SAFETY = 0.9
GROW_AT_MOST = 5.0
SHRINK_AT_MOST = 0.2


class Limits(NamedTuple):
    """What a run may do, and when it gives up.

    The local error allowed in a component y is `tolerance (1 + relative |y|)`; relative: one number, or (d,). A run
    gives up where it needs a step below `smallest` (s), and after `most_steps` accepted or rejected.
    """

    tolerance: float
    relative: Any
    smallest: float
    most_steps: int


def less(limits: Limits, taken: int) -> Limits:
    """What is left of them after so many steps. As `_replace`, in a third of its time."""
    return Limits(limits.tolerance, limits.relative, limits.smallest, limits.most_steps - taken)


class Step(NamedTuple):
    """A step to try: its length and the time that it leads to, s, and whether that is the end."""

    length: float
    target: float
    last: bool


@inlined
def next_step(t: float, end: float, h: float) -> Step:
    """The step from t towards `end` where h is allowed (all s): two equal ones rather than one and a short rest.

    Its length is what rounding makes of it, so that time does not slip.
    """
    left = end - t
    last = h >= left
    step = left if last else (0.5 * left if h > 0.5 * left else h)
    target = end if last else t + step
    return Step(target - t, target, last)


@inlined
def too_short(t: float, h: float, smallest: float) -> bool:
    """Whether h (s) is below the smallest step allowed, or below the rounding of t."""
    return h < smallest or t + 0.1 * h == t


@inlined
def step_factor(error: float, order: int) -> float:
    """By how much the step may change after one whose error is so many times what is allowed."""
    if error == 0.0:
        return GROW_AT_MOST
    if not np.isfinite(error):
        return SHRINK_AT_MOST
    wanted: float = SAFETY * error ** (-1.0 / order)
    return min(GROW_AT_MOST, max(SHRINK_AT_MOST, wanted))


@inlined
def allowed_after(h: float, step: Step, factor: float) -> float:
    """What is allowed after a step that was accepted, where h was before. One cut short to end there says little."""
    grown = step.length * factor
    return max(h, grown) if step.last else grown


@inlined
def allowed_instead(step: Step, factor: float) -> float:
    """What is allowed in place of a step that was rejected."""
    return step.length * min(factor, 1.0)
