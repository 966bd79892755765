"""The tables of a study of kind `cost`: a row's values and its columns."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Final

from pendbench.kinds.cost.series import Measured, Series, measured, series_of
from pendbench.kinds.cost.study import Found, Window
from pendbench.kinds.cost.work import LongRun
from pendbench.measures.prices import Price
from pendbench.report import columns as common
from pendbench.report.columns import Column, Table, energy_drift, tables_of, text_column, within
from pendbench.report.names import OfRun, OfTruth, distinct
from pendbench.scene.scene import Scene
from pendbench.study import flags
from pendbench.study.case import Case
from pendbench.study.results import Results
from pendbench.study.timing import Timed
from pendbench.study.truths import KeptTruth

SUMMARY: Final = (
    "scene", "engine", "method", "dt", "status", "error_max", "energy_drift_max", "step_us", "run_s", "flags",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class SceneRow(OfTruth):
    """A scene, over what it is compared, and its truth."""

    scene: Scene
    window: Window
    truth: KeptTruth


@dataclass(frozen=True, eq=False)
class CaseRow:
    """A case with what was found of it, and the series that it is one of."""

    measured: Measured
    series: Series

    @property
    def case(self) -> Case:
        """The case."""
        return self.measured.case

    @property
    def status(self) -> str:
        """How it ended."""
        return self.measured.status

    @property
    def reason(self) -> str:
        """Why it did not end well, or has no error."""
        return self.measured.reason

    @property
    def timing(self) -> Timed:
        """What it costs."""
        return self.measured.timing

    @property
    def is_still(self) -> bool:
        """Whether nothing moves in the scene, so that an error says nothing."""
        return self.measured.truth.is_still

    @property
    def flags(self) -> str:
        """What a reader should know."""
        return "; ".join([*self.flags_of_steps, *self.flags_of_run, *self.timing.flags])

    @property
    def flags_of_steps(self) -> Iterator[str]:
        """What is of all steps of the method."""
        its = self.series
        if not self.is_still:
            yield from flags.of_steps(its.order_claimed, its.fit.order, its.plateau, its.finest_error)

    @property
    def flags_of_run(self) -> Iterator[str]:
        """What is of this case alone."""
        run = self.measured.run
        if self.is_still:
            yield "nothing moves"
        else:
            yield from flags.too_good(run.error_max, run.error_max, run.reference_error, run.seen)


@dataclass(frozen=True, eq=False)
class OrderRow:
    """What the steps of a method show together."""

    series: Series

    @property
    def case(self) -> Case:
        """What the cases of the series have in common."""
        return self.series.case


@dataclass(frozen=True, eq=False)
class PriceRow:
    """What an accuracy costs with a method in a scene, and what it costs who reads every state."""

    series: Series
    accuracy: float
    price: Price
    with_states_s: float

    @property
    def case(self) -> Case:
        """What the cases of the series have in common."""
        return self.series.case

    @property
    def dt(self) -> float:
        """The step, s, interpolated."""
        return math.nan if self.series.is_adaptive else self.price.step

    @property
    def tolerance(self) -> float:
        """The tolerance, interpolated."""
        return self.price.step if self.series.is_adaptive else math.nan

    @property
    def is_noisy(self) -> bool:
        """Whether one of the timings that it comes from is."""
        return any(row.timing.noisy for row in self.series.beside(self.price.step))


@dataclass(frozen=True, eq=False)
class LongRow(OfRun):
    """A long run."""

    case: Case
    run: LongRun


@dataclass(frozen=True)
class Sample:
    """A sample of the energy of a long run."""

    case: Case
    t_s: float
    energy_error: float


_ACCURACY: Final = Column(
    "accuracy", "L", ".0e", "error up to", "the error that is allowed: the largest e(t) up to compare_s"
)
_COMPARED: Final = Column(
    "compare_s", "s", ".4g", "compared up to, s", "until when errors are compared and costs are counted",
    lambda row: row.window.time,
)  # fmt: skip
_PLATEAU: Final = common.PLATEAU.at(attrgetter("series.plateau"))
_ENERGY_BANDS: Final = (
    common.ENERGY_BAND,
    common.ENERGY_SLOPE,
    Column(
        "energy_slope_share", "1", ".2g", "slope's share",
        "what the slope alone moves the energy by over the whole run, over the band",
    ),
    Column(
        "energy_band_first_tenth", "energy scale", ".1e", "band, first tenth",
        "the energy's band over the first tenth of the run",
    ),
    Column(
        "energy_band_last_tenth", "energy scale", ".1e", "band, last tenth",
        "the energy's band over the last tenth of the run",
    ),
    common.STEPS,
)  # fmt: skip
_STEP_AND_STATE: Final = Column(
    "step_and_state_us", "us", ".3g", "step and state, µs",
    "a step and reading the state after it, from Python; for a method that chooses its steps: advancing by compare_s / "
    "samples and reading",
    is_time=True,
)  # fmt: skip
_BEST: Final = Column(
    "best_error", "L", ".1e", "best e", "the smallest e max of all steps or tolerances of a method",
    lambda row: row.series.best_error,
)  # fmt: skip


_CASES: Final = (
    *common.CASE[:-1], *within("measured", common.TOLERANCE), common.SETTINGS,
    *common.ENDING,
    _COMPARED.at(attrgetter("measured.window.time")),
    common.HORIZON.at(attrgetter("measured.truth.horizon")),
    *within(
        "measured.run",
        common.REFERENCE_ERROR,
        replace(common.ERROR_MAX, meaning="the largest e(t) up to compare_s"),
        common.ANGLE_ERROR_MAX,
    ),
    *energy_drift("measured.run"),
    *within("measured.run", common.GAP_MAX),
    *within("series", common.ORDER_CLAIMED),
    common.ORDER_OBSERVED.at(attrgetter("series.fit.order")),
    _PLATEAU,
    *within("measured.run", common.STEPS),
    *within(
        "timing",
        common.STEP_US, _STEP_AND_STATE, common.STEP_SPREAD, common.SIMULATED, common.BUILD, common.FIRST_CALL,
    ),
    common.RUN.at(attrgetter("timing.run_s"), "time spent stepping up to compare_s"),
    common.FLAGS,
)  # fmt: skip
_SCENES: Final = (
    *common.SCENE,
    *common.ENDING,
    _COMPARED,
    Column("samples", "1", "d", "samples", "evenly spaced times at which errors are compared",
           attrgetter("window.samples")),
    common.HORIZON.at(attrgetter("truth.horizon")),
    common.REFERENCE_ERROR.at(attrgetter("truth.error")),
)  # fmt: skip
_ORDERS: Final = (
    common.SCENE_NAME, common.N, common.ENGINE, common.METHOD, common.SETTINGS,
    _BEST,
    *within("series", common.ORDER_CLAIMED),
    common.ORDER_OBSERVED.at(attrgetter("series.fit.order")),
    common.ORDER_DT_COARSE.at(attrgetter("series.fit.coarse")),
    common.ORDER_DT_FINE.at(attrgetter("series.fit.fine")),
    _PLATEAU,
    *within("series", Column("digit_price", "1", ".2g", "one more digit",
                          "by what factor the cost grows where the error is to fall tenfold", is_time=True)),
)  # fmt: skip
_PRICES: Final = (
    common.SCENE_NAME, _ACCURACY, common.ENGINE, common.METHOD,
    common.DT.at(attrgetter("dt"), "the step that has the accuracy, interpolated; empty where it is not reached"),
    common.TOLERANCE.at(attrgetter("tolerance"),
                        "the tolerance that has it, interpolated; empty where it is not reached"),
    common.SETTINGS,
    _BEST,
    common.RUN.at(attrgetter("price.run_s"), "time spent stepping up to compare_s"),
    Column("with_states_s", "s", ".3g", "with states, s",
           "the same for who reads the state after every step (at the samples, of a method that chooses its steps)",
           is_time=True),
    text_column("bound", "bound", "whether the coarsest step that ran is as accurate already: run_s is an upper bound",
                attrgetter("price.bound")),
)  # fmt: skip
_LONG_RUNS: Final = (
    *common.CASE[:-1], *common.ENDING, *energy_drift("run"), *within("run", *_ENERGY_BANDS),
)  # fmt: skip
_CURVES: Final = (
    common.SCENE_NAME, common.ENGINE, common.METHOD, common.DT, common.SETTINGS,
    common.TIME,
    Column("error", "L", ".1e", "e", "empty: nothing is compared in long runs", lambda _: math.nan),
    common.ENERGY_ERROR,
)  # fmt: skip

#: The columns of every table, by its name.
COLUMNS: Final = {
    "cases": _CASES,
    "scenes": _SCENES,
    "orders": _ORDERS,
    "prices": _PRICES,
    "long_runs": _LONG_RUNS,
    "curves": _CURVES,
}


def tables(results: Results[Found]) -> Sequence[Table]:
    """Every table of the study."""
    found = results.found
    rows = measured(found)
    of_case = series_of(rows)
    every = distinct((of_case[row.case] for row in rows), lambda series: series)
    return tables_of(
        COLUMNS,
        {
            "cases": (CaseRow(row, of_case[row.case]) for row in rows),
            "scenes": _scenes(found),
            "orders": map(OrderRow, every),
            "prices": (_price(series, at) for series in every for at in found.accuracies),
            "long_runs": itertools.starmap(LongRow, found.long_runs.items()),
            "curves": _samples(found.long_runs),
        },
    )


def _scenes(found: Found) -> Iterator[SceneRow]:
    for scene in found.scenes:
        yield SceneRow(scene, found.windows[scene.name], found.truths[scene.name])


def _price(series: Series, accuracy: float) -> PriceRow:
    return PriceRow(series, accuracy, series.price(accuracy), series.price_with_states(accuracy).run_s)


def _samples(long_runs: Mapping[Case, LongRun]) -> Iterator[Sample]:
    for case, run in long_runs.items():
        for t, error in zip(run.t, run.energy_error, strict=True):
            yield Sample(case, float(t), float(error))
