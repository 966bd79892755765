"""What the three causes say about each method, and the growth of errors about each scene."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from pendbench.kinds.chaos.rows import CaseRow, MethodRow, SceneRow
from pendbench.report.columns import ENGINE, METHOD, ORDER_CLAIMED, ORDER_OBSERVED, Column, Table, text_column
from pendbench.report.names import finite, grouped, is_ok, method_name, pair_of, scene_of, spanned
from pendbench.report.numbers import number_text
from pendbench.report.text import listed
from pendbench.study.case import Case

#: Errors that agree to this share of themselves, at every step and in every scene, come from the same method.
_SAME: Final = 1e-3
_ROUNDING: Final = 1e-6  # smaller errors hold a share of rounding, amplified by chaos, that matters at `_SAME`
_NEAR: Final = 1.5  # how near a fitted rate is to be: rates over a few Lyapunov times are rough
_LONG: Final = 5.0  # Lyapunov times for which an error must have grown before its rate speaks of chaos
_NAMED: Final = 3


@dataclass(frozen=True)
class Summary:
    """A method in all its scenes."""

    rows: Sequence[MethodRow]

    @property
    def case(self) -> Case:
        """The method in one of them."""
        return self.rows[0].case

    @property
    def order_claimed(self) -> int | None:
        """The order of the method by its makers."""
        return self.rows[0].order_claimed

    @property
    def model_error(self) -> float:
        """The largest of the scenes."""
        return max((row.model.error for row in self.rows if not math.isnan(row.model.error)), default=math.nan)

    @property
    def system(self) -> str:
        """Whether it is the scenes' own."""
        other = [row for row in self.rows if row.another_system]
        if math.isnan(self.model_error):
            return "not known"
        return "the same" if not other else "another" if len(other) == len(self.rows) else f"another in {_named(other)}"

    @property
    def orders(self) -> str:
        """The orders seen, as a range."""
        orders = finite(row.fit.order for row in self.rows)
        return spanned(orders, ORDER_OBSERVED.shown) if orders else ""

    @property
    def plateaus(self) -> str:
        """Where smaller steps do not bring the error down, and the errors there, as a range."""
        flat = [row for row in self.rows if row.fit.plateau is not None and not row.scene.still]
        levels = finite(row.fit.plateau for row in flat)
        return f"{spanned(levels, lambda level: number_text(level, '.1e'))} in {_named(flat)}" if flat else ""


def _named(rows: Sequence[MethodRow]) -> str:
    return listed(list(map(scene_of, rows))) if len(rows) <= _NAMED else f"{len(rows)} scenes"


_SUMMARY: Final = (
    ENGINE,
    METHOD.at(lambda row: method_name(row.case)),
    Column("model_error", "1", ".1e", "model error", "the largest of the scenes"),
    text_column("system", "system", "whether it is the scenes' own"),
    ORDER_CLAIMED,
    text_column("orders", "orders seen", "of the scenes"),
    text_column("plateaus", "the error stops at", "where smaller steps do not bring it down"),
)


def summaries(causes: Sequence[MethodRow]) -> Table:
    """A row for each method."""
    return Table("methods", _SUMMARY, [Summary(own) for own in grouped(causes, pair_of).values()])


@dataclass(frozen=True)
class Growth:
    """What chaos does in a scene to any small error, 1/s, and the rates of the cases that stay with the truth long."""

    scene: SceneRow
    chaos: float
    rates: Sequence[float]

    @property
    def ratios(self) -> list[float]:
        """The rates over what chaos does."""
        return [rate / self.chaos for rate in self.rates]

    @property
    def near(self) -> str:
        """How many of them are as chaos has it."""
        near = sum(1 / _NEAR <= ratio <= _NEAR for ratio in self.ratios)
        return f"{near} of {len(self.rates)}" if self.rates else ""


_GROWTH: Final = (
    text_column("scene", "scene", "the scene's name", lambda row: row.scene.scene.name),
    Column("chaos", "1/s", ".3g", "chaos, 1/s", "the growth of a neighbour; the exponent where that is not known"),
    Column("cases", "1", "d", "cases", "those that stay with the truth long enough", lambda row: len(row.rates)),
    text_column("rates", "their errors grow at, 1/s", "from the slowest to the fastest",
                lambda row: spanned(row.rates, number_text) if row.rates else ""),
    text_column("ratios", "over chaos", "the same, over the rate of chaos",
                lambda row: spanned(row.ratios, number_text) if row.rates else ""),
    text_column("near", f"within a factor of {_NEAR:g}", "how many are as chaos has it"),
)  # fmt: skip


def growths(scenes: Sequence[SceneRow], cases: Sequence[CaseRow]) -> Table:
    """A row for each chaotic scene."""
    own = grouped(cases, scene_of)
    chaotic = [row for row in scenes if row.exponent.chaotic]
    return Table("growth", _GROWTH, [_growth(row, own.get(row.scene.name, [])) for row in chaotic])


def _growth(scene: SceneRow, cases: Sequence[CaseRow]) -> Growth:
    neighbour, exponent = scene.neighbour.growth, scene.exponent.rate
    long = [row for row in cases if row.stays_until * exponent >= _LONG]
    rates = finite(row.own.growth for row in long)
    return Growth(scene, exponent if math.isnan(neighbour) else neighbour, rates)


def twins(cases: Sequence[CaseRow]) -> list[list[str]]:
    """Groups of methods, of whatever engines, whose errors are the same wherever they can be compared.

    Different programs that agree on their errors run the same method on the same system; what is left between them is
    speed.
    """
    errors = {name: dict(_errors(own)) for name, own in grouped(cases, pair_of).items()}
    groups = [{name} for name in errors]
    for one, other in combinations(errors, 2):
        if _alike(errors[one], errors[other]):
            joined = [group for group in groups if group & {one, other}]
            groups = [group for group in groups if group not in joined] + [set().union(*joined)]
    return sorted(sorted(group) for group in groups if len(group) > 1)


def _errors(rows: Sequence[CaseRow]) -> Iterator[tuple[tuple[str, float], float]]:
    for row in rows:
        error, dt = row.own.error_half, row.case.dt
        if dt is not None and is_ok(row) and _ROUNDING < error < np.inf:
            yield (scene_of(row), dt), error


def _alike(one: dict[tuple[str, float], float], other: dict[tuple[str, float], float]) -> bool:
    common = one.keys() & other.keys()
    return len(common) >= 3 and all(math.isclose(one[key], other[key], rel_tol=_SAME) for key in common)
