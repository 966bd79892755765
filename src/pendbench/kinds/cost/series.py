"""Cases that differ in step or tolerance alone: what a method offers in a scene, and at what price."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.kinds.cost.study import Found, Window
from pendbench.kinds.cost.work import ErrorRun
from pendbench.measures.orders import NO_FIT, OrderFit, observed_order
from pendbench.measures.prices import Price, price_of, price_of_digit
from pendbench.study.case import Case
from pendbench.study.timing import Timed
from pendbench.study.truths import KeptTruth

#: Orders and the price of a digit are looked for between these errors: neither rounding nor large.
ERROR_FLOOR: Final = 1e-12
ERROR_CEILING: Final = 0.03


@dataclass(frozen=True, eq=False)
class Measured:
    """A case, and all that was found of it."""

    case: Case
    window: Window
    truth: KeptTruth
    run: ErrorRun
    timing: Timed

    @property
    def status(self) -> str:
        """How the run ended."""
        return self.run.status

    @property
    def reason(self) -> str:
        """Why it did not end well, or why it has no error."""
        compared = self.status != "ok" or math.isfinite(self.run.error_max)
        return self.run.reason if compared else f"not compared: {self._lacks}"

    @property
    def _lacks(self) -> str:
        truth, until = self.truth, f"{self.window.time:.4g} s"
        if not len(truth.t):
            return f"the truth is not known ({truth.status}: {truth.reason})"
        return f"the truth is known up to {truth.horizon:.4g} s, and not to {until} ({truth.reason})"

    @property
    def tolerance(self) -> float:
        """That of a method that chooses its steps, its default where none is given; nan for other methods."""
        return self.case.tolerance

    @property
    def step(self) -> float:
        """The step, s, or what stands for it: the smaller, the better and the dearer."""
        return self.tolerance if self.case.dt is None else self.case.dt

    @property
    def is_timed(self) -> bool:
        """Whether the cost is known."""
        return 0 < self.timing.run_s < math.inf

    @property
    def is_measured(self) -> bool:
        """Whether both the error and the cost are known."""
        return math.isfinite(self.run.error_max) and self.is_timed

    @property
    def with_states_s(self) -> float:
        """What a caller pays, s, who reads the state after every step, or at every sample of a method without."""
        reads = self.window.samples if self.case.dt is None else max(1, round(self.window.time / self.case.dt))
        return 1e-6 * self.timing.step_and_state_us * reads


@dataclass(frozen=True, eq=False)
class Series:
    """rows: the coarsest step or tolerance first."""

    rows: tuple[Measured, ...]

    @cached_property
    def case(self) -> Case:
        """What the cases have in common: the first of them, its settings without the tolerance."""
        return self.rows[0].case.without_tolerance

    @property
    def is_adaptive(self) -> bool:
        """Whether the method chooses its own steps."""
        return self.rows[0].case.dt is None

    @cached_property
    def timed(self) -> list[Measured]:
        """Those of which the cost is known."""
        return [row for row in self.rows if row.is_timed]

    @property
    def steps(self) -> FloatArray:
        """The steps, s, or tolerances, of those that were timed, (j,)."""
        return np.array([row.step for row in self.timed], dtype=np.float64)

    @property
    def errors(self) -> FloatArray:
        """Their errors, (j,)."""
        return np.array([row.run.error_max for row in self.timed], dtype=np.float64)

    @property
    def costs(self) -> FloatArray:
        """Their costs up to the time of comparison, s, (j,)."""
        return np.array([row.timing.run_s for row in self.timed], dtype=np.float64)

    @property
    def order_claimed(self) -> int | None:
        """By the method's makers; None for a method that chooses its steps."""
        return self.case.order_claimed

    @cached_property
    def fit(self) -> OrderFit:
        """The order that the steps show, and where the error stops falling."""
        fit = None if self.is_adaptive else observed_order(self.steps, self.errors, ERROR_FLOOR, ERROR_CEILING)
        return fit or NO_FIT

    @property
    def plateau(self) -> float:
        """The error at which it stops; nan where it does not."""
        return math.nan if self.fit.plateau is None else self.fit.plateau

    @property
    def finest_error(self) -> float:
        """The error with the finest step; nan where nothing was timed."""
        return self.timed[-1].run.error_max if self.timed else math.nan

    @property
    def digit_price(self) -> float:
        """By what factor the cost grows for one more digit; nan where that cannot be told."""
        return price_of_digit(self.errors, self.costs, ERROR_FLOOR, ERROR_CEILING)

    @property
    def best_error(self) -> float:
        """The smallest error there is; nan without one."""
        return min((row.run.error_max for row in self.timed if row.is_measured), default=math.nan)

    def price(self, accuracy: float) -> Price:
        """What an accuracy costs."""
        return price_of(accuracy, self.steps, self.errors, self.costs)

    def price_with_states(self, accuracy: float) -> Price:
        """The same for a caller who reads every state."""
        costs = np.array([row.with_states_s for row in self.timed], dtype=np.float64)
        return price_of(accuracy, self.steps, self.errors, costs)

    def beside(self, step: float) -> list[Measured]:
        """The timed cases on either side of a step, or the one that has it."""
        coarser = [row for row in self.timed if not row.step < step]
        finer = [row for row in self.timed if not row.step > step]
        return list(dict.fromkeys([*coarser[-1:], *finer[:1]]))


def measured(found: Found) -> list[Measured]:
    """Every case of a study with what was found of it, in the study's order."""
    return [
        Measured(case, found.windows[case.scene.name], found.truths[case.scene.name], run, found.timings[case])
        for case, run in found.runs.items()
    ]


def series_of(rows: Sequence[Measured]) -> Mapping[Case, Series]:
    """The series of each case, by the case; in the order in which they first appear."""
    groups: dict[tuple[object, ...], list[Measured]] = {}
    for row in rows:
        common = row.case.without_tolerance.without_step
        groups.setdefault((common.scene.name, common.chosen), []).append(row)
    made = [Series(tuple(sorted(own, key=lambda row: -row.step))) for own in groups.values()]
    return {row.case: series for series in made for row in series.rows}
