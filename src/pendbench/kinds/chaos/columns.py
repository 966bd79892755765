"""The tables of a study of kind `chaos`: their columns, and their rows from what was found."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendbench.kinds.chaos.rows import CaseRow, CurveRow, MethodRow, SceneRow, StartRow
from pendbench.kinds.chaos.study import Found
from pendbench.kinds.chaos.work import THRESHOLDS
from pendbench.measures.orders import NO_FIT, OrderFit, observed_order
from pendbench.report import columns as common
from pendbench.report.columns import Column, Table, energy_drift, tables_of, text_column, within
from pendbench.report.names import finite, grouped
from pendbench.study.case import Case
from pendbench.study.models import Model
from pendbench.study.results import Results
from pendbench.study.timing import UNTIMED

SUMMARY: Final = (
    "scene", "engine", "method", "dt", "status", "t_1e-2_s", "error_half", "energy_drift_max", "step_us", "flags",
)  # fmt: skip

_ERROR_FLOOR: Final = 1e-13  # below it an error is rounding, and says nothing about an order
_ERROR_CEILING: Final = 0.03  # above it an error is no longer small, and says nothing either


@dataclass(frozen=True)
class _Median(Column):
    """A median that may be later than the horizon: people read ``> 10`` then."""

    place: int = 0

    def text(self, row: CaseRow) -> str:
        """The value for people."""
        is_later = row.departures[self.place].median_is_later
        return f"> {self.shown(row.scene.truth.horizon)}" if is_later else super().text(row)


def _threshold(at: int) -> tuple[Column, ...]:
    name, when = f"t_{threshold_name(at)}", f"e(t) passes {threshold_name(at)}"
    return (
        _Median(f"{name}_s", "s", ".3g", f"to {threshold_name(at)}, s",
               f"the first time at which {when}: the median over the starts; empty where the median start does not get "
               "there before its horizon", lambda row: row.departures[at].median, place=at),
        Column(f"{name}_min_s", "s", ".3g", "earliest", f"the earliest start's time until {when}",
               lambda row: row.departures[at].first),
        Column(f"{name}_max_s", "s", ".3g", "latest",
               f"the latest start's time until {when}; empty where a start does not get there before its horizon",
               lambda row: row.departures[at].last),
        Column(f"{name}_lyapunov", "Lyapunov times", ".3g", "Lyapunov times",
               f"the median time until {when} times the scene's Lyapunov exponent; empty where the motion is regular",
               lambda row: row.departures[at].median * row.scene.lyapunov),
        Column(f"{name}_not_reached", "1", "d", "not reached",
               "how many starts do not get there before their horizon", lambda row: row.departures[at].not_reached),
        Column(f"{name}_band_s", "s", ".1e", "band",
               "the widest gap between the two samples around one of these times: how well it is known",
               lambda row: row.departures[at].band),
    )  # fmt: skip


def threshold_name(at: int) -> str:
    """A threshold as columns have it: ``1e-2``."""
    return f"{THRESHOLDS[at]:.0e}".replace("e-0", "e-")


def _crossing(at: int) -> Column:
    def time(row: StartRow) -> float:
        crossing = row.run.crossings[at] if row.run.crossings else None
        return math.nan if crossing is None else crossing.time

    passed = f"the first time at which e(t) of this start passes {threshold_name(at)}"
    return Column(f"t_{threshold_name(at)}_s", "s", ".3g", f"to {threshold_name(at)}, s", passed, time)


_GROWTH: Final = Column(
    "growth_per_s", "1/s", ".3g", "growth, 1/s",
    "the rate of the exponential through e(t) between 1e-12 and 1e-2, from the scene's own start",
    lambda row: row.own.growth,
)  # fmt: skip
_NEIGHBOUR: Final = Column(
    "neighbours_growth_per_s", "1/s", ".3g", "a neighbour's growth, 1/s",
    "the rate at which a start 1e-10 rad away leaves the truth: what chaos does here to any small error",
    lambda row: row.scene.neighbour.growth,
)  # fmt: skip
_LYAPUNOV: Final = Column(
    "lyapunov_per_s", "1/s", ".3g", "Lyapunov exponent, 1/s", "the rate at which neighbouring starts of the scene part",
    lambda row: row.exponent.rate,
)  # fmt: skip
_STARTS: Final = Column(
    "starts", "1", "d", "starts", "starts that were run: the scene's own and the perturbed ones",
    lambda row: len(row.runs),
)  # fmt: skip
_PLATEAU: Final = common.PLATEAU.at(lambda row: row.fit.plateau)
_CAUSE: Final = text_column("cause", "cause", "what makes this method leave the truth")
_ORDER: Final = common.ORDER_OBSERVED.at(lambda row: row.fit.order)


def _of_method(column: Column) -> Column:
    """A column of methods for a table of cases."""
    return column.at(lambda row: column.value(row.method))


_ERRORS: Final = (
    common.ERROR_MAX.at(lambda row: row.own.error_max),
    Column("error_half", "L", ".1e", "e to half horizon", "the largest e(t) up to half of the horizon",
           lambda row: row.own.error_half),
    common.ANGLE_ERROR_MAX.at(lambda row: row.own.angle_error_max,
                              "the largest error of any angle, wrapped, up to the horizon"),
    Column("reference_error_half", "L", ".1e", "reference error to half", "the reference's own e up to half of the "
           "horizon", lambda row: row.own.known_half),
)  # fmt: skip
_ENERGY: Final = (
    *energy_drift("own", "energy.largest"),
    Column("energy_drift_final", "energy scale", ".1e", "final drift", "the energy's deviation at the run's end",
           lambda row: row.own.energy.final),
    common.ENERGY_BAND.at(lambda row: row.own.energy.band),
    common.ENERGY_SLOPE.at(lambda row: row.own.energy.slope),
    Column("energy_drift_half", "energy scale", ".1e", "drift to half", "the largest deviation of the energy up to "
           "half of the horizon", lambda row: row.own.energy_half),
)  # fmt: skip
_CASES: Final = (
    *common.CASE,
    *common.ENDING,
    _STARTS,
    common.HORIZON.at(lambda row: row.scene.truth.horizon),
    common.REFERENCE_ERROR.at(lambda row: row.scene.truth.error),
    *_ERRORS,
    *(column for at in range(len(THRESHOLDS)) for column in _threshold(at)),
    *_ENERGY,
    *within("own", common.GAP_MAX),
    *map(_of_method, (common.MODEL_ERROR, common.ORDER_CLAIMED, _ORDER, _PLATEAU)),
    _GROWTH,
    _CAUSE.at(lambda row: row.method.cause),
    *common.TIMING,
    common.FLAGS,
)  # fmt: skip
_SCENES: Final = (
    *common.SCENE,
    *common.ENDING,
    common.DURATION,
    _STARTS.at(lambda row: len(row.truths)),
    common.HORIZON.at(lambda row: row.truth.horizon),
    Column("horizon_min_s", "s", ".3g", "earliest horizon, s", "the earliest horizon of the starts",
           lambda row: min(row.horizons)),
    Column("horizon_max_s", "s", ".3g", "latest horizon, s", "the latest horizon of the starts",
           lambda row: max(row.horizons)),
    common.REFERENCE_ERROR.at(lambda row: row.truth.error),
    _LYAPUNOV,
    Column("lyapunov_error_per_s", "1/s", ".1g", "its error, 1/s", "the standard error of the exponent, over blocks of "
           "time", lambda row: row.exponent.error),
    text_column("chaotic", "chaotic", "whether the exponent can be told from regular motion",
                lambda row: row.exponent.chaotic),
    _GROWTH.at(lambda row: row.neighbour.growth, "the same of a start 1e-10 rad away that is solved accurately"),
)  # fmt: skip
_CAUSES: Final = (
    common.SCENE_NAME, common.N, common.ENGINE, common.METHOD, common.SETTINGS,
    _LYAPUNOV.at(lambda row: row.scene.lyapunov, "the scene's exponent; empty where the motion is regular"),
    common.MODEL_ERROR,
    Column("model_error_limit", "1", ".1e", "last change", "what the last refinement changed in the model error: how "
           "well it is known, give or take a factor of some tens", lambda row: row.model.limit),
    common.ORDER_CLAIMED,
    _ORDER,
    common.ORDER_DT_COARSE.at(lambda row: row.fit.coarse),
    common.ORDER_DT_FINE.at(lambda row: row.fit.fine),
    _PLATEAU,
    _GROWTH.at(lambda row: row.growth, "the median over starts and steps of the rate of the exponential through e(t)"),
    _NEIGHBOUR,
    _CAUSE,
)  # fmt: skip
_START: Final = Column("start", "1", "d", "start", "0: the scene's own start; the others are perturbed")
_STARTS_TABLE: Final = (
    common.SCENE_NAME,
    _START,
    *common.CASE[2:],
    *common.ENDING,
    common.HORIZON.at(lambda row: row.horizon),
    common.ERROR_MAX.at(lambda row: row.run.error_max),
    *map(_crossing, range(len(THRESHOLDS))),
    *energy_drift("run", "energy.largest"),
)
_CURVES: Final = (
    common.SCENE_NAME,
    *common.CASE[2:],
    common.TIME,
    Column(
        "error", "L", ".1e", "e", "the largest distance of any mass from where it should be; empty past the horizon"
    ),
    common.ENERGY_ERROR,
)

#: The columns of every table, by its name.
COLUMNS: Final = {
    "cases": _CASES,
    "scenes": _SCENES,
    "causes": _CAUSES,
    "starts": _STARTS_TABLE,
    "curves": _CURVES,
}


def tables(results: Results[Found]) -> Sequence[Table]:
    """Every table of the study."""
    found = results.found
    scenes = {
        scene.name: SceneRow(scene, found.truths[scene.name], found.exponents[scene.name], found.neighbours[scene.name])
        for scene in found.scenes
    }
    groups = grouped(found.cases, lambda case: case.without_step)
    methods = {its: _method(found, its, own, scenes[its.scene.name]) for its, own in groups.items()}
    return tables_of(
        COLUMNS,
        {
            "cases": (_case(found, case, methods[case.without_step]) for case in found.cases),
            "scenes": scenes.values(),
            "causes": methods.values(),
            "starts": _starts(found),
            "curves": _curves(found),
        },
    )


def _case(found: Found, case: Case, method: MethodRow) -> CaseRow:
    runs, timing = found.runs.get(case, ()), found.timings.get(case, UNTIMED)
    return CaseRow(case, method.scene, method, runs, found.refusals.get(case), timing)


def _method(found: Found, its: Case, cases: Sequence[Case], scene: SceneRow) -> MethodRow:
    model = found.models.get(its, Model("refused"))
    growths = finite(run.growth for case in cases for run in found.runs.get(case, ()))
    growth = float(np.median(growths)) if growths else math.nan
    return MethodRow(its, scene, model, found.orders[its], _fit(found, cases), growth)


def _fit(found: Found, cases: Sequence[Case]) -> OrderFit:
    points = [
        (case.dt, found.runs[case][0].order_error) for case in cases if case.dt is not None and case in found.runs
    ]
    steps, errors = np.array(points, dtype=np.float64).reshape(-1, 2).T
    return observed_order(steps, errors, _ERROR_FLOOR, _ERROR_CEILING) or NO_FIT


def _starts(found: Found) -> Iterator[StartRow]:
    for case, runs in found.runs.items():
        truths = found.truths[case.scene.name]
        for at, run in enumerate(runs):
            yield StartRow(case, at, run, truths[at].horizon)


def _curves(found: Found) -> Iterator[CurveRow]:
    for case, runs in found.runs.items():
        curves = runs[0].curves
        for t, error, energy in zip(curves.t.tolist(), curves.error.tolist(), curves.energy.tolist(), strict=True):
            yield CurveRow(case, t, error, energy)
