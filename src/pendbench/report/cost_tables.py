"""The tables of a study of kind `cost`: what to use, time to accuracy, and orders."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

from pendbench.report import sections
from pendbench.report.columns import NOTHING, duration_text, is_missing, number_text, shown, times_text
from pendbench.report.cost_prices import Prices, way, why_not
from pendbench.report.cost_series import series
from pendbench.report.rows import Row, distinct, in_order, is_ok, method_name, number, of, word
from pendbench.report.text import listed, markdown, table

_ORDERS: Final = (
    "scene", "engine", "method", "order_claimed", "order_observed", "plateau", "digit_price", "best_error",
)  # fmt: skip


def what_to_use(prices: Prices) -> str:
    """One line for each scene and accuracy: the cheapest of all, and the best of each other engine."""
    headings = ["scene", "error up to", "use", "ms per simulated s", "the best of the others, ms per simulated s"]
    lines = [_use(prices, scene, accuracy) for scene in prices.scenes for accuracy in prices.accuracies]
    return table(headings, lines, (1, 3))


def _use(prices: Prices, scene: str, accuracy: float) -> list[str]:
    best = prices.cheapest(scene, accuracy)
    line = [markdown(scene), shown("accuracy", accuracy)]
    if best is None:
        return [*line, "nothing gets there", NOTHING, NOTHING]
    others = [engine for engine in prices.engines if engine != word(best, "engine")]
    told = "; ".join(_best_of(prices, scene, accuracy, engine) for engine in others)
    return [*line, f"**{markdown(way(best))}**", _cost(prices, best), told or NOTHING]


def _cost(prices: Prices, row: Row) -> str:
    return f"{_at_most(row)}{number_text(1e3 * prices.per_simulated_s(row), '.2g')}"


def _at_most(row: Row) -> str:
    """The sign of a price that is an upper bound."""
    return "≤ " if str(row.get("bound")).lower() == "true" else ""


def _best_of(prices: Prices, scene: str, accuracy: float, engine: str) -> str:
    row = prices.cheapest(scene, accuracy, engine)
    if row is None:
        return markdown(f"{engine} {why_not(prices, scene, engine)}")
    return f"{markdown(way(row))}: {_cost(prices, row)}"


def time_to_accuracy(prices: Prices, scene: str) -> str:
    """For one scene: each engine's time to each accuracy, how, and how many times that of the cheapest."""
    headings = ["engine", *(f"to {shown('accuracy', accuracy)}" for accuracy in prices.accuracies)]
    lines = [[markdown(engine), *_engine_cells(prices, scene, engine)] for engine in prices.engines]
    return table(headings, lines)


def _engine_cells(prices: Prices, scene: str, engine: str) -> Iterator[str]:
    for accuracy in prices.accuracies:
        row = prices.cheapest(scene, accuracy, engine)
        if row is None:
            yield markdown(why_not(prices, scene, engine))
        else:
            yield f"{_time(prices, row, accuracy)}: {markdown(way(row, with_engine=False))}"


def _time(prices: Prices, row: Row, accuracy: float) -> str:
    """How long it takes, and how many times as long as the cheapest; bold where nothing is cheaper."""
    best = prices.cheapest(word(row, "scene"), accuracy)
    time = f"{_at_most(row)}{duration_text(number(row, 'run_s'))}"
    if best is None or number(best, "run_s") == number(row, "run_s"):
        return f"**{time}**"
    return f"{time} ({times_text(number(row, 'run_s') / number(best, 'run_s'))})"


def every_method(prices: Prices, scene: str) -> str:
    """For one scene: each method's time to each accuracy."""
    headings = ["engine", "method", *(f"to {shown('accuracy', accuracy)}" for accuracy in prices.accuracies)]
    lines = []
    for own in series(in_order(of(prices.cases, scene=scene))):
        first = own[0]
        rows = of(prices.rows, scene=scene, engine=word(first, "engine"), method=word(first, "method"),
                  settings=word(first, "settings"))  # fmt: skip
        lines.append([sections.cell(first, "engine"), markdown(method_name(first)), *_method_cells(prices, rows, own)])
    return table(headings, lines)


def _method_cells(prices: Prices, rows: Sequence[Row], cases: Sequence[Row]) -> Iterator[str]:
    """A cell for each accuracy; how near a method gets is said once."""
    by_accuracy = {number(row, "accuracy"): row for row in rows}
    told = False
    for accuracy in prices.accuracies:
        row = by_accuracy.get(accuracy, {})
        if math.isfinite(number(row, "run_s")):
            yield _time(prices, row, accuracy)
        else:
            yield NOTHING if told else _missed(row, cases)
            told = True


def _missed(row: Row, cases: Sequence[Row]) -> str:
    if math.isfinite(number(row, "best_error")):
        return f"not reached (best {shown('best_error', row['best_error'])})"
    statuses = distinct([case for case in cases if not is_ok(case)], "status")
    return markdown(f"none measured ({listed(statuses)})") if statuses else "not timed"


def orders(rows: Sequence[Row]) -> str:
    """Orders claimed and seen, plateaus, the price of a digit, and the smallest error, by scene and method."""
    by_scene = [row for scene in distinct(rows, "scene") for row in in_order(of(rows, scene=scene))]
    return sections.rows_table([_order(row) for row in by_scene], _ORDERS)


def _order(row: Row) -> dict[str, Any]:
    """A row of orders as people read it."""
    observed = shown("order_observed", row.get("order_observed"))
    coarse, fine = (shown(name, row.get(name)) for name in ("order_dt_coarse", "order_dt_fine"))
    price = number(row, "digit_price")
    return {
        **row,
        "method": method_name(row),
        "order_observed": NOTHING if is_missing(row.get("order_observed")) else f"{observed} ({coarse} to {fine} s)",
        "digit_price": NOTHING if math.isnan(price) else times_text(price),
    }
