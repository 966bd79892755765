"""Tables as CSV files, as data frames and as Markdown."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from pendbench.report.columns import Column, Table
from pendbench.report.names import distinct
from pendbench.report.text import Safe, grid, markdown, spreadsheet

if TYPE_CHECKING:
    import pandas as pd

R = TypeVar("R")


def csv_text(table: Table) -> str:
    """The table: numbers to their last digit, text that no spreadsheet will run.

    The same table gives the same text, to the byte.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([spreadsheet(column.name) for column in table.columns])
    writer.writerows([_cell(column, row) for column in table.columns] for row in table.rows)
    return text.getvalue()


def _cell(column: Column, row: Any) -> str | int | float:
    cell = column.stored(row)
    return spreadsheet(cell) if isinstance(cell, str) and isinstance(column.value(row), str) else cell


def data_frame(table: Table) -> pd.DataFrame:
    """The table for programs: a column each, missing numbers as nan."""
    import pandas as pd

    rows = [[_number_or_text(column.value(row)) for column in table.columns] for row in table.rows]
    return pd.DataFrame(rows, columns=[column.name for column in table.columns])


def _number_or_text(value: Any) -> Any:
    return float("nan") if value is None else value


def markdown_table(table: Table, names: Sequence[str], rows: Iterable[Any] | None = None) -> Safe:
    """These columns of rows as a Markdown table, numbers to the right."""
    columns = [table.column(name) for name in names]
    lines = [[markdown(column.text(row)) for column in columns] for row in (table.rows if rows is None else rows)]
    numbers = [place for place, column in enumerate(columns) if column.format]
    return grid([markdown(column.heading) for column in columns], lines, numbers)


def cross_table(
    corner: str, rows: Sequence[R], line: Callable[[R], str], column: Callable[[R], str], cell: Callable[[R], str]
) -> Safe:
    """A line for each value of `line` and a column for each of `column`, as they first appear; empty where no row is.

    cell: what a row shows there, safe for Markdown.
    """
    columns, shown = distinct(rows, column), {(line(row), column(row)): cell(row) for row in rows}
    lines = [[markdown(name), *(shown.get((name, each), "") for each in columns)] for name in distinct(rows, line)]
    return grid([markdown(corner), *map(markdown, columns)], lines, range(1, len(columns) + 1))
