"""Writes what a study found: CSV files, plots, provenance and the report. Each file is there whole or not at all."""

from __future__ import annotations

from pathlib import Path

from pendbench.base.files import write_whole
from pendbench.report.html_page import html_page
from pendbench.report.page import Report
from pendbench.report.sections import provenance_json
from pendbench.report.stage.records import Stage
from pendbench.report.tables import csv_text


def write_report(report: Report, out: Path, stage: Stage | None = None) -> None:
    """Write a CSV file for each table, plots/, provenance.json, report.html and, last, report.md into `out`.

    stage: what moves in report.html.
    """
    write_tables(report, out)
    for plot in report.pictures:
        _write(out / "plots" / f"{plot.name}.png", plot.png)
    text = report.markdown()
    pictures = {f"plots/{plot.name}.png": plot.drawn for plot in report.pictures}
    _write(out / "report.html", html_page(text, report.answer, pictures, stage).encode())
    _write(out / "report.md", text.encode())


def write_tables(report: Report, out: Path) -> None:
    """Write a CSV file for each table, and provenance.json: all of it that programs read."""
    for table in report.tables.values():
        _write(out / f"{table.name}.csv", csv_text(table).encode())
    _write(out / "provenance.json", provenance_json(report.results.provenance).encode())


def _write(path: Path, content: bytes) -> None:
    write_whole(path, lambda file: file.write(content))
