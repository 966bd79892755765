"""Which chain to try next against the clock, and with which step: the same search for every title."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from pendbench.kinds.scaling.work import RaceRun
from pendbench.measures.titles import Judged, Title
from pendbench.scene.scene import MAX_LINKS

#: Steps of the trials: each is about so many times shorter than the one before.
FINER: Final = 1.5
#: How well the longest chain is known: to this factor.
PRECISION: Final = 1.1

_FEWEST: Final = 8

#: How many finer steps are tried of a method that divides its steps, where one is too slow.
_TRIED_FINER: Final = 3


@dataclass(frozen=True)
class Ladder:
    """The steps of the trials, s: whole parts of the coarsest, so that chains are looked at at the same times.

    fixed: whether the method takes them at all, or chooses its own. shrinks: whether a longer chain begins with a step
    that is as much shorter. divides: whether the method divides steps that are too long, so that a finer one may be
    faster.
    """

    coarsest: float
    finest: float
    fixed: bool
    shrinks: bool = True
    divides: bool = False

    def first(self, best: Trial, n: int) -> float:
        """The step with which to begin with a chain of n links, after a shorter one that held."""
        return self.rung_above(best.dt * best.n / n) if self.shrinks else self.coarsest

    def rung_above(self, wanted: float) -> float:
        """The step of the ladder that is next coarser than the one wanted; the coarsest, if there is none."""
        parts = 1
        while self.coarsest / _finer(parts) > wanted:
            parts = _finer(parts)
        return self.coarsest / parts

    def finer(self, dt: float) -> float | None:
        """The next rung; None where there is none."""
        finer = self.coarsest / _finer(round(self.coarsest / dt))
        return finer if self.fixed and finer >= self.finest else None


def _finer(parts: int) -> int:
    return math.ceil(FINER * parts)


@dataclass(frozen=True)
class Trial:
    """A chain of n links with a step dt (s), and how it fared with a title."""

    n: int
    dt: float
    run: RaceRun
    outcome: str
    reason: str = ""

    @property
    def held(self) -> bool:
        """Whether it won the title."""
        return self.outcome == "held"


def trial_of(title: Title, n: int, dt: float, run: RaceRun) -> Trial:
    """How a run fared with a title: where it came to no end, that is its status."""
    judged = title.judge(run.shown) if run.status == "ok" else Judged(run.status, run.reason)
    return Trial(n, dt, run, *judged)


def best_of(trials: Sequence[Trial]) -> Trial | None:
    """The longest chain that held; of its trials the first."""
    return max((trial for trial in trials if trial.held), key=lambda trial: trial.n, default=None)


def nearest_beyond(trials: Sequence[Trial]) -> Trial | None:
    """The shortest chain beyond the longest that held, with its finest step."""
    best = best_of(trials)
    beyond = [trial for trial in trials if best is None or trial.n > best.n]
    return min(beyond, key=lambda trial: (trial.n, trial.dt), default=None)


def next_trial(trials: Sequence[Trial], ladder: Ladder) -> tuple[int, float] | None:
    """How many links, and which step, s; None where the longest chain is known."""
    if not trials:
        return _FEWEST, ladder.rung_above(ladder.coarsest)
    last = trials[-1]
    if _finer_may_hold(trials, ladder) and (finer := ladder.finer(last.dt)) is not None:
        return last.n, finer
    best = best_of(trials)
    if best is None:
        return (last.n // 2, ladder.rung_above(ladder.coarsest)) if last.n > 1 else None
    n = _next_length(trials, best.n)
    return None if n is None else (n, ladder.first(best, n))


def _finer_may_hold(trials: Sequence[Trial], ladder: Ladder) -> bool:
    last = trials[-1]
    slow = sum(trial.n == last.n and trial.outcome == "too slow" for trial in trials)
    return last.outcome == "lost" or (last.outcome == "too slow" and ladder.divides and slow <= _TRIED_FINER)


def _next_length(trials: Sequence[Trial], longest: int) -> int | None:
    """Twice the longest chain that held, or half way, on a logarithmic scale, to the next one that did not."""
    above = [trial.n for trial in trials if trial.n > longest]
    n = round(math.sqrt(longest * min(above))) if above else 2 * longest
    if n > MAX_LINKS or (above and (min(above) <= PRECISION * longest or n in (longest, min(above)))):
        return None
    return n
