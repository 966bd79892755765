"""Writes what a study found: CSV files, plots, provenance and the report. Each file is there whole or not at all."""

from __future__ import annotations

from pathlib import Path

from pendbench.files import write_whole
from pendbench.report.page import page
from pendbench.report.sections import provenance_json
from pendbench.report.tables import csv_text
from pendbench.report.text import file_name
from pendbench.study.results import Results


def write_report(results: Results, out: Path) -> None:
    """Write cases.csv, the other tables, plots/, provenance.json and, last, report.md into the folder `out`."""
    names = {"cases"}
    _write(out / "cases.csv", csv_text(results.cases).encode())
    for table, frame in results.tables.items():
        name = file_name(table, names)
        names.add(name)
        _write(out / f"{name}.csv", csv_text(frame).encode())
    its = page(results.kind)
    plots = list(its.pictures(results))
    for plot in plots:
        _write(out / "plots" / f"{plot.name}.png", plot.png)
    _write(out / "provenance.json", provenance_json(results.provenance).encode())
    _write(out / "report.md", its.markdown_page(results, plots).encode())


def _write(path: Path, content: bytes) -> None:
    write_whole(path, lambda file: file.write(content))
