"""What the page of a study of kind `scaling` says; the sentences are in page.md.j2."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

from pendbench.kinds.scaling.columns import (
    ERROR,
    EXPONENT,
    EXPONENT_ERROR,
    LONGEST,
    LOST,
    MEMORY,
    PER_LINK,
    SPENT,
    STEP,
    TITLE,
    CaseRow,
    GrowthRow,
    LongestRow,
)
from pendbench.kinds.scaling.plots import cost_figure, longest_figure
from pendbench.kinds.scaling.study import Found
from pendbench.measures.orders import Growth
from pendbench.measures.titles import TITLES, Title
from pendbench.report.columns import DT, Column, Table, text_column
from pendbench.report.names import engine_of, finite, grouped, is_ok, pair_of
from pendbench.report.plots import Drawn, Picture
from pendbench.report.styles import Styles
from pendbench.report.tables import cross_table
from pendbench.report.text import Safe, markdown
from pendbench.study.case import Case
from pendbench.study.results import Results


@dataclass(frozen=True)
class Best:
    """The longest chain of an engine with a title, by its best method, and how that method's cost grows.

    noisy: how many of its timings are.
    """

    case: Case
    longest: LongestRow
    growth: Growth
    noisy: int
    timed: int


@dataclass(frozen=True)
class Won:
    """A title, what it asks for, and the longest chain of each engine."""

    title: Title
    best: Sequence[Best]


@dataclass(frozen=True)
class Facts:
    """Everything that the template says. fitted: methods of the best whose exponent is known, each once."""

    won: Sequence[Won]
    best: Table
    fitted: Sequence[Best]
    noisy: int
    longest: Table
    growth: Table
    steps: Safe
    per_link: Safe
    errors: Safe
    memory: Safe


_BEST: Final = (
    TITLE.at(lambda row: row.longest.title),
    text_column("method", "method", "engine and method", pair_of),
    LONGEST.at(lambda row: row.longest.longest_n),
    text_column("bound", "at least", "", lambda row: row.longest.bound),
    DT.at(lambda row: row.longest.dt),
    LOST.at(lambda row: row.longest.shown.lost),
    SPENT.at(lambda row: row.longest.shown.spent),
    EXPONENT,
    EXPONENT_ERROR,
    Column("noisy", "1", "d", "noisy timings", ""),
    Column("timed", "1", "d", "of", ""),
)


def facts(results: Results[Found], tables: dict[str, Table]) -> Facts:
    """What the page says."""
    del results
    cases, longest = list(tables["cases"]), grouped(tables["longest"], lambda row: str(row.title))
    won = [Won(title, list(_best(longest[title.name], tables["growth"].rows, cases))) for title in _won(longest)]
    best = Table("best", _BEST, [row for each in won for row in each.best])
    methods = {pair_of(row): row for row in best}
    return Facts(
        won=won,
        best=best,
        fitted=[row for row in methods.values() if finite([row.growth.exponent])],
        noisy=sum(row.noisy for row in methods.values()),
        longest=tables["longest"],
        growth=tables["growth"],
        steps=_by_links(cases, STEP, "µs"),
        per_link=_by_links(cases, PER_LINK, "ns"),
        errors=_by_links(cases, ERROR, "L"),
        memory=_by_links(cases, MEMORY, "MB"),
    )


def _won(longest: Mapping[str, object]) -> list[Title]:
    """The titles that the study asked for."""
    return [title for title in TITLES if title.name in longest]


def _best(longest: Sequence[LongestRow], growth: Sequence[GrowthRow], cases: Sequence[CaseRow]) -> Iterator[Best]:
    """The longest chain of each engine; without one, its first method."""
    grows, timed = {row.case: row.growth for row in growth}, grouped(filter(is_ok, cases), pair_of)
    for own in grouped(longest, engine_of).values():
        row = max(own, key=lambda row: row.longest_n if row.longest_n > 0 else 0)
        its = timed.get(pair_of(row), [])
        yield Best(row.case, row, grows[row.case], sum(each.timing.noisy for each in its), len(its))


def _by_links(cases: Sequence[CaseRow], column: Column, unit: str) -> Safe:
    """A row for each number of links, a column for each method."""
    ordered = sorted(cases, key=lambda row: row.case.scene.n)
    return cross_table(f"n ({unit})", ordered, lambda row: str(row.case.scene.n), pair_of, partial(_cell, column))


def _cell(column: Column, row: CaseRow) -> str:
    return markdown(column.text(row) if is_ok(row) else row.status)


def pictures(results: Results[Found], tables: dict[str, Table]) -> Iterator[Picture]:
    """The longest chains, and the cost of a step against n."""
    del results
    held = [row for row in tables["longest"] if row.longest_n > 0]
    if held:
        caption = "The longest chain with which each engine and method wins each title in real time. "
        caption += "Hatched: at least as long."
        yield Picture("longest", "", caption, Drawn(partial(longest_figure, _styles(held), held)))
    timed = [row for row in tables["cases"] if row.timing.step_us > 0]
    if timed:
        caption = "The cost of a step for each link against the number of links. Level: the cost grows like the chain."
        yield Picture("cost", "", caption, Drawn(partial(cost_figure, _styles(timed), timed)))


def _styles(rows: Sequence[LongestRow] | Sequence[CaseRow]) -> Styles:
    return Styles.of_cases(row.case for row in rows)
