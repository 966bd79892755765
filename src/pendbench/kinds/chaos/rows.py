"""The rows of the tables of `chaos`, and what the starts and steps of a case show together."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from pendbench.base.faults import STATUSES, Fault
from pendbench.kinds.chaos.work import THRESHOLDS, ChaosRun, KeptExponent, Neighbour
from pendbench.measures.divergence import Crossing
from pendbench.measures.orders import OrderFit
from pendbench.report.names import OfRun, OfTruth
from pendbench.scene.scene import Scene
from pendbench.study.case import Case
from pendbench.study.flags import of_steps, too_good
from pendbench.study.models import Model
from pendbench.study.timing import Timed
from pendbench.study.truths import KeptTruth

#: The place of 1e-2 in `THRESHOLDS`: whoever is farther from the truth has left it.
LEFT: Final = THRESHOLDS.index(1e-2)


@dataclass(frozen=True, eq=False)
class SceneRow(OfTruth):
    """A scene, the truth of each of its starts (its own first), and what is known of its motion."""

    scene: Scene
    truths: Sequence[KeptTruth]
    exponent: KeptExponent
    neighbour: Neighbour

    @property
    def truth(self) -> KeptTruth:  # type: ignore[override]
        """The truth of the scene's own start."""
        return self.truths[0]

    @property
    def horizons(self) -> list[float]:
        """The horizon of each start, s."""
        return [truth.horizon for truth in self.truths]

    @property
    def lyapunov(self) -> float:
        """The exponent, 1/s; nan where the motion is regular."""
        return self.exponent.rate if self.exponent.chaotic else math.nan

    @property
    def still(self) -> bool:
        """Whether nothing moves."""
        return self.truth.is_still


@dataclass(frozen=True, eq=False)
class MethodRow:
    """The three causes for one scene and method, over its steps.

    case: the method. order_claimed: by its makers; None where it chooses its steps. growth: the median of all, 1/s.
    """

    case: Case
    scene: SceneRow
    model: Model
    order_claimed: int | None
    fit: OrderFit
    growth: float

    @property
    def another_system(self) -> bool:
        """Whether the engine simulates another system with it."""
        return self.model.is_another()

    @property
    def cause(self) -> str:
        """What makes this method leave the truth."""
        if self.scene.still:
            return "none: nothing moves"
        if self.another_system:
            return "model"
        if all(map(math.isnan, (self.model.error, self.fit.order, self.growth))):
            return "not known"
        return "integration, amplified by chaos" if self.scene.exponent.chaotic else "integration"


@dataclass(frozen=True)
class Departure:
    """When the error passes a threshold, s, over the starts of a case.

    median: a start that does not get there before its horizon counts as later than all that do; nan where the median
    falls on one. last: nan where any does not get there. not_reached: how many do not. band: the widest gap between
    the samples before and after.
    """

    median: float
    first: float
    last: float
    not_reached: int
    band: float

    @property
    def median_is_later(self) -> bool:
        """Whether the median start is still there at its horizon."""
        return math.isnan(self.median) and self.not_reached > 0


def departure(crossings: Sequence[Crossing | None]) -> Departure:
    """The departure of a case that passed a threshold so from each of its starts."""
    found = [crossing for crossing in crossings if crossing is not None]
    times = sorted(crossing.time for crossing in found)
    return Departure(
        median=_median(times, len(crossings)),
        first=times[0] if times else math.nan,
        last=times[-1] if times and len(times) == len(crossings) else math.nan,
        not_reached=len(crossings) - len(times),
        band=max((crossing.high - crossing.low for crossing in found), default=math.nan),
    )


def _median(times: Sequence[float], total: int) -> float:
    """The median of `total` times of which only `times` (sorted) are known, the others being later."""
    low, high = (total - 1) // 2, total // 2
    return 0.5 * (times[low] + times[high]) if total and high < len(times) else math.nan


