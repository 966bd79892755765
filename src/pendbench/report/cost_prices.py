"""What an accuracy costs: the table of prices, asked by scene, engine and accuracy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pendbench.report.columns import shown
from pendbench.report.cost_series import is_measured
from pendbench.report.rows import Row, distinct, finite, method_name, number, of, records, word
from pendbench.report.text import listed
from pendbench.study.results import Results


@dataclass(frozen=True)
class Prices:
    """rows: of the table of prices, one for each method and accuracy. cases: what they were made of.

    seconds: simulated, by scene.
    """

    rows: Sequence[Row]
    cases: Sequence[Row]
    seconds: Mapping[str, float]

    @classmethod
    def of_results(cls, results: Results) -> Prices:
        """The prices that a study found."""
        cases = records(results.cases)
        seconds = {name: max(finite(of(cases, scene=name), "compare_s"), default=math.nan)
                   for name in distinct(cases, "scene")}  # fmt: skip
        return cls(records(results.tables.get("prices")), cases, seconds)

    @property
    def scenes(self) -> list[str]:
        """The scenes, in the order of the study."""
        return distinct(self.cases, "scene")

    @property
    def engines(self) -> list[str]:
        """The engines, in the order of the study."""
        return distinct(self.cases, "engine")

    @property
    def accuracies(self) -> list[float]:
        """The errors whose price was asked for, the largest first."""
        return sorted(set(finite(self.rows, "accuracy")), reverse=True)

    def cheapest(self, scene: str, accuracy: float, engine: str | None = None) -> Row | None:
        """The cheapest way to the accuracy, of all engines or of one; None where none gets there."""
        return min(self._reached(scene, accuracy, engine), key=_cost, default=None)

    def _reached(self, scene: str, accuracy: float, engine: str | None) -> Iterable[Row]:
        for row in of(self.rows, scene=scene) if engine is None else of(self.rows, scene=scene, engine=engine):
            if number(row, "accuracy") == accuracy and 0 < number(row, "run_s") < math.inf:
                yield row

    def most_accurate(self, scene: str, engine: str) -> Row | None:
        """The case with the smallest error of an engine in a scene; None where nothing could be measured."""
        known = [row for row in of(self.cases, scene=scene, engine=engine) if is_measured(row)]
        return min(known, key=lambda row: number(row, "error_max"), default=None)

    def per_simulated_s(self, row: Row) -> float:
        """What a row of prices costs: s of computing for a simulated second."""
        return number(row, "run_s") / self.seconds.get(word(row, "scene"), math.nan)


def _cost(row: Row) -> float:
    return number(row, "run_s")


def way(row: Row, *, with_engine: bool = True) -> str:
    """How a price is had, in words: ``mujoco rk4, step 0.00308 s``."""
    name = f"{word(row, 'engine')} {method_name(row)}" if with_engine else method_name(row)
    if math.isfinite(number(row, "tolerance")):
        return f"{name}, tolerance {shown('tolerance', row['tolerance'])}"
    return f"{name}, step {shown('dt', row.get('dt'))} s"


def why_not(prices: Prices, scene: str, engine: str) -> str:
    """Why an engine has no price for an accuracy in a scene: how near it gets, or what became of its cases."""
    cases = of(prices.cases, scene=scene, engine=engine)
    best = prices.most_accurate(scene, engine)
    if best is not None:
        return f"not reached (best {shown('best_error', best.get('error_max'))})"
    statuses = list(dict.fromkeys(word(row, "status") or "not known" for row in cases))
    return f"none measured ({listed(statuses)})" if cases else "did not take part"
