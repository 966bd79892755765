"""What a check is, and what it finds: data, so that whoever shows it needs to know no check."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.errors import describe
from pendbench.engines.protocol import Engine

#: How a check can end. "error": it could not be run to its end. "skipped": it says nothing here, and why.
PASSED, FAILED, ERROR, SKIPPED = "passed", "failed", "error", "skipped"
#: Two runs that differ by rounding only: what adaptive methods and iterations may leave.
_LEFT: Final = 1e-9


class SkippedError(Exception):
    """A check has nothing to measure here; the message says why."""


@dataclass(frozen=True)
class Subject:
    """What is checked: an engine by one of its methods ("" for the engine as a whole), from random states of a seed."""

    engine: Engine
    method: str = ""
    seed: int = 0

    @property
    def adaptive(self) -> bool:
        """Whether the method chooses its steps."""
        return self.engine.methods[self.method].adaptive

    @property
    def order(self) -> int:
        """The order that the method claims."""
        return self.engine.methods[self.method].order

    @property
    def single(self) -> bool:
        """Whether the method says that it computes in single precision."""
        return self.engine.methods[self.method].single

    @property
    def plateau(self) -> float:
        """The error that no step brings the method below, by its own account."""
        return self.engine.methods[self.method].plateau

    @property
    def eps(self) -> float:
        """How far apart neighbouring numbers are, over their size, in the precision that the method declares."""
        return float(np.finfo(np.float32 if self.single else np.float64).eps)

    def rounding(self, steps: int) -> float:
        """How far two runs of so many steps may part by rounding alone, or a plateau, rad or rad/s."""
        return max(_LEFT, 20.0 * steps * self.eps, self.plateau)

    def slack(self, orders: float) -> float:
        """How far an order may be off; in single precision it is seen at coarser steps, farther from its limit."""
        return 2.5 * orders if self.single or self.plateau else orders

    def random(self) -> np.random.Generator:
        """Random numbers that each check has for itself."""
        return np.random.default_rng(self.seed)


class Reading(NamedTuple):
    """One number that a check has measured, and the most that it may be. cause: what is wrong where it is more.

    about: which chain or effect, where a check reads several.
    """

    value: float
    limit: float
    cause: str
    about: str = ""


def broken(cause: str, about: str = "") -> Reading:
    """A promise that is broken: one, where none may be."""
    return Reading(1.0, 0.0, cause, about)


def kept(about: str = "") -> Reading:
    """A promise that is kept."""
    return Reading(0.0, 0.0, "", about)


Measure = Callable[[Subject], Iterator[Reading]]


@dataclass(frozen=True)
class Check:
    """A question to every method, with the measurement that answers it.

    asks: the question. unit: of what is measured. limit_from: where the limit comes from. needs: names of checks
    without which this one says nothing. whole: it is asked of the engine, and not of each method.
    """

    name: str
    measure: Measure
    asks: str
    unit: str
    limit_from: str
    needs: tuple[str, ...] = ()
    whole: bool = False


#: Where the limit of a promise comes from, which is kept or not.
PROTOCOL: Final = "the protocol: none may be broken"
BROKEN: Final = "broken promises"


def check(
    *, asks: str, unit: str = BROKEN, limit_from: str = PROTOCOL, needs: tuple[str, ...] = (), whole: bool = False
) -> Callable[[Measure], Check]:
    """Make a check of a function that measures; the function's name in words is the check's."""

    def made(measure: Measure) -> Check:
        return Check(measure.__name__.replace("_", " "), measure, asks, unit, limit_from, needs, whole)

    return made


@dataclass(frozen=True)
class Finding:
    """What a check found: value and limit in `unit`, nan where there is none, and what is wrong where it did not pass.

    method: "" where it is about the engine as a whole. about: which chain or effect, "" where there is but one.
    """

    check: str
    method: str
    about: str
    status: str
    value: float
    limit: float
    unit: str
    limit_from: str
    cause: str

    @property
    def good(self) -> bool:
        """Whether there is nothing to complain of."""
        return self.status in (PASSED, SKIPPED)

    @property
    def line(self) -> str:
        """What is wrong, in one line."""
        about = f"{self.about}: " if self.about else ""
        return f"{f'{self.method}, ' if self.method else ''}{self.check}: {about}{self.cause}"


def findings(asked: Check, its: Subject) -> list[Finding]:
    """What a check finds; one of them may be that it could not be run to its end."""
    found: list[Finding] = []
    try:
        found.extend(_finding(asked, its, reading) for reading in asked.measure(its))
    except SkippedError as nothing:
        found.append(without(asked, its.method, SKIPPED, str(nothing)))
    except SystemExit as error:
        found.append(without(asked, its.method, ERROR, f"tried to exit the program ({describe(error)})"))
    except Exception as error:
        found.append(without(asked, its.method, ERROR, f"raised {describe(error)}"))
    return found or [without(asked, its.method, SKIPPED, "there is nothing to measure")]


def _finding(asked: Check, its: Subject, reading: Reading) -> Finding:
    passed = reading.value <= reading.limit
    cause = "" if passed else reading.cause
    status = PASSED if passed else FAILED
    numbers = float(reading.value), float(reading.limit)
    return Finding(asked.name, its.method, reading.about, status, *numbers, asked.unit, asked.limit_from, cause)


def without(asked: Check, method: str, status: str, cause: str) -> Finding:
    """A check that measured nothing, and why."""
    return Finding(asked.name, method, "", status, math.nan, math.nan, asked.unit, asked.limit_from, cause)
