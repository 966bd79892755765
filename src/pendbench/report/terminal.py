"""The table that a study leaves in the terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pendbench.errors import printable
from pendbench.report.columns import NOTHING, column, shown
from pendbench.report.page import page
from pendbench.report.rows import Row, is_ok, method_name, number, records, word
from pendbench.report.text import clipped
from pendbench.study.results import Results

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

_LONGEST: Final = 28


def summary_table(results: Results) -> Table:
    """A row for each case, in the columns that the kind of study finds worth a glance."""
    from rich.table import Table

    names = [name for name in page(results.kind).SUMMARY if name in results.cases]
    table = Table(title=_plain(clipped(results.title, 100)), box=None, pad_edge=False, header_style="bold")
    for name in names:
        right = bool(column(name).format)
        table.add_column(column(name).heading, justify="right" if right else "left", no_wrap=name != "flags")
    for row in records(results.cases):
        table.add_row(*(_cell(row, name) for name in names), style=None if is_ok(row) else "red")
    return table


def _cell(row: Row, name: str) -> Text:
    if name == "flags":
        return _plain(", ".join(_short(flag) for flag in word(row, "flags").split("; ") if flag))
    if name == "method":
        return _plain(clipped(method_name(row), _LONGEST))
    if name.startswith("t_") and math.isnan(number(row, name)):
        missed = number(row, name.removesuffix("_s") + "_not_reached")
        return _plain(f"> {shown('horizon_s', row.get('horizon_s'))}" if missed > 0 else NOTHING)
    return _plain(clipped(shown(name, row.get(name)), _LONGEST))


def _short(flag: str) -> str:
    """A flag without its numbers: what comes before its colon."""
    return clipped(flag.partition(":")[0], _LONGEST)


def _plain(text: str) -> Text:
    """Text in which the terminal sees no markup and no control characters."""
    from rich.text import Text

    return Text(printable(text))
