"""What a study writes for people to read: tables, plots and a page. Knows nothing but rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from rich.table import Table

    from pendbench.study.results import Results

__all__ = ["answer", "summary_table", "write_report"]


def write_report(results: Results, out: Path) -> None:
    """Write the report of a study into the folder `out`: report.md, plots/, CSV files and provenance.json."""
    from pendbench.report.write import write_report as write

    write(results, out)


def summary_table(results: Results) -> Table:
    """The study's rows for the terminal."""
    from pendbench.report.terminal import summary_table as table

    return table(results)


def answer(results: Results) -> str:
    """The study's answer in two sentences, plain text."""
    from pendbench.report.page import page

    return page(results.kind).answer(results)
