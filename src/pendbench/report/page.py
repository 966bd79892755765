"""What a kind of study shows, found in its folder, and the page that is made of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, cast

from pendbench.report.columns import Table
from pendbench.report.names import is_ok
from pendbench.report.template import render, render_block
from pendbench.study.kinds import part_of_kind

if TYPE_CHECKING:
    from pendbench.report.plots import Picture
    from pendbench.study.case import Case
    from pendbench.study.results import Results


class Columns(Protocol):
    """What the module `columns` of a kind offers. SUMMARY: the columns of `cases` that are worth a glance.

    It may have `GLANCE`, another table and its columns, for the terminal to show in place of these.
    """

    SUMMARY: Sequence[str]

    def tables(self, results: Results[Any]) -> Sequence[Table]:
        """Every table of the study; the first has a row for each case."""


class Page(Protocol):
    """What the module `page` of a kind offers, where it has one."""

    def facts(self, results: Results[Any], tables: dict[str, Table]) -> Any:
        """What the template says, as a dataclass: its fields are the template's names."""

    def pictures(self, results: Results[Any], tables: dict[str, Table]) -> Iterable[Picture]:
        """The study's plots."""


class Moving(Protocol):
    """What the module `page` of a kind offers besides, where something is to be seen moving."""

    def moving(self, results: Results[Any], tables: dict[str, Table]) -> Sequence[Case]:
        """Cases of one scene to show side by side: of each engine one, its best or the one that is typical of it."""


class Report:
    """A study's results as people read them. Its parts are made when they are first asked for."""

    def __init__(self, results: Results[Any]) -> None:
        self.results = results
        self._columns = cast(Columns, part_of_kind(results.kind, "columns"))
        self._page = cast("Page | None", part_of_kind(results.kind, "page"))

    @cached_property
    def tables(self) -> dict[str, Table]:
        """The tables by name, `cases` first."""
        return {table.name: table for table in self._columns.tables(self.results)}

    @property
    def cases(self) -> Table:
        """The table of cases."""
        return self.tables["cases"]

    @property
    def summary(self) -> Sequence[str]:
        """The columns of `cases` that are worth a glance."""
        return self._columns.SUMMARY

    @property
    def glance(self) -> tuple[Table, Sequence[str]]:
        """The table that a terminal shows, and its columns."""
        name, columns = getattr(self._columns, "GLANCE", ("cases", self.summary))
        return self.tables[name], columns

    @cached_property
    def pictures(self) -> list[Picture]:
        """The plots."""
        return [] if self._page is None else list(self._page.pictures(self.results, self.tables))

    @property
    def moving(self) -> Sequence[Case]:
        """The cases that the page shows in motion."""
        if not hasattr(self._page, "moving"):
            return ()
        return cast(Moving, self._page).moving(self.results, self.tables)

    @cached_property
    def answer(self) -> str:
        """The study's answer in at most three sentences, plain text on one line."""
        return render_block(self._template, "answer", self._facts)

    def markdown(self) -> str:
        """The page."""
        return render(self._template, self._facts | {"pictures": {plot.name: plot for plot in self.pictures}})

    @property
    def _template(self) -> str:
        return "page.md.j2" if self._page is None else f"{self.results.kind}/page.md.j2"

    @cached_property
    def _facts(self) -> dict[str, Any]:
        own = None if self._page is None else self._page.facts(self.results, self.tables)
        told = {} if own is None else {field.name: getattr(own, field.name) for field in dataclasses.fields(own)}
        return {
            **self.tables,
            "title": self.results.title,
            "quick": self.results.quick,
            "options": self.results.options,
            "provenance": self.results.provenance,
            "scenes": self.tables.get("scenes"),
            "proven": (),  # a kind that compares with truths says of which
            "tables": list(self.tables.values()),
            "columns": [column.name for column in self.cases.columns],
            "well": sum(map(is_ok, self.cases)),
            **told,
        }
