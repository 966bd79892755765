"""The tables of a study of kind `effects`: a row's values and its columns."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendbench.effects import names
from pendbench.engines.protocol import mapped_effects
from pendbench.engines.registry import engine
from pendbench.kinds.effects.study import Found, Priced
from pendbench.kinds.effects.work import EffectRun
from pendbench.measures.orders import observed_order
from pendbench.report import columns as common
from pendbench.report.columns import Column, Table, tables_of, text_column, within
from pendbench.report.names import OfRun, OfTruth, grouped, pair_of, scene_of
from pendbench.report.numbers import NOTHING, times_text
from pendbench.scene.scene import Scene
from pendbench.study.case import Case
from pendbench.study.results import Results
from pendbench.study.truths import KeptTruth

SUMMARY: Final = ("scene", "engine", "method", "dt", "status", "error_max", "balance_error")

_FLOOR: Final = 1e-12
_CEILING: Final = 0.05


@dataclass(frozen=True)
class SceneRow(OfTruth):
    """A scene and its truth."""

    scene: Scene
    truth: KeptTruth

    @property
    def moved_max_rad(self) -> float:
        """The farthest that any angle gets from where it started, rad."""
        moved = self.truth.theta - self.scene.angles if len(self.truth.t) else np.full(1, np.nan)
        return float(np.abs(moved).max())


@dataclass(frozen=True)
class CaseRow(OfRun):
    """A case, what it did, and the truth of its scene."""

    case: Case
    run: EffectRun
    truth: KeptTruth

    @property
    def reason(self) -> str:
        """Why it did not end well, or was not compared."""
        return "; ".join(filter(None, [self.run.reason, self._uncompared]))

    @property
    def _uncompared(self) -> str:
        if self.status == "refused" or math.isfinite(self.run.error_max):
            return ""
        if not len(self.truth.t):
            return f"not compared, the truth is missing ({self.truth.status}: {self.truth.reason})"
        return "not compared, the truth's horizon is too near" if self.status == "ok" else ""


@dataclass(frozen=True)
class BestRow:
    """What is best of an engine: one of the finest cases of the method, in how many scenes, what is worst of these, and
    what a step costs with all effects of the scene that is priced.
    """

    case: Case
    scenes: int
    error_max: float
    balance_error: float
    priced: Priced | None


@dataclass(frozen=True)
class OrderRow:
    """The first of the cases that differ in their step alone, and the orders of their method."""

    case: Case
    order_claimed: int
    order_observed: float


@dataclass(frozen=True)
class MeansRow:
    """By what means an engine simulates an effect."""

    effect: str
    engine: str
    means: str


_MOVED: Final = Column(
    "moved_max_rad", "rad", ".3g", "moved by, rad", "the farthest that any angle gets from where it started"
)
_BALANCE: Final = (
    Column(
        "balance_error", "1", ".1e", "energy balance",
        "the largest difference between the energy's change and the work of the effects without a potential, over the "
        "scene's energy (or the largest change, where that is larger)",
    ),
    Column(
        "balance_floor", "1", ".0e", "its floor",
        "how well the work is known from the samples: a balance below this is not told from 0",
    ),
)  # fmt: skip
_CASES: Final = (
    *common.CASE,
    *common.ENDING,
    common.HORIZON.at(lambda row: row.truth.horizon),
    *within("run", common.ERROR_MAX, *_BALANCE, _MOVED, common.GAP_MAX, common.STEPS),
    # Every kind has these; here the balance stands for the first, and prices for the others.
    common.ENERGY_DRIFT_MAX.without("see balance_error"),
    common.STEP_US.without("see prices.csv"),
    common.RUN.without("see prices.csv"),
)
_SCENES: Final = (
    *common.SCENE,
    text_column("effects", "effects", "what acts on the scene's chain", lambda row: ", ".join(row.scene.terms)),
    common.DURATION,
    common.HORIZON.at(lambda row: row.truth.horizon),
    common.REFERENCE_ERROR.at(lambda row: row.truth.error),
    _MOVED,
    common.TITLE,
    *common.ENDING,
)
_METHOD_OF_SCENE: Final = (common.SCENE_NAME, common.N, common.ENGINE, common.METHOD)
_ORDERS: Final = (*_METHOD_OF_SCENE, common.ORDER_CLAIMED, common.ORDER_OBSERVED)
_EFFECT: Final = text_column("effect", "effect", "the effect; in prices.csv what acts besides gravity")
_PRICE: Final = Column(
    "step_price", "1", ".2f", "price", "the cost of a step over that of the bare chain, under gravity alone",
    is_time=True,
)  # fmt: skip
_PRICES: Final = (
    *_METHOD_OF_SCENE,
    _EFFECT,
    common.STEP_US.at(lambda row: row.price.step_us),
    _PRICE.at(lambda row: row.price.ratio),
    Column(
        "price_spread", "1", ".2f", "its spread", "largest less smallest of three measurements of the price in turn",
        lambda row: row.price.spread, is_time=True,
    ),
    *common.ENDING,
)  # fmt: skip
#: In the report alone: every number of it is in one of the other tables.
BEST: Final = (
    *(column for column in common.CASE if column.name not in ("scene", "n", "settings")),
    Column("scenes", "1", "d", "scenes", "how many scenes it could simulate"),
    common.ERROR_MAX.at(lambda row: row.error_max, "the largest of its errors in these"),
    _BALANCE[0].at(lambda row: row.balance_error),
    common.STEP_US.at(lambda row: row.priced and row.priced.price.step_us),
    _PRICE.at(lambda row: row.priced and price_text(row.priced)),
)
_MEANS: Final = (
    _EFFECT,
    text_column("engine", "engine", "the program that simulated"),
    text_column("means", "means", "by what means the engine simulates the effect, or why it refuses to"),
)


def price_text(row: Priced) -> str:
    """A price for people, with a question mark where it is noisy."""
    return f"{times_text(row.price.ratio)}{' ?' if row.noisy else ''}" if row.measured else NOTHING


#: The columns of every table, by its name.
COLUMNS: Final = {
    "cases": _CASES,
    "scenes": _SCENES,
    "orders": _ORDERS,
    "prices": _PRICES,
    "mappings": _MEANS,
}


def tables(results: Results[Found]) -> Sequence[Table]:
    """Every table of the study."""
    found = results.found
    cases = [CaseRow(case, run, found.truths[case.scene.name]) for case, run in found.runs.items()]
    engines = sorted({case.engine for case in found.runs})
    return tables_of(
        COLUMNS,
        {
            "cases": cases,
            "scenes": (SceneRow(scene, found.truths[scene.name]) for scene in found.scenes),
            "orders": _orders(cases),
            "prices": found.prices,
            "mappings": _means(engines),
        },
    )


def _orders(cases: Sequence[CaseRow]) -> Iterator[OrderRow]:
    able = [row for row in cases if row.case.dt is not None and row.status == "ok"]
    for own in grouped(able, lambda row: (scene_of(row), pair_of(row))).values():
        steps = np.array([row.case.dt for row in own], dtype=np.float64)
        fit = observed_order(steps, np.array([row.run.error_max for row in own]), _FLOOR, _CEILING)
        yield OrderRow(own[0].case, _claimed(own[0].case), math.nan if fit is None else fit.order)


def _claimed(case: Case) -> int:
    """The order that the method claims, or what the engine's means for one of the effects leave of it."""
    its = engine(case.engine)
    mapped = mapped_effects(its)
    left = [mapped[effect].orders.get(case.method, math.inf) for effect in case.scene.terms if effect in mapped]
    return int(min([case.its_method.order, *left]))


def _means(engines: Sequence[str]) -> Iterator[MeansRow]:
    for effect in names():
        for name in engines:
            mapped = mapped_effects(engine(name)).get(effect)
            how = "refused" if mapped is None else f"refused: {mapped.how}" if mapped.refused else mapped.how
            yield MeansRow(effect, name, how)
