"""The tables of a study of kind `scaling`: a row's values and its columns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendbench.kinds.scaling.search import Trial, best_of, nearest_beyond
from pendbench.kinds.scaling.study import Found, Options, Racer
from pendbench.kinds.scaling.work import RaceRun, StepCost
from pendbench.measures.orders import Growth, growth_exponent
from pendbench.report import columns as common
from pendbench.report.columns import Column, Table, energy_drift, tables_of, text_column, within
from pendbench.report.names import OfRun
from pendbench.study.case import Case
from pendbench.study.results import Results
from pendbench.study.timing import Timed

SUMMARY: Final = ("engine", "method", "n", "status", "step_us", "step_per_link_ns", "energy_drift_max", "memory_mb")

#: What ends a search because the chain is too long, and not because of something else.
_TOO_LONG: Final = ("too slow", "lost")


@dataclass(frozen=True)
class CaseRow(OfRun):
    """A chain of n links, and what a step of it costs."""

    case: Case
    run: StepCost

    @property
    def timing(self) -> Timed:
        """What a step costs."""
        return self.run.timing

    @property
    def flags(self) -> str:
        """Whether the timing is noisy."""
        return "; ".join(self.timing.flags)

    @property
    def step_per_link_ns(self) -> float:
        """The cost of a step over n."""
        return 1e3 * self.timing.step_us / self.case.scene.n


@dataclass(frozen=True)
class GrowthRow:
    """How the cost of a step grows from n_from to n_to links, and how the longest chain that was tried ended."""

    case: Case
    n_from: float
    n_to: float
    growth: Growth
    status: str
    reason: str


@dataclass(frozen=True)
class LongestRow:
    """The longest chain in real time, nan links where there is none. bound: whether something else than the chain ended
    the search, so that it is at least as long. next_n: of the shortest chain beyond it, which fared as `beyond` says.
    """

    case: Case
    longest_n: float
    dt: float
    run: RaceRun
    bound: bool
    next_n: float
    beyond: RaceRun
    reason: str


@dataclass(frozen=True)
class TrialRow:
    """A chain against the clock."""

    case: Case
    trial: Trial

    @property
    def dt(self) -> float:
        """The step, s; nan where the method chooses its own."""
        return self.trial.dt if self.case.dt is not None else math.nan

    @property
    def reason(self) -> str:
        """Why it did not hold."""
        return self.trial.run.reason


_METHOD: Final = (common.ENGINE, common.METHOD, common.SETTINGS)
PER_LINK: Final = Column(
    "step_per_link_ns", "ns", ".3g", "step per link, ns", "the cost of a step over n", is_time=True
)
MEMORY: Final = Column(
    "memory_mb", "MB", ".3g", "memory, MB", "by how much the process grew while it had the chain and took a step",
    lambda row: row.run.memory_mb, is_time=True,
)  # fmt: skip
ERROR: Final = common.ERROR_MAX.at(
    lambda row: row.run.error_max, "the largest error after so many steps as the study says"
)
STEP: Final = common.STEP_US.at(lambda row: row.timing.step_us)
LONGEST: Final = Column(
    "longest_n", "1", "d", "longest chain", "the most links that run in real time with an energy error below 1 %",
    is_time=True, empty="none",
)  # fmt: skip
EXPONENT: Final = Column(
    "step_exponent", "1", ".2f", "exponent", "p in: cost of a step ~ n^p, by least squares on logarithms",
    lambda row: row.growth.exponent, is_time=True,
)  # fmt: skip
EXPONENT_ERROR: Final = Column(
    "step_exponent_error", "1", ".2f", "its error", "the standard error of that fit", lambda row: row.growth.error,
    is_time=True,
)  # fmt: skip
SPENT: Final = Column("race_spent_s", "s", ".3g", "spent, s", "time spent stepping", is_time=True)
_OUTCOME: Final = text_column(
    "outcome", "outcome", "held, lost (energy or rods), too slow for real time, or a status", is_time=True
)
_WORST: Final = replace(common.ENERGY_DRIFT_MAX, is_time=True)

_CASES: Final = (
    *common.CASE,
    *common.ENDING,
    common.HORIZON.without("errors are taken against our Taylor method"),
    ERROR,
    *energy_drift("run"),
    *within("timing", common.STEP_US, common.STEP_SPREAD, common.BUILD, common.FIRST_CALL),
    common.RUN.without("see step_us"),
    common.FLAGS,
    PER_LINK,
    MEMORY,
)
_GROWTH: Final = (
    *_METHOD,
    *common.ENDING,
    common.N_FROM,
    common.N_TO,
    EXPONENT,
    EXPONENT_ERROR,
)
_LONGEST: Final = (
    common.ENGINE,
    common.METHOD,
    common.DT.at(lambda row: row.dt),
    common.SETTINGS,
    text_column("reason", "reason", "why the search ended", is_time=True),
    _WORST.at(lambda row: row.run.energy_drift_max),
    LONGEST,
    text_column("bound", "at least", "whether something else than the chain's length ended the search", is_time=True),
    SPENT.at(lambda row: row.run.spent_s),
    Column("next_n", "1", "d", "next chain", "the shortest chain beyond the longest that was tried", is_time=True),
    _OUTCOME.at(lambda row: row.beyond.outcome),
)
_TRIALS: Final = (
    common.N.at(lambda row: row.trial.n),
    common.ENGINE,
    common.METHOD,
    common.DT.at(lambda row: row.dt),
    common.SETTINGS,
    text_column("reason", "reason", "why it did not hold", is_time=True),
    _WORST.at(lambda row: row.trial.run.energy_drift_max),
    SPENT.at(lambda row: row.trial.run.spent_s),
    Column(
        "reached_s", "s", ".3g", "reached, s", "how far the motion was followed", lambda row: row.trial.run.reached_s,
        is_time=True,
    ),
    _OUTCOME.at(lambda row: row.trial.run.outcome),
)  # fmt: skip
#: The columns of every table, by its name.
COLUMNS: Final = {
    "cases": _CASES,
    "growth": _GROWTH,
    "longest": _LONGEST,
    "trials": _TRIALS,
}


def tables(results: Results[Found]) -> Sequence[Table]:
    """Every table of the study."""
    racers, options = results.found, results.options
    return tables_of(
        COLUMNS,
        {
            "cases": (CaseRow(case, cost) for racer in racers for case, cost in racer.costs.items()),
            "growth": (growth_row(racer, options.fit_from) for racer in racers),
            "longest": (longest_row(racer, options) for racer in racers),
            "trials": (TrialRow(racer.pattern, trial) for racer in racers for trial in racer.trials),
        },
    )


def growth_row(racer: Racer, fit_from: int) -> GrowthRow:
    """How a method's cost grows, and why the measurement went no further."""
    costs = {case.scene.n: cost for case, cost in racer.costs.items()}
    measured = {n: cost.timing.step_us for n, cost in costs.items() if cost.status == "ok"}
    fitted = _fitted(measured, fit_from)
    growth = growth_exponent(np.array(fitted, dtype=np.float64), np.array([measured[n] for n in fitted]))
    last = next((cost for cost in costs.values() if cost.status != "ok"), StepCost("ok"))
    low, high = (fitted[0], fitted[-1]) if fitted else (math.nan, math.nan)
    return GrowthRow(racer.pattern, low, high, growth, last.status, last.reason)


def _fitted(measured: Mapping[int, float], fit_from: int) -> list[int]:
    """The lengths that growth is fitted to: those of the last decade, where fewer than three reach `fit_from`."""
    fitted = sorted(n for n in measured if n >= fit_from)
    if len(fitted) < 3:
        fitted = sorted(n for n in measured if 10 * n >= max(measured))
    return fitted if len(fitted) >= 3 else []


def longest_row(racer: Racer, options: Options) -> LongestRow:
    """The longest chain of a method that held, and what became of the next one."""
    best, nearest = best_of(racer.trials), nearest_beyond(racer.trials)
    dt = best.dt if best and racer.pattern.dt is not None else math.nan
    run = best.run if best else RaceRun("")
    beyond = nearest.run if nearest else RaceRun("")
    stopped = beyond.outcome == "lost" and racer.pattern.dt is not None  # every finer step was tried
    return LongestRow(
        case=racer.pattern,
        longest_n=best.n if best else math.nan,
        dt=dt,
        run=run,
        bound=best is not None and (stopped or beyond.outcome not in _TOO_LONG),
        next_n=nearest.n if nearest else math.nan,
        beyond=beyond,
        reason=beyond.reason + (f"; no step below {options.finest:g} s is tried" if stopped else ""),
    )
