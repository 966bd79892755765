"""What the page of a study of kind `cost` says; the sentences are in page.md.j2."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendbench.kinds.cost.columns import CaseRow, LongRow, OrderRow, SceneRow
from pendbench.kinds.cost.long import ALIKE, NO_TREND, failed, long_table
from pendbench.kinds.cost.plots import pictures
from pendbench.kinds.cost.prices import (
    Prices,
    best_of_engines,
    every_method,
    pendulum,
    run_s,
    time_to_accuracy,
    with_states_s,
)
from pendbench.kinds.cost.study import Found
from pendbench.measures.energy import conserves_energy
from pendbench.report.columns import ORDER_CLAIMED, ORDER_OBSERVED, Table
from pendbench.report.names import (
    case_name,
    distinct,
    engine_of,
    grouped,
    in_one_scene,
    is_ok,
    method_name,
    pair_of,
    scene_of,
    spanned,
)
from pendbench.report.numbers import number_text, times_text
from pendbench.report.text import Safe, grid, markdown
from pendbench.study.case import Case
from pendbench.study.flags import order_differs
from pendbench.study.results import Results
from pendbench.truth.proof.known import Proven, proven

__all__ = ["Facts", "facts", "pictures"]

#: Runs shorter than this, s, spend a visible share of their time on being called at all.
SHORT: Final = 1e-4
#: The pendulum of the multibody community's benchmark A01, as the bundled scene is called, and what it allows, m.
PENDULUM: Final = "a01"
PENDULUM_ALLOWS: Final = 1e-3


@dataclass(frozen=True)
class Winner:
    """An engine, and the scenes in which it is the cheapest to the accuracy at which engines are compared."""

    engine: str
    scenes: Sequence[str]


@dataclass(frozen=True)
class Other:
    """How many times as long as the cheapest an engine takes where it is not that; noisy: not worth their digits.

    missed: the scenes in which it does not get there.
    """

    engine: str
    ratios: Sequence[float]
    missed: Sequence[str]
    noisy: bool

    @property
    def times(self) -> str:
        """The ratios from the smallest to the largest."""
        return spanned(self.ratios, times_text)


@dataclass(frozen=True)
class SceneFacts:
    """The tables of one scene."""

    name: str
    times: Safe
    methods: Safe


@dataclass(frozen=True)
class Facts:
    """Everything that the template says.

    still: the scenes in which nothing moves; moving: how many cases the others have, of which is all that follows.
    wins: by engine, at how many of the `pairs` of scene and accuracy it is the cheapest. dearer: by engine, by what
    factor reading every state makes a step dearer. short: how many cases are shorter than can be timed well.
    """

    still: Sequence[SceneRow]
    balanced: Sequence[str]
    moving: int
    accuracy: float
    accuracies: Sequence[float]
    winners: Sequence[Winner]
    others: Sequence[Other]
    wins: Sequence[tuple[str, int]]
    pairs: int
    best: Safe
    own: Sequence[SceneFacts]
    orders: Safe
    digits: Safe
    pendulum: Safe | None
    long_runs: Safe | None
    long_failed: Sequence[LongRow]
    no_trend: float
    alike: float
    dearer: Sequence[tuple[str, float]]
    best_with_states: Safe
    untaken: Sequence[str]
    odd: Sequence[str]
    short: int
    short_limit: float
    proven: Sequence[Proven]


def facts(results: Results[Found], tables: dict[str, Table]) -> Facts:
    """What the page says."""
    del results
    cases: list[CaseRow] = list(tables["cases"])
    still = [row for row in tables["scenes"] if row.truth.is_still]
    moving = [row for row in cases if not row.is_still]
    at_rest = {row.scene.name for row in still}
    prices = Prices([row for row in tables["prices"] if scene_of(row) not in at_rest], moving)
    accuracy, long_runs = prices.compared_at, tables["long_runs"]
    wins = _wins(prices)
    asked = PENDULUM in prices.scenes and PENDULUM_ALLOWS in prices.accuracies
    return Facts(
        still=still,
        balanced=[row.scene.name for row in tables["scenes"] if not conserves_energy(row.scene)],
        proven=proven(row.scene for row in tables["scenes"]),
        moving=len(moving),
        accuracy=accuracy,
        accuracies=prices.accuracies,
        winners=list(_winners(prices, accuracy)),
        others=list(_others(prices, accuracy)),
        wins=wins.most_common(),
        pairs=len(prices.scenes) * len(prices.accuracies),
        best=best_of_engines(prices, accuracy),
        own=[SceneFacts(name, time_to_accuracy(prices, name), every_method(prices, name)) for name in prices.scenes],
        orders=_by_method(tables["orders"].rows, _order),
        digits=_by_method(tables["orders"].rows, _digit),
        pendulum=pendulum(prices, PENDULUM, PENDULUM_ALLOWS) if asked else None,
        long_runs=long_table(long_runs) if len(long_runs) else None,
        long_failed=failed(long_runs.rows),
        no_trend=NO_TREND,
        alike=ALIKE,
        dearer=list(_dearer(cases)),
        best_with_states=best_of_engines(prices, accuracy, with_states_s),
        untaken=distinct(
            (row for row in cases if is_ok(row) and row.reason), lambda row: f"{scene_of(row)}: {row.reason}"
        ),
        odd=list(dict.fromkeys(_odd(cases))),
        short=sum(0 < row.timing.run_s < SHORT for row in cases),
        short_limit=SHORT,
    )


def moving(results: Results[Found], tables: dict[str, Table]) -> list[Case]:
    """The cheapest case of each engine that is accurate enough, in the scene where most of them can be seen."""
    del results
    cases: list[CaseRow] = [row for row in tables["cases"] if not row.is_still]
    accuracy = Prices(list(tables["prices"]), cases).compared_at
    able = [row for row in cases if row.measured.is_timed and row.measured.run.error_max <= accuracy]
    groups = grouped(able, lambda row: (scene_of(row), engine_of(row)))
    return in_one_scene(min(own, key=lambda row: row.measured.timing.run_s).case for own in groups.values())


def _winners(prices: Prices, accuracy: float) -> Iterator[Winner]:
    """The engines that are the cheapest somewhere, that of most scenes first."""
    best = [row for scene in prices.scenes if (row := prices.cheapest(scene, accuracy))]
    for name, own in sorted(grouped(best, engine_of).items(), key=lambda item: -len(item[1])):
        yield Winner(name, [scene_of(row) for row in own])


def _others(prices: Prices, accuracy: float) -> Iterator[Other]:
    for engine in prices.engines:
        ratios, missed, noisy = [], [], False
        for scene in prices.scenes:
            best, own = prices.cheapest(scene, accuracy), prices.cheapest(scene, accuracy, engine)
            if best is None or not prices.of(scene, engine):
                continue
            if own is None:
                missed.append(scene)
            elif run_s(own) > run_s(best):
                ratios.append(run_s(own) / run_s(best))
                noisy = noisy or own.is_noisy or best.is_noisy
        if ratios or missed:
            yield Other(engine, ratios, missed, noisy)


def _wins(prices: Prices) -> Counter[str]:
    found = (prices.cheapest(scene, accuracy) for scene in prices.scenes for accuracy in prices.accuracies)
    return Counter(engine_of(row) for row in found if row)


def _by_method(orders: Sequence[OrderRow], cell: Callable[[OrderRow], str]) -> Safe:
    """A row for each method, a column for each scene; methods of which there is nothing to see are left out."""
    scenes, lines = distinct(orders, scene_of), []
    for own in grouped(orders, pair_of).values():
        shown = {scene_of(row): cell(row) for row in own}
        if any(shown.values()):
            first = own[0]
            names = [first.case.engine, method_name(first.case), ORDER_CLAIMED.shown(first.series.order_claimed)]
            lines.append([*map(markdown, names), *(shown.get(scene, "") for scene in scenes)])
    return grid(["engine", "method", "claims", *map(markdown, scenes)], lines, range(2, 3 + len(scenes)))


def _order(row: OrderRow) -> str:
    """The order observed, bold where it is another than the claimed one, and where the error stops."""
    order, plateau = row.series.fit.order, row.series.plateau
    told = ORDER_OBSERVED.shown(order) if math.isfinite(order) else ""
    if order_differs(row.series.order_claimed, order):
        told = f"**{told}**"
    stops = f"stops at {number_text(plateau, '.1e')}" if math.isfinite(plateau) else ""
    return ", ".join(filter(None, [told, stops]))


def _digit(row: OrderRow) -> str:
    price = row.series.digit_price
    return times_text(price) if math.isfinite(price) else ""


def _dearer(cases: Sequence[CaseRow]) -> Iterator[tuple[str, float]]:
    """By what factor reading every state makes the steps of an engine dearer: the median of those that are fixed."""
    for engine, own in grouped(cases, engine_of).items():
        timings = [row.timing for row in own if row.case.dt is not None]
        factors = [timing.step_and_state_us / timing.step_us for timing in timings if timing.step_us > 0]
        if known := [factor for factor in factors if math.isfinite(factor)]:
            yield engine, float(np.median(known))


def _odd(cases: Sequence[CaseRow]) -> Iterator[str]:
    """Every flag that is not about timing, once for all steps where it is about all of them."""
    for row in cases:
        series = f"{scene_of(row)}: {pair_of(row.series)}"
        yield from (f"{series}: {flag}" for flag in row.flags_of_steps)
        yield from (f"{case_name(row.case)}: {flag}" for flag in row.flags_of_run)
