"""What an accuracy costs: the table of prices, asked by scene, engine and accuracy, and shown in tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from pendbench.kinds.cost.columns import CaseRow, PriceRow
from pendbench.kinds.cost.series import Measured
from pendbench.report.names import case_name, distinct, engine_of, grouped, method_name, pair_of, scene_of
from pendbench.report.numbers import NOTHING, duration_text, number_text, times_text
from pendbench.report.text import Safe, grid, listed, markdown

#: Where engines are compared: half-way between a plot that looks right and rounding, on a logarithmic scale.
_COMPARED_AT: Final = 1e-4

Cost = Callable[[PriceRow], float]


def run_s(row: PriceRow) -> float:
    """What is paid by who wants the last state."""
    return row.price.run_s


def with_states_s(row: PriceRow) -> float:
    """What is paid by who reads every state."""
    return row.with_states_s


@dataclass(frozen=True, eq=False)
class Prices:
    """rows: of the table of prices, one for each method and accuracy. cases: what they were made of."""

    rows: Sequence[PriceRow]
    cases: Sequence[CaseRow]

    @cached_property
    def scenes(self) -> list[str]:
        """The scenes, in the order of the study."""
        return distinct(self.cases, scene_of)

    @cached_property
    def engines(self) -> list[str]:
        """The engines, in the order of the study."""
        return distinct(self.cases, engine_of)

    @cached_property
    def accuracies(self) -> list[float]:
        """The errors whose price was asked for, the largest first."""
        return sorted({row.accuracy for row in self.rows}, reverse=True)

    @property
    def compared_at(self) -> float:
        """The accuracy at which engines are compared; nan where none was asked for."""
        return min(self.accuracies, key=lambda accuracy: abs(math.log(accuracy / _COMPARED_AT)), default=math.nan)

    @cached_property
    def _reached(self) -> dict[tuple[str, float], list[PriceRow]]:
        known = [row for row in self.rows if 0 < run_s(row) < math.inf]
        return grouped(known, lambda row: (scene_of(row), row.accuracy))

    def cheapest(self, scene: str, accuracy: float, engine: str = "", cost: Cost = run_s) -> PriceRow | None:
        """The cheapest way to the accuracy, of all engines or of one; None where none gets there."""
        able = [row for row in self._reached.get((scene, accuracy), ()) if engine in ("", engine_of(row))]
        return min(able, key=cost, default=None)

    def of(self, scene: str, engine: str) -> list[Measured]:
        """The cases of an engine in a scene."""
        return [row.measured for row in self.cases if scene_of(row) == scene and engine_of(row) == engine]

    def most_accurate(self, scene: str, engine: str) -> Measured | None:
        """The case with the smallest error of an engine in a scene; None where nothing could be measured."""
        known = [row for row in self.of(scene, engine) if row.is_measured]
        return min(known, key=lambda row: row.run.error_max, default=None)


def way(row: PriceRow) -> str:
    """How a price is had, in words: ``rk4, step 0.00308 s``."""
    if math.isfinite(row.tolerance):
        return f"{method_name(row.case)}, tolerance {number_text(row.tolerance, '.1e')}"
    step = f", step {number_text(row.dt)} s" if math.isfinite(row.dt) else ""
    return method_name(row.case) + step


def why_not(cases: Iterable[Measured]) -> str:
    """Why these have no price for an accuracy: how near they get, or what became of them."""
    rows = list(cases)
    best = min((row.run.error_max for row in rows if row.is_measured), default=math.nan)
    if math.isfinite(best):
        return f"not reached (best {number_text(best, '.1e')})"
    if not rows:
        return "did not take part"
    return f"none measured ({listed(distinct(rows, lambda row: 'no error' if row.status == 'ok' else row.status))})"


def time_of(row: PriceRow, least: PriceRow | None, cost: Cost = run_s) -> str:
    """How long it takes, and how many times as long as the cheapest; bold where nothing is cheaper."""
    time = f"{'≤ ' if row.price.bound else ''}{duration_text(cost(row))}{' ?' if row.is_noisy else ''}"
    if least is None or cost(row) == cost(least):
        return f"**{time}**"
    return f"{time} ({times_text(cost(row) / cost(least))})"


def best_of_engines(prices: Prices, accuracy: float, cost: Cost = run_s) -> Safe:
    """A row for each scene, a column for each engine: what an accuracy costs, and with what."""
    lines = []
    for scene in prices.scenes:
        cells = (_best(prices, scene, accuracy, engine, cost) for engine in prices.engines)
        lines.append([markdown(scene), *cells])
    return grid(["scene", *map(markdown, prices.engines)], lines)


def time_to_accuracy(prices: Prices, scene: str) -> Safe:
    """For one scene: each engine's time to each accuracy, and with what."""
    lines = []
    for engine in prices.engines:
        cells = (_best(prices, scene, accuracy, engine) for accuracy in prices.accuracies)
        lines.append([markdown(engine), *cells])
    return grid(["engine", *_headings(prices)], lines)


def _headings(prices: Prices) -> list[str]:
    return [f"to {number_text(accuracy, '.0e')}" for accuracy in prices.accuracies]


def _best(prices: Prices, scene: str, accuracy: float, engine: str, cost: Cost = run_s) -> str:
    row = prices.cheapest(scene, accuracy, engine, cost)
    if row is None:
        return markdown(why_not(prices.of(scene, engine)))
    return f"{time_of(row, prices.cheapest(scene, accuracy, cost=cost), cost)}: {markdown(way(row))}"


def every_method(prices: Prices, scene: str) -> Safe:
    """For one scene: each method's time to each accuracy."""
    own = [row for row in prices.rows if scene_of(row) == scene]
    lines = []
    for rows in grouped(own, pair_of).values():
        case = rows[0].case
        lines.append([markdown(case.engine), markdown(method_name(case)), *_method_cells(prices, rows)])
    return grid(["engine", "method", *_headings(prices)], lines)


def _method_cells(prices: Prices, rows: Sequence[PriceRow]) -> Iterator[str]:
    """A cell for each accuracy; how near a method gets is said once."""
    told = False
    for row in sorted(rows, key=lambda row: -row.accuracy):
        if math.isfinite(run_s(row)):
            yield time_of(row, prices.cheapest(scene_of(row), row.accuracy))
        else:
            yield NOTHING if told else markdown(why_not(row.series.rows))
            told = True


def pendulum(prices: Prices, scene: str, accuracy: float) -> Safe:
    """For one scene: each engine's time to an accuracy, and the smallest error that it reaches."""
    lines = []
    for engine in prices.engines:
        cells = [markdown(engine), _best(prices, scene, accuracy, engine)]
        if best := prices.most_accurate(scene, engine):
            cells += [number_text(best.run.error_max, ".1e"), markdown(case_name(best.case, with_scene=False))]
        lines.append([*cells, *[NOTHING] * (4 - len(cells))])
    return grid(["engine", f"to {number_text(accuracy, '.0e')} m", "smallest error", "of"], lines, (2,))
