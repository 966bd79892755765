"""The table that a study leaves in the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from pendbench.base.errors import printable
from pendbench.report import columns as report_columns
from pendbench.report.columns import Column
from pendbench.report.names import is_ok, method_name
from pendbench.report.page import Report
from pendbench.report.text import clipped

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

_LONGEST: Final = 40


def summary_table(report: Report) -> Table:
    """What the kind of study finds worth a glance: of most kinds a row for each case."""
    return shown_table(*report.glance, report.results.title)


def shown_table(table: report_columns.Table, names: Sequence[str], title: str = "") -> Table:
    """These columns of a table."""
    from rich.table import Table

    columns = [table.column(name) for name in names]
    shown = Table(title=_plain(clipped(title, 100)) if title else None, box=None, pad_edge=False, header_style="bold")
    for column in columns:
        right = "right" if column.format else "left"
        shown.add_column(column.heading, justify=right, no_wrap=column.name != "flags")  # type: ignore[arg-type]
    for row in table:
        shown.add_row(*(_cell(column, row) for column in columns), style=None if is_ok(row) else "red")
    return shown


def _cell(column: Column, row: Any) -> Text:
    if column.name == "flags":
        return _plain(", ".join(_short(flag) for flag in column.text(row).split("; ") if flag))
    text = method_name(row.case) if column.name == "method" else column.text(row)
    return _plain(clipped(text, _LONGEST))


def _short(flag: str) -> str:
    """A flag without its numbers: what comes before its colon."""
    return clipped(flag.partition(":")[0], _LONGEST)


def _plain(text: str) -> Text:
    """Text in which the terminal sees no markup and no control characters."""
    from rich.text import Text

    return Text(printable(text))
