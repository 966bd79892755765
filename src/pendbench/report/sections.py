"""Parts of a report that several kinds of study have. Templates call them by name."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Protocol

import numpy as np

from pendbench.base.faults import STATUSES
from pendbench.report.columns import STEP_SPREAD, Column, Table
from pendbench.report.names import CaseRow, case_name, distinct, is_ok
from pendbench.report.numbers import is_missing
from pendbench.report.plots import Picture
from pendbench.report.text import Safe, counted, grid, listed, markdown

#: What templates may call.
PARTS: Final = ("picture", "status_text", "failures", "provenance_table", "definitions", "files", "timing_trust")

_LISTED: Final = 40
_NAMED: Final = 20
_FAILED: Final = ("scene", "engine", "method", "settings", "dt", "status", "reason")


def picture(item: Picture) -> Safe:
    """A plot and its caption."""
    return Safe(f"![{markdown(item.name)}](plots/{item.name}.png)\n\n*{markdown(item.caption, 1000)}*")


def status_text(row: Any, longest: int = 90) -> Safe:
    """How a row ended, why, and its flags where it has some."""
    told = markdown(row.status) if is_ok(row) else f"**{markdown(row.status)}**"
    if row.reason:
        told += f": {markdown(row.reason, longest)}"
    flags = getattr(row, "flags", "")
    return Safe(f"{told}; {markdown(flags)}" if flags else told)


def failures(cases: Table, scenes: Table | None = None) -> Safe:
    """Every row that did not end well, with its reason; and what the statuses mean."""
    bad = [row for row in cases if not is_ok(row)]
    untold = [row for row in scenes or () if not is_ok(row)]
    parts = []
    if untold:
        parts.append("\n".join(f"- the truth of {markdown(row.scene.name)}: {status_text(row, 300)}" for row in untold))
    if not bad:
        parts.append("Every case ran to its end, and nothing was wrong with any of them.")
        return Safe("\n\n".join(parts))
    columns = [cases.column(name) for name in _FAILED]
    lines = [[markdown(column.text(row), 300) for column in columns] for row in bad]
    parts.append(f"{counted(len(bad), 'case')} of {len(cases)} did not end well:")
    parts.append(grid([column.heading for column in columns], lines, [4]))
    met = [status for status in STATUSES if any(row.status == status for row in bad)]
    parts.append("\n".join(f"- {status}: {STATUSES[status]}" for status in met))
    return Safe("\n\n".join(parts))


class TimedRow(CaseRow, Protocol):
    """A row of a case that was timed, or was to be."""

    @property
    def timing(self) -> Any: ...


def timing_trust(rows: Sequence[TimedRow]) -> Safe:
    """How much timings are worth, with the noisy ones by name."""
    timed = [(row, row.timing.step_spread) for row in rows if math.isfinite(row.timing.step_spread)]
    if not timed:
        return Safe("Nothing was timed.")
    shown, known = STEP_SPREAD.shown, [spread for _, spread in timed]
    text = (
        f"{counted(len(timed), 'case')} of {len(rows)} were timed, one at a time. The spread of a step's cost "
        f"(largest less smallest sample, over the median) is {shown(float(np.median(known)))} in the median case and "
        f"{shown(max(known))} in the worst."
    )
    noisy = sorted((pair for pair in timed if pair[0].timing.noisy), key=lambda pair: -pair[1])
    if not noisy:
        return Safe(f"{text} None is marked as noisy.")
    if 2 * len(noisy) > len(timed):
        text += "\n\n**Most of these timings are noise: draw no conclusions from costs.** The machine was busy."
    text += (
        f"\n\n{counted(len(noisy), 'of them is', 'of them are')} noisy: the machine did something else in between. "
        "Trust these costs to the spread given and no further; for better ones run it again, `--fresh`, on an idle "
        "machine:"
    )
    several = len({(row.case.scene.name, row.case.scene.n) for row, _ in timed}) > len(
        distinct((row for row, _ in timed), lambda row: row.case.scene.name)
    )
    names = [f"- {markdown(_named(row, several))}: spread {shown(spread)}" for row, spread in noisy[:_LISTED]]
    if len(noisy) > _LISTED:
        names.append(f"- and {len(noisy) - _LISTED} more, flagged in the tables")
    return Safe(text + "\n\n" + "\n".join(names))


def _named(row: CaseRow, with_links: bool) -> str:
    return case_name(row.case) + (f", {row.case.scene.n} links" if with_links else "")


def provenance_table(provenance: Mapping[str, Any]) -> Safe:
    """What the numbers come from."""
    if not provenance:
        return Safe("Nothing was recorded.")
    return grid(["what", "which"], [[markdown(name), markdown(value)] for name, value in _flat(provenance)])


def _flat(values: Mapping[str, Any], before: str = "") -> Iterable[tuple[str, str]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{name} ")
        elif isinstance(value, (list, tuple)):
            yield f"{before}{name}", ", ".join(str(part) for part in value) or "none"
        else:
            yield f"{before}{name}", "not known" if is_missing(value) else str(value)


def provenance_json(provenance: Mapping[str, Any]) -> str:
    """The same as JSON, for programs."""
    return json.dumps(_plain(provenance), indent=2, sort_keys=True, ensure_ascii=True) + "\n"


def _plain(value: Any) -> Any:
    """A value of JSON's types; what is not a number has none."""
    if isinstance(value, Mapping):
        return {str(name): _plain(inner) for name, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (str, int)) else str(value)


def definitions(tables: Sequence[Table]) -> Safe:
    """What the columns mean, in their order; columns that mean the same but for their names share a line."""
    alike: dict[tuple[str, str], list[str]] = {}
    for column in _columns(tables):
        names = alike.setdefault((column.unit or "text", column.meaning), [])
        if (name := f"`{column.name}`") not in names:
            names.append(name)
    lines = [[_many(own), markdown(unit), markdown(meaning, 400)] for (unit, meaning), own in alike.items()]
    return grid(["column", "unit", "meaning"], lines)


def _many(names: Sequence[str]) -> str:
    """All of some names, or the first and the last where they are many."""
    return ", ".join(names) if len(names) <= _NAMED else f"{names[0]} to {names[-1]}"


def files(tables: Sequence[Table]) -> Safe:
    """What else was written, and which columns depend on the clock."""
    named = [f"`{table.name}.csv`" for table in tables]
    clocked = list(dict.fromkeys(f"`{column.name}`" for column in _columns(tables) if column.is_time))
    text = f"Every number above, to its last digit: {listed(named)}. What they come from: `provenance.json`."
    if clocked:
        text += f" Columns that depend on the clock, and so are not reproduced: {listed(clocked)}."
    return Safe(text)


def _columns(tables: Sequence[Table]) -> Iterable[Column]:
    return (column for table in tables for column in table.columns)
