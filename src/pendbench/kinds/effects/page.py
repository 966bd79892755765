"""What the page of a study of kind `effects` says; the sentences are in page.md.j2."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from pendbench.kinds.effects.columns import BEST, BestRow, CaseRow, OrderRow, price_text
from pendbench.kinds.effects.plots import balance_figure, price_figure
from pendbench.kinds.effects.study import ALL, BARE, DEFAULTS, Found, Priced
from pendbench.report.columns import ORDER_CLAIMED, ORDER_OBSERVED, Table
from pendbench.report.names import distinct, engine_of, finest, finite, grouped, in_one_scene, is_ok, pair_of, scene_of
from pendbench.report.numbers import number_text
from pendbench.report.plots import Drawn, Picture
from pendbench.report.sections import status_text
from pendbench.report.styles import Styles
from pendbench.report.text import Safe, grid, markdown
from pendbench.study.case import Case
from pendbench.study.results import Results
from pendbench.truth.proof.known import Proven, proven

_UNSMOOTH: Final = 0.5


@dataclass(frozen=True)
class Facts:
    """Everything that the template says.

    best: of each engine, the most accurate first; leaders: those of them that none is told from by its error. told: the
    cheapest and the dearest effect, of those whose prices are not noise. fine: cases at the finest step. uncompared: of
    cases that ended well, by scene and reason. upright: of a single link on a driven pivot. flags: whether default
    flags are priced.
    """

    best: Table
    leaders: Sequence[str]
    priced: int
    told: Sequence[Priced]
    refused: int
    fine: Sequence[CaseRow]
    uncompared: Sequence[tuple[str, str]]
    orders_by_scene: Safe
    upright: Sequence[CaseRow]
    prices_by_effect: Safe
    spread_median: float
    spread_worst: float
    flags: bool
    proven: Sequence[Proven]


def facts(results: Results[Found], tables: dict[str, Table]) -> Facts:
    """What the page says."""
    cases: list[CaseRow] = list(tables["cases"])
    prices: list[Priced] = list(tables["prices"])
    fine = finest(filter(is_ok, cases))
    measured = [row for row in prices if row.measured]
    alone = [row for row in measured if row.effect not in (BARE, ALL, DEFAULTS)]
    spreads = [row.price.spread / row.price.ratio for row in measured]
    driven = {scene.name for scene in results.found.scenes if "driven_pivot" in scene.terms and scene.n == 1}
    best = Table("best", BEST, list(_best(fine, measured)))
    return Facts(
        best=best,
        leaders=[pair_of(row) for row in best if _as_good(best, row)],
        priced=len(alone),
        told=_ends([row for row in alone if not row.noisy]),
        refused=sum(row.status == "refused" for row in cases),
        fine=fine,
        uncompared=distinct(
            (row for row in cases if is_ok(row) and row.reason), lambda row: (scene_of(row), row.reason)
        ),
        orders_by_scene=_orders_by_scene(list(tables["orders"])),
        upright=[row for row in fine if scene_of(row) in driven],
        prices_by_effect=_prices_by_effect(prices),
        spread_median=float(np.median(spreads)) if spreads else math.nan,
        spread_worst=max(spreads, default=math.nan),
        flags=any(row.effect == DEFAULTS for row in prices),
        proven=proven(results.found.scenes),
    )


def _best(fine: Sequence[CaseRow], prices: Sequence[Priced]) -> list[BestRow]:
    """Of each engine the method with most scenes, and of these the one with the smallest worst error."""
    known = [row for row in fine if math.isfinite(row.run.error_max)]
    whole = {pair_of(row): row for row in prices if row.effect not in (BARE, DEFAULTS)}  # the last is of all effects
    rows = [_worst(own, whole.get(name)) for name, own in grouped(known, pair_of).items()]
    best = [min(own, key=_rank) for own in grouped(rows, engine_of).values()]
    return sorted(best, key=_rank)


def _worst(own: Sequence[CaseRow], priced: Priced | None) -> BestRow:
    errors, balances = [row.run.error_max for row in own], finite(row.run.balance_error for row in own)
    return BestRow(own[0].case, len(own), max(errors), max(balances, default=math.nan), priced)


def _rank(row: BestRow) -> tuple[int, float]:
    return -row.scenes, row.error_max


def _as_good(best: Table, row: BestRow) -> bool:
    """Whether a row reads like the first."""
    return all(best.text(row, name) == best.text(best.rows[0], name) for name in ("scenes", "error_max"))


def _ends(prices: Sequence[Priced]) -> list[Priced]:
    """The cheapest and the dearest."""
    by_price = sorted(prices, key=lambda row: row.price.ratio)
    return [by_price[0], by_price[-1]] if by_price else []


def _orders_by_scene(orders: Sequence[OrderRow]) -> Safe:
    """A row for each scene, a column for each method: the order observed, and bold where it is below the claim."""
    names = distinct(orders, pair_of)
    claimed = {pair_of(row): ORDER_CLAIMED.text(row) for row in orders}
    lines = []
    for scene, own in grouped(orders, scene_of).items():
        shown = {pair_of(row): _order(row) for row in own}
        lines.append([markdown(scene), *(shown.get(name, "") for name in names)])
    heads = ["scene", *(f"{markdown(name)} ({claimed[name]})" for name in names)]
    return grid(heads, lines, range(1, len(heads)))


def _order(row: OrderRow) -> str:
    told = ORDER_OBSERVED.text(row)
    return f"**{told}**" if row.order_observed < row.order_claimed - _UNSMOOTH else told


def _prices_by_effect(prices: Sequence[Priced]) -> Safe:
    """A row for each effect, a column for each method; its default flags count as an effect."""
    names = distinct(prices, _method)
    lines = []
    for effect, own in grouped(prices, lambda row: row.effect).items():
        shown = {_method(row): _price(row) for row in own}
        lines.append([markdown(effect), *(shown.get(name, "") for name in names)])
    return grid(["effect", *map(markdown, names)], lines, range(1, len(names) + 1))


def _method(row: Priced) -> str:
    return f"{row.case.engine} {row.case.method}"


def _price(row: Priced) -> str:
    if row.status == "refused":
        return "refused"
    return f"{price_text(row)} ({number_text(row.price.step_us)} µs)" if row.measured else status_text(row, 80)


def moving(results: Results[Found], tables: dict[str, Table]) -> list[Case]:
    """The best method of each engine at its finest step, in the scene with most effects of those with most engines."""
    del results
    fine = finest(row for row in tables["cases"] if is_ok(row))
    best = {pair_of(row) for row in _best(fine, [])}
    cases = [row.case for row in fine if pair_of(row) in best]
    return in_one_scene(sorted(cases, key=lambda case: -len(case.scene.terms)))


def pictures(results: Results[Found], tables: dict[str, Table]) -> Iterator[Picture]:
    """The prices of effects, and the balance of energy against the error."""
    del results
    prices = [row for row in tables["prices"] if row.measured and row.effect != BARE]
    if prices:
        caption = (
            "The cost of a step with one effect at a time, over that of the chain under gravity alone; hollow: noisy."
        )
        yield Picture("prices", "", caption, Drawn(partial(price_figure, prices)))
    measured = [row for row in tables["cases"] if row.run.balance_error > 0 and row.run.error_max > 0]
    if measured:
        caption = "The energy's balance against the error, each mark a scene and a step. An effect simulated "
        caption += "with a wrong law would keep both as steps shrink."
        yield Picture(
            "balance",
            "",
            caption,
            Drawn(partial(balance_figure, Styles.of_cases(row.case for row in measured), measured)),
        )
