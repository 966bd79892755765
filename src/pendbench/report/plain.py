"""The page of a study whose kind has no page of its own: its rows, what failed, and where the numbers come from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from pendbench.report import sections
from pendbench.report.columns import in_order
from pendbench.report.plots import Picture
from pendbench.report.rows import is_ok, records
from pendbench.report.text import counted
from pendbench.study.results import Results

SUMMARY: Final = ("scene", "engine", "method", "dt", "status", "error_max", "energy_drift_max", "step_us", "flags")


def answer(results: Results) -> str:
    """How many cases ended well: all that is known of any kind of study."""
    rows = records(results.cases)
    return f"{counted(sum(map(is_ok, rows)), 'case')} of {len(rows)} ended well."


def pictures(results: Results) -> Iterator[Picture]:
    """No plots."""
    del results
    yield from ()


def markdown_page(results: Results, plots: Sequence[Picture]) -> str:
    """The report."""
    del plots
    rows = records(results.cases)
    names = in_order(str(name) for name in results.cases.columns)
    parts = [
        *sections.opening(results),
        answer(results),
        "## The cases",
        sections.rows_table(rows, names),
        "## What failed",
        sections.failures(rows),
        "## What the columns mean",
        sections.definitions(names),
        "## How far to trust the timings",
        sections.timing_trust(rows),
        "## Where the numbers come from",
        sections.provenance_table(results.provenance),
        sections.files(results),
    ]
    return "\n\n".join(parts) + "\n"
