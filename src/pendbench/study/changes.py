"""Whether a number got better or worse, or moved only as rounding, chaos or a busy machine moves it.

`--check` and `pendbench compare` tell it alike. Where a study compares up to the horizon, errors are those up to half
of it: later, chaos makes numbers of rounding. Below a floor growth is rounding, and a run that has lost the truth is as
far from it as chance will have it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Final, NamedTuple

from pendbench.study.timing import SPREAD_LIMIT

ACCURACY, STABILITY, COST, ENERGY = "accuracy", "stability", "cost", "energy"
BETTER, WORSE, SAME, UNTOLD = "better", "worse", "same", "not told"

#: How much larger a number may be than it was. Other processors and libraries round otherwise; half as much again is
#: no rounding.
_BAND: Final = 1.5
#: An error beyond this, in lengths of the chain, is that of a run which has lost the truth.
_LOST: Final = 0.1


class Range(NamedTuple):
    """Between which values a number was: those of repeated runs, or of the samples of one; one number: both alike."""

    low: float
    high: float


@dataclass(frozen=True)
class Measure:
    """A column that is compared. about: what it tells. allowed: from where to where a number may be that was such.

    of_method: whether it is of all the steps of a method.
    """

    name: str
    about: str
    allowed: Callable[[float], Range]
    of_method: bool = False

    def moved(self, was: float, now: float) -> bool:
        """Whether a number is where it may not be; one that is no longer there is."""
        low, high = self.allowed(was)
        return not low <= now <= high


def grown(floor: float, lost: float = math.inf) -> Callable[[float], Range]:
    """What a number may be that should not grow: half as much again, or the floor. lost: from where on it is chance."""
    return lambda was: Range(-math.inf, max(_BAND * was, floor) if was < lost else math.inf)


#: What may grow, and the floor below which growth is rounding.
GROWS: Final = (
    Measure("error_half", ACCURACY, grown(1e-10, _LOST)),
    Measure("energy_drift_half", ENERGY, grown(1e-12)),
    Measure("error_max", ACCURACY, grown(1e-12, _LOST)),
    Measure("energy_drift_max", ENERGY, grown(1e-12)),
    Measure("energy_error", ENERGY, grown(1e-12)),
    Measure("balance_error", ENERGY, grown(1e-10)),
    Measure("gap_max", STABILITY, grown(1e-9)),
    # Of solvers that iterate: their positions are rounded before they are divided by the step.
    Measure("model_error", ACCURACY, grown(1e-7)),
)
#: Numbers for studies that do not have the other ones.
_INSTEAD: Final = {"error_max": "error_half", "energy_drift_max": "energy_drift_half"}
#: What is as bad where it falls as where it grows.
ORDER: Final = Measure("order_observed", ACCURACY, lambda was: Range(was - 0.2, was + 0.2), of_method=True)
#: What may grow but not shrink: to four fifths of what it was.
STABLE_DT: Final = Measure("stable_dt", STABILITY, lambda was: Range(0.8 * was, math.inf), of_method=True)
#: Numbers of the clock, which no baseline has; a tenth more or less is what a calm machine does by itself.
TIMES: Final = tuple(
    Measure(name, COST, lambda was: Range(-math.inf, (1 + SPREAD_LIMIT) * was))
    for name in ("step_us", "run_s", "chain_us")
)
#: When chaos has made the error plain. A Range of it says what starts and rounding make of it, so no more is allowed.
DIVERGES: Final = Measure("t_1e-2_s", ACCURACY, lambda was: Range(was, math.inf))
REPRODUCED: Final = (*GROWS, ORDER, STABLE_DT)


def told_by(columns: Collection[str]) -> tuple[Measure, ...]:
    """What is compared in a study whose cases have these columns, but for the clock.

    Where a verdict says how large an error is, runs that broke would only add numbers of chance.
    """
    grows = () if "verdict" in columns else GROWS
    chosen = [each for each in grows if _INSTEAD.get(each.name) not in columns]
    return tuple(each for each in (*chosen, ORDER, STABLE_DT) if each.name in columns)


def change(measure: Measure, was: Range, now: Range, claimed: float = math.nan) -> str:
    """Whether a number got better or worse. claimed: the order that a method claims, for one that it shows.

    It did where each value that it may have had is beyond what each that it may have now allows.
    """
    pairs = [(before, after) for before in was for after in now]
    worse = all(measure.moved(before, after) for before, after in pairs)
    better = all(measure.moved(after, before) for before, after in pairs)
    if worse and better:  # an order, which may not move either way, or a number that is missing on one side
        if any(math.isnan(each) for each in (*was, *now)):
            worse = all(map(math.isnan, now))
            return WORSE if worse else BETTER
        return BETTER if abs(now.low - claimed) < abs(was.low - claimed) else WORSE
    return WORSE if worse else BETTER if better else SAME
