"""The tables of a study of kind `scaling`: a row's values and its columns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendbench.kinds.scaling.search import Trial, best_of, nearest_beyond
from pendbench.kinds.scaling.study import Found, Options, Racer
from pendbench.kinds.scaling.work import StepCost
from pendbench.measures.orders import Growth, growth_exponent
from pendbench.measures.titles import Shown
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
    """The longest chain of a method with a title, nan links where there is none. shown: by it. bound: whether something
    else than the chain ended the search, so that it is at least as long. next_n: of the shortest chain beyond it, which
    fared as `outcome` and `reason` say.
    """

    case: Case
    title: str
    longest_n: float
    dt: float
    shown: Shown
    bound: bool
    next_n: float
    outcome: str
    reason: str


@dataclass(frozen=True)
class TrialRow:
    """A chain against the clock, for a title."""

    case: Case
    title: str
    trial: Trial

    @property
    def dt(self) -> float:
        """The step, s; nan where the method chooses its own."""
        return self.trial.dt if self.case.dt is not None else math.nan

    @property
    def shown(self) -> Shown:
        """What it has shown."""
        return self.trial.run.shown


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
TITLE: Final = text_column("title", "title", "what a chain has to show: faithful, energy or moves well")
LONGEST: Final = Column(
    "longest_n", "1", "d", "longest chain", "the most links with which the title is won in real time", is_time=True,
    empty="none",
)  # fmt: skip
EXPONENT: Final = Column(
    "step_exponent", "1", ".2f", "exponent", "p in: cost of a step ~ n^p, by least squares on logarithms",
    lambda row: row.growth.exponent, is_time=True,
)  # fmt: skip
EXPONENT_ERROR: Final = Column(
    "step_exponent_error", "1", ".2f", "its error", "the standard error of that fit", lambda row: row.growth.error,
    is_time=True,
)  # fmt: skip
SPENT: Final = Column(
    "race_spent_s", "s", ".3g", "spent, s", "processor time spent stepping", lambda row: row.shown.spent, is_time=True
)
LOST: Final = Column(
    "energy_lost", "energy scale", ".1e", "energy lost", "by how much the energy is less at the end than at the start",
    lambda row: row.shown.lost, is_time=True,
)  # fmt: skip
_SHOWN: Final = (
    replace(common.ENERGY_DRIFT_MAX.at(lambda row: row.shown.strays), is_time=True),
    LOST,
    Column(
        "energy_risen", "energy scale", ".1e", "energy risen", "by how much it was at most above any value before",
        lambda row: row.shown.risen, is_time=True,
    ),
    Column(
        "predicted_error", "L", ".1e", "e, predictable", "the largest e(t) while the motion can be predicted; empty "
        "where it was not compared", lambda row: row.shown.error, is_time=True,
    ),
    Column(
        "coarse_error", "L", ".1e", "coarse error", "the largest error of the coarse motion in the first swing; empty "
        "where it was not compared", lambda row: row.shown.coarse.worst, is_time=True,
    ),
)  # fmt: skip
_OUTCOME: Final = text_column(
    "outcome", "outcome",
    "held, lost (what the title asks for), too slow for real time, not known (what it is compared with), or a status",
    is_time=True,
)  # fmt: skip

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
    TITLE,
    text_column("reason", "reason", "why the search ended", is_time=True),
    *_SHOWN,
    LONGEST,
    text_column("bound", "at least", "whether something else than the chain's length ended the search", is_time=True),
    SPENT,
    Column("next_n", "1", "d", "next chain", "the shortest chain beyond the longest that was tried", is_time=True),
    _OUTCOME,
)
_TRIALS: Final = (
    common.N.at(lambda row: row.trial.n),
    common.ENGINE,
    common.METHOD,
    common.DT.at(lambda row: row.dt),
    common.SETTINGS,
    TITLE,
    text_column("reason", "reason", "why it did not hold", lambda row: row.trial.reason, is_time=True),
    *_SHOWN,
    SPENT,
    Column(
        "reached_s", "s", ".3g", "reached, s", "how far the motion was followed", lambda row: row.shown.reached,
        is_time=True,
    ),
    _OUTCOME.at(lambda row: row.trial.outcome),
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
            "longest": (
                longest_row(racer.pattern, *each, options) for racer in racers for each in racer.trials.items()
            ),
            "trials": (
                TrialRow(racer.pattern, title, trial)
                for racer in racers
                for title, trials in racer.trials.items()
                for trial in trials
            ),
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


def longest_row(case: Case, title: str, trials: Sequence[Trial], options: Options) -> LongestRow:
    """The longest chain of a method that won a title, and what became of the next one."""
    best, nearest = best_of(trials), nearest_beyond(trials)
    outcome, reason = (nearest.outcome, nearest.reason) if nearest else ("", "")
    stopped = outcome == "lost" and case.dt is not None  # every finer step was tried
    return LongestRow(
        case=case,
        title=title,
        longest_n=best.n if best else math.nan,
        dt=best.dt if best and case.dt is not None else math.nan,
        shown=best.run.shown if best else Shown(strays=math.nan, lost=math.nan, risen=math.nan, spent=math.nan),
        bound=best is not None and (stopped or outcome not in _TOO_LONG),
        next_n=nearest.n if nearest else math.nan,
        outcome=outcome,
        reason=reason + (f"; no step below {options.finest:g} s is tried" if stopped else ""),
    )