@dataclass(frozen=True, eq=False)
class CaseRow:
    """A case: what it did from each start (its scene's own first), why, and what it costs.

    refusal: why it was not run, where its engine refuses it; there are no runs then.
    """

    case: Case
    scene: SceneRow
    method: MethodRow
    runs: Sequence[ChaosRun]
    refusal: Fault | None
    timing: Timed

    @property
    def own(self) -> ChaosRun:
        """The run from the scene's own start."""
        return self.runs[0] if self.runs else ChaosRun("refused")

    @property
    def status(self) -> str:
        """How the case ended: as the worst of its starts did."""
        return self._worst[0]

    @property
    def reason(self) -> str:
        """Why that start did not end well, and why nothing was compared, where that is so."""
        untold = "" if len(self.scene.truth.t) or self.refusal else _untold(self.scene.truth)
        return "; ".join(filter(None, [self._worst[1], untold]))

    @cached_property
    def _worst(self) -> tuple[str, str]:
        if self.refusal is not None:
            return self.refusal.status, self.refusal.reason
        ranks = list(STATUSES)
        at, run = max(enumerate(self.runs), key=lambda pair: ranks.index(pair[1].status))
        where = f" (start {at} of {len(self.runs) - 1})" if at and run.reason else ""
        return run.status, run.reason + where

    @cached_property
    def departures(self) -> tuple[Departure, ...]:
        """Of each of `THRESHOLDS`, over the starts that were compared."""
        compared = [run.crossings for run in self.runs if run.crossings]
        return tuple(departure([crossings[at] for crossings in compared]) for at in range(len(THRESHOLDS)))

    @property
    def left(self) -> Departure:
        """When it leaves the truth."""
        return self.departures[LEFT]

    @property
    def share(self) -> float:
        """For how much of the horizon it stays with the truth: the median over the starts, each by its own horizon.

        0 where that is not known: it never came to be compared.
        """
        shares = sorted(
            1.0 if crossing is None else min(1.0, crossing.time / truth.horizon)
            for run, truth in zip(self.runs, self.scene.truths, strict=False)
            if run.crossings and truth.horizon > 0
            for crossing in [run.crossings[LEFT]]
        )
        return 1.0 if self.left.median_is_later else _median(shares, len(shares)) if shares else 0.0

    @property
    def stays_until(self) -> float:
        """When the median start leaves the truth, s; its horizon where it does not; nan where that is not known."""
        return self.scene.truth.horizon if self.left.median_is_later else self.left.median

    @property
    def cost_ms(self) -> float:
        """Ms of computing for a simulated second; nan where that is not known."""
        speed = self.timing.simulated_s_per_s
        return 1e3 / speed if speed > 0 else math.nan

    @property
    def flags(self) -> str:
        """What a reader should know about the row."""
        return "; ".join(self._flags)

    @property
    def _flags(self) -> Iterator[str]:
        method, own = self.method, self.own
        if method.another_system:
            yield f"another system: accelerations differ by {method.model.error:.1e}"
        if self.scene.still:
            yield "nothing moves"
        else:
            plateau = math.nan if method.fit.plateau is None else method.fit.plateau
            yield from of_steps(method.order_claimed, method.fit.order, plateau)
            yield from too_good(own.error_max, own.error_half, own.known_half, own.too_good)
        if method.model.status not in ("ok", "refused"):
            yield f"model not compared: {method.model.status}, {method.model.reason}"
        if self.refusal is None:
            yield from self.timing.flags


def _untold(truth: KeptTruth) -> str:
    return f"not compared, for want of a truth: {truth.reason}"


@dataclass(frozen=True)
class StartRow(OfRun):
    """One start of a case. start: 0 is the scene's own."""

    case: Case
    start: int
    run: ChaosRun
    horizon: float


@dataclass(frozen=True)
class CurveRow:
    """One sample of a case from its scene's own start; error: nan past the horizon."""

    case: Case
    t_s: float
    error: float
    energy_error: float
