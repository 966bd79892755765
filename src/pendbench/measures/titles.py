"""Titles of long chains: what a run that keeps up with the clock has shown, and which of them it has won by that.

Each asks for something else, and is judged by the same record. docs/measuring.md, "Scaling".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from pendbench.measures.coarse_motion import CoarseErrors, why_it_moves_badly
from pendbench.measures.verdict import HOLDS

#: How far, in lengths of the chain, a faithful run may be from a motion that can still be predicted.
FAITHFUL: Final = 0.01

_NOTHING_OFF: Final = CoarseErrors(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Shown:
    """What a run has shown up to `reached` s, of the `length` s that it is to last, stepping for `spent` s.

    fault: what its engine says is wrong with it. strays, risen: by how much its energy was off at most, and above what
    it was before, and lost: how much less of it there is than at the start, all in energy scales. gap: the worst rod's
    relative error. error: the largest e(t) while the motion can be predicted; coarse: the errors of the coarse motion
    in the first swing; both nan where there is nothing to compare with.
    """

    length: float = math.nan
    reached: float = 0.0
    spent: float = 0.0
    fault: str = ""
    strays: float = 0.0
    risen: float = 0.0
    lost: float = 0.0
    gap: float = 0.0
    error: float = math.nan
    coarse: CoarseErrors = field(default_factory=CoarseErrors)

    @property
    def late(self) -> bool:
        """Whether stepping has taken longer than the motion lasts."""
        return self.spent > self.length

    @property
    def whole(self) -> bool:
        """Whether it came to its end."""
        return self.reached >= self.length


class Judged(NamedTuple):
    """outcome: held, lost, too slow, not known (what it is compared with), or unfinished; and why, if not held."""

    outcome: str
    reason: str = ""


@dataclass(frozen=True)
class Title:
    """asks: for what, in a sentence. fails: why a run that has shown so much cannot win it; empty while it can.

    compared: the error that it asks for; None where nothing has to be known of the motion. afar: whether what it asks
    for can be had with the same step in longer chains; else steps shrink as links do.
    """

    name: str
    asks: str
    fails: Callable[[Shown], str]
    compared: Callable[[Shown], float] | None = None
    afar: bool = False

    def judge(self, shown: Shown) -> Judged:
        """What a run has won by what it has shown."""
        if wrong := self.fails(shown):
            return Judged("lost", wrong)
        if shown.late:
            return Judged("too slow", f"{shown.reached:.3g} s of motion took {shown.spent:.3g} s")
        if not shown.whole:
            return Judged("unfinished")
        if self.compared is not None and math.isnan(self.compared(shown)):
            return Judged("not known", "no converged solution to compare with")
        return Judged("held")


def _energy_is_lost(shown: Shown) -> str:
    if shown.fault:
        return shown.fault
    if not shown.gap < HOLDS:
        return f"a rod is off its length by {shown.gap:.2g} of it"
    return "" if shown.strays < HOLDS else f"the energy strays by {shown.strays:.2g} of its scale"


def _is_unfaithful(shown: Shown) -> str:
    off = f"off by {shown.error:.2g} of the length while the motion can be predicted"
    return _energy_is_lost(shown) or (off if shown.error >= FAITHFUL else "")


def _moves_badly(shown: Shown) -> str:
    known = _NOTHING_OFF if math.isnan(shown.coarse.worst) else shown.coarse
    return shown.fault or why_it_moves_badly("ok", shown.risen, shown.gap, known)


#: Every title, the strictest first.
TITLES: Final = (
    Title(
        "faithful",
        "energy within 1 %, and within 1 % of the length of the true motion as long as that can be predicted",
        _is_unfaithful,
        lambda shown: shown.error,
    ),
    Title("energy", "energy within 1 %", _energy_is_lost),
    Title(
        "moves well",
        "an energy that never rises by 1 %, and the coarse motion of the first swing within 2 % of the length",
        _moves_badly,
        lambda shown: shown.coarse.worst,
        afar=True,
    ),
)


def title_of(name: str) -> Title:
    """The title of that name. Raises StopIteration where there is none."""
    return next(title for title in TITLES if title.name == name)
