"""Which page a kind of study has. Adding one is adding its module's name here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, Protocol, cast

if TYPE_CHECKING:
    from pendbench.report.plots import Picture
    from pendbench.study.results import Results

#: Kinds of study, each with the module of its page. The others have the plain one.
PAGES: Final = {
    "chaos": "pendbench.report.chaos",
    "cost": "pendbench.report.cost",
    "stability": "pendbench.report.stability",
    "scaling": "pendbench.report.scaling",
    "ensemble": "pendbench.report.ensemble",
    "effects": "pendbench.report.effects",
}

_PLAIN: Final = "pendbench.report.plain"


class Page(Protocol):
    """What the module of a page offers. SUMMARY: the columns of the terminal's table."""

    SUMMARY: Sequence[str]

    def answer(self, results: Results) -> str:
        """The study's answer in two sentences."""

    def pictures(self, results: Results) -> Iterator[Picture]:
        """The study's plots."""

    def markdown_page(self, results: Results, plots: Sequence[Picture]) -> str:
        """The report."""


def page(kind: str) -> Page:
    """The page of a kind of study."""
    module: Any = import_module(PAGES.get(kind, _PLAIN))
    return cast(Page, module)
