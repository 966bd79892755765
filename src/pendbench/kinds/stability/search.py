"""Which step to try next, and which is the largest that holds.

A step whose verdict is not known neither holds nor fails. So what is found is the same on any machine, or is not given.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final

from pendbench.measures.verdict import is_known

#: The verdicts of the steps that were tried, by step, s.
Tried = Mapping[float, str]

#: How well the largest stable step is known: to this factor.
PRECISION: Final = 1.1
#: By this much a step is finer than the last, where none holds yet.
FINER: Final = 5.0

_HOLDS: Final = ("holds",)


@dataclass(frozen=True)
class Bounds:
    """The steps that may be tried, s."""

    coarsest: float
    finest: float


def next_step(tried: Tried, bounds: Bounds) -> float | None:
    """The next step to try, s; None where nothing is left to learn, or nothing can be learnt.

    Halves, on a logarithmic scale, what lies between the largest step that holds and the next one; finds both first.
    """
    low = max(_those(tried, _HOLDS), default=None)
    if low is None:
        return _finer(min(tried), tried, bounds)
    above = [dt for dt in tried if dt > low]
    if not all(is_known(tried[dt]) for dt in above):
        return None
    if not above:
        return _rounded(2.0 * low) if 2.0 * low <= bounds.coarsest * (1 + 1e-9) else None
    return _rounded(math.sqrt(low * min(above))) if min(above) > PRECISION * low else None


def _finer(last: float, tried: Tried, bounds: Bounds) -> float | None:
    """A finer step than the last, unless that one took too much already."""
    dt = _rounded(last / FINER)
    return dt if is_known(tried[last]) and dt >= bounds.finest else None


def largest(tried: Tried, verdicts: Collection[str] = _HOLDS) -> float:
    """The largest step with one of these verdicts, s; nan without, or where a larger one's verdict is not known."""
    found = max(_those(tried, verdicts), default=math.nan)
    return math.nan if any(dt > found and not is_known(word) for dt, word in tried.items()) else found


def is_bound(tried: Tried) -> bool:
    """Whether the largest step that holds is the largest of all that were tried."""
    return largest(tried) == max(tried, default=math.nan)


def is_open(tried: Tried, bounds: Bounds) -> bool:
    """Whether runs that were stopped, or not begun, could tell more. bounds: those without a limit of work."""
    if any(_those(tried, _HOLDS)):
        return math.isnan(largest(tried))
    return not all(map(is_known, tried.values())) or (bool(tried) and next_step(tried, bounds) is not None)


def _those(tried: Tried, verdicts: Collection[str]) -> list[float]:
    return [dt for dt, word in tried.items() if word in verdicts]


def _rounded(dt: float) -> float:
    """To four digits: a step that people can type."""
    return float(f"{dt:.4g}")
