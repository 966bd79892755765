"""What Python callers pay who need every state, and not only the last one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from pendbench.report.columns import NOTHING, duration_text, number_text, shown, times_text
from pendbench.report.cost_prices import Prices, way, why_not
from pendbench.report.cost_series import series
from pendbench.report.rows import Row, finite, in_order, method_name, number, of, word
from pendbench.report.text import listed, markdown, table

_READING: Final = """\
A call that takes many steps costs least. Who wants the state after each step calls the engine for each, and asks it:
the table gives the median cost of a step alone → with a look at the state after it. For a method that chooses its
steps it is that of one look, and of the advance to it from the look before."""


def callers(prices: Prices, accuracy: float) -> Iterator[str]:
    """The section: how much dearer steps become, and who is the cheapest to an accuracy with a look at every state."""
    factors = {engine: _factors(of(prices.cases, engine=engine)) for engine in prices.engines}
    told = [
        f"{number_text(np.median(own), '.2g')} times as much for {engine}" for engine, own in factors.items() if own
    ]
    if not told:
        yield "Nothing was timed."
        return
    yield _READING
    yield markdown(f"With a look after each, steps cost {listed(told)}, in the median case.", 1000)
    yield _by_method(prices)
    yield (
        f"The cheapest way to an error of {shown('accuracy', accuracy)} for such a caller, and what it costs up to the "
        "time of comparison, without looks → with them:"
    )
    yield _by_engine(prices, accuracy)


def _factors(cases: Sequence[Row]) -> list[float]:
    """How much dearer a step with a look is, for each case with a fixed step."""
    factors = (number(row, "step_and_state_us") / number(row, "step_us") for row in cases
               if math.isfinite(number(row, "dt")) and number(row, "step_us") > 0)  # fmt: skip
    return [factor for factor in factors if math.isfinite(factor)]


def _by_method(prices: Prices) -> str:
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for own in series(in_order(prices.cases)):
        key = word(own[0], "engine"), method_name(own[0])
        rows.setdefault(key, {})[word(own[0], "scene")] = _look(own)
    lines = [[markdown(engine), markdown(method), *(cells.get(scene, NOTHING) for scene in prices.scenes)]
             for (engine, method), cells in rows.items()]  # fmt: skip
    return table(["engine", "method", *map(markdown, prices.scenes)], lines)


def _look(cases: Sequence[Row]) -> str:
    """How much dearer a look makes the steps of a method: the medians over its steps."""
    both, alone = finite(cases, "step_and_state_us"), finite(cases, "step_us")
    if not both or not alone:
        return NOTHING
    dearer, cheaper = float(np.median(both)), float(np.median(alone))
    if math.isnan(number(cases[0], "dt")):
        return f"{shown('step_and_state_us', dearer)} µs a look"
    steps = f"{shown('step_us', cheaper)} → {shown('step_and_state_us', dearer)} µs"
    return f"{steps} ({times_text(dearer / cheaper)})"


def _by_engine(prices: Prices, accuracy: float) -> str:
    lines = []
    for scene in prices.scenes:
        best = {engine: _cheapest(prices, scene, engine, accuracy) for engine in prices.engines}
        least = min((number(row, "with_states_s") for row in best.values() if row), default=math.nan)
        lines.append([markdown(scene), *(_cell(prices, scene, engine, best, least) for engine in prices.engines)])
    return table(["scene", *map(markdown, prices.engines)], lines)


def _cheapest(prices: Prices, scene: str, engine: str, accuracy: float) -> Row | None:
    rows = [row for row in of(prices.rows, scene=scene, engine=engine)
            if number(row, "accuracy") == accuracy and number(row, "with_states_s") > 0]  # fmt: skip
    return min(rows, key=lambda row: number(row, "with_states_s"), default=None)


def _cell(prices: Prices, scene: str, engine: str, best: Mapping[str, Row | None], least: float) -> str:
    row = best[engine]
    if row is None:
        return markdown(why_not(prices, scene, engine))
    cost = number(row, "with_states_s")
    time = f"{duration_text(number(row, 'run_s'))} → {duration_text(cost)}"
    time = f"**{time}**" if cost == least else f"{time} ({times_text(cost / least)})"
    return f"{time}: {markdown(way(row, with_engine=False))}"
