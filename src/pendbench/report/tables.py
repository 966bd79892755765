"""Tables as CSV files."""

from __future__ import annotations

import csv
import io

import pandas as pd

from pendbench.report.columns import in_order, stored
from pendbench.report.text import spreadsheet


def csv_text(frame: pd.DataFrame) -> str:
    """The table in the columns' declared order: numbers to their last digit, text that no spreadsheet will run.

    The same table gives the same text, to the byte.
    """
    names = in_order(str(name) for name in frame.columns)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([spreadsheet(name) for name in names])
    columns = [[_cell(name, value) for value in frame[name].tolist()] for name in names]
    writer.writerows(zip(*columns, strict=True))
    return text.getvalue()


def _cell(name: str, value: object) -> str | int | float:
    cell = stored(name, value)
    return spreadsheet(cell) if isinstance(value, str) and isinstance(cell, str) else cell
