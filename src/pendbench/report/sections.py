"""Parts of a report that every kind of study has."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from pendbench.report.columns import COLUMNS, column, in_order, is_missing, shown
from pendbench.report.plots import Picture
from pendbench.report.rows import Row, case_name, finite, is_noisy, is_ok, number, word
from pendbench.report.text import counted, listed, markdown, table
from pendbench.study.results import Results
from pendbench.trajectory import STATUSES

_LISTED: Final = 40


def cell(row: Row, name: str) -> str:
    """A value of a row, safe for Markdown."""
    return markdown(shown(name, row.get(name)))


def heading(name: str) -> str:
    """A column's heading, safe for Markdown."""
    return markdown(column(name).heading or name)


def rows_table(rows: Iterable[Row], names: Sequence[str]) -> str:
    """These columns of rows as a Markdown table, numbers to the right."""
    numbers = [i for i, name in enumerate(names) if column(name).format]
    return table([heading(name) for name in names], [[cell(row, name) for name in names] for row in rows], numbers)


def bullets(texts: Iterable[str]) -> str:
    """Sentences as a list, safe for Markdown."""
    return "\n".join(f"- {markdown(text, 2000)}" for text in texts)


def opening(results: Results) -> list[str]:
    """Title, and that it is the quick variant where it is."""
    parts = [f"# {markdown(results.title)}"]
    if results.quick:
        parts.append(
            "**This is the quick variant of the study**: fewer scenes, starts or steps, for a first look. Its numbers "
            "are measured in the same way as the full study's."
        )
    return parts


def picture(item: Picture) -> str:
    """A plot and its caption."""
    return f"![{markdown(item.name)}](plots/{item.name}.png)\n\n*{markdown(item.caption, 1000)}*"


def status_text(row: Row, longest: int = 90) -> str:
    """How a case ended, why, and its flags, safe for Markdown."""
    status, reason, flags = word(row, "status") or "not known", word(row, "reason"), word(row, "flags")
    told = markdown(status) if is_ok(row) else f"**{markdown(status)}**"
    if reason:
        told += f": {markdown(reason, longest)}"
    return f"{told}; {markdown(flags)}" if flags else told


def failures(cases: Sequence[Row], scenes: Sequence[Row] = ()) -> str:
    """Every row that did not end well, with its reason; and what the statuses mean."""
    bad = [row for row in cases if not is_ok(row)]
    untold = [row for row in scenes if not is_ok(row)]
    parts = []
    if untold:
        parts.append("\n".join(f"- the truth of {cell(row, 'scene')}: {status_text(row, 300)}" for row in untold))
    if not bad:
        parts.append("Every case ran to its end, and nothing was wrong with any of them.")
        return "\n\n".join(parts)
    lines = [[cell(row, "scene"), cell(row, "engine"), cell(row, "method"), cell(row, "settings"), cell(row, "dt"),
              cell(row, "status"), markdown(word(row, "reason") or "no reason given", 300)] for row in bad]  # fmt: skip
    parts.append(f"{counted(len(bad), 'case')} of {len(cases)} did not end well:")
    parts.append(table([heading(name) for name in ("scene", "engine", "method", "settings", "dt", "status", "reason")],
                       lines, [4]))  # fmt: skip
    met = [status for status in STATUSES if any(word(row, "status") == status for row in bad)]
    if met:
        parts.append("\n".join(f"- {status}: {STATUSES[status]}" for status in met))
    return "\n\n".join(parts)


def timing_trust(cases: Sequence[Row]) -> str:
    """How much the timings are worth, with the noisy ones by name."""
    timed = [row for row in cases if math.isfinite(number(row, "step_spread"))]
    if not timed:
        return "Nothing was timed."
    spreads = finite(timed, "step_spread")
    middle, most = shown("step_spread", float(np.median(spreads))), shown("step_spread", max(spreads))
    parts = [
        f"{counted(len(timed), 'case')} of {len(cases)} were timed, one at a time. The spread of a step's cost "
        f"(largest less smallest sample, over the median) is {middle} in the median case and {most} in the worst."
    ]
    noisy = sorted((row for row in timed if is_noisy(row)), key=lambda row: -number(row, "step_spread"))
    if not noisy:
        return f"{parts[0]} None is marked as noisy."
    if 2 * len(noisy) > len(timed):
        parts.append("**Most of these timings are noise: draw no conclusions from costs.** The machine was busy.")
    parts.append(
        f"{counted(len(noisy), 'of them is', 'of them are')} noisy: the machine did something else in between. Trust "
        "these costs to the spread given and no further; for better ones run it again, `--fresh`, on an idle machine:"
    )
    chains = {(word(row, "scene"), number(row, "n")) for row in timed}
    several = len(chains) > len({scene for scene, _ in chains})
    names = []
    for row in noisy[:_LISTED]:
        links = f", {cell(row, 'n')} links" if several else ""
        names.append(f"- {markdown(case_name(row))}{links}: spread {cell(row, 'step_spread')}")
    if len(noisy) > _LISTED:
        names.append(f"- and {len(noisy) - _LISTED} more, flagged in the tables")
    return "\n\n".join([*parts, "\n".join(names)])


def provenance_table(provenance: Mapping[str, Any]) -> str:
    """What the numbers come from."""
    if not provenance:
        return "Nothing was recorded."
    lines = [[markdown(name), markdown(value)] for name, value in _flat(provenance)]
    return table(["what", "which"], lines)


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


def definitions(names: Iterable[str]) -> str:
    """What the columns mean, in their order; columns that mean the same but for their names share a line."""
    alike: dict[tuple[str, str], list[str]] = {}
    for name in in_order(dict.fromkeys(names)):
        if declared := COLUMNS.get(name):
            alike.setdefault((declared.unit or "text", declared.meaning), []).append(f"`{name}`")
    lines = [[", ".join(own), markdown(unit), markdown(meaning, 400)] for (unit, meaning), own in alike.items()]
    return table(["column", "unit", "meaning"], lines)


def files(results: Results) -> str:
    """What else was written, and which columns depend on the clock."""
    tables = [f"`{name}.csv`" for name in ("cases", *results.tables)]
    written = {str(name) for frame in (results.cases, *results.tables.values()) for name in frame}
    clocked = [f"`{name}`" for name, declared in COLUMNS.items() if declared.is_time and name in written]
    text = f"Every number above, to its last digit: {listed(tables)}. What they come from: `provenance.json`."
    if clocked:
        text += f" Columns that depend on the clock, and so are not reproduced: {listed(clocked)}."
    return text
