"""The page of a study of kind `scaling`, from top to bottom."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from pendbench.report import sections
from pendbench.report.columns import number_text, shown, times_text
from pendbench.report.look import Look
from pendbench.report.plots import Picture, draw
from pendbench.report.rows import Row, distinct, number, of, records, word
from pendbench.report.scaling_plots import cost_figure, longest_figure
from pendbench.report.stability_map import pair_name, pairs
from pendbench.report.text import listed, markdown, table
from pendbench.study.results import Results

__all__ = ["SUMMARY", "answer", "markdown_page", "pictures"]

#: The columns of the terminal's table.
SUMMARY: Final = ("engine", "method", "n", "status", "step_us", "step_per_link_ns", "energy_drift_max", "memory_mb")

_LONGEST: Final = """\
A chain counts where its run, with the step that is given, takes no longer than the motion itself, on one core, and its
energy stays within 1 % of its scale (and its rods within 1 % of their lengths) to the end. "Next": what became of the
shortest chain beyond it. The lengths that were tried are a tenth apart; the step is one of a ladder, each a third
shorter than the one before, begun a little coarser than the step of the chain before suggests, and refined while energy
is lost: no coarser one is tried where the first is too slow. A method that chooses its steps has the one tolerance that
the study gives it. As many trials run side by side as there are workers."""
_COST: Final = """\
The median cost of one step, of a chain that starts to fall. A chain of n links gets an n-th of the step of one link, as
its fastest swing does. A method that chooses its steps is shown with its own, whose length is its own affair. An
explicit method of four stages evaluates the accelerations four times in a step."""
_GROWTH: Final = """\
The exponent p of cost ~ n^p by least squares on logarithms, from the first to the last number of links given (the
last decade of those that stop early), and why the measurement went no further. 1 is a cost that grows like the
chain."""
_ERRORS: Final = """\
The error after the same steps of the same motion, against our own Taylor method at a tolerance of 1e-13: the start of
the fall, before any chaos, and shorter for more links, as their steps are."""
_MEMORY: Final = """\
By how much a process grows, MB, while it has a chain and takes its first step. Less than a megabyte is little more than
noise: what was left over in the process comes first."""


def answer(results: Results) -> str:
    """The longest chain in real time of each engine, and how each one's cost grows."""
    longest, growth = records(results.tables.get("longest")), records(results.tables.get("growth"))
    best = {name: _best(of(longest, engine=name)) for name in distinct(longest, "engine")}
    known = {name: row for name, row in best.items() if row is not None}
    if not known:
        return "No engine runs any chain of this study in real time."
    seconds = number_text(float(results.options.get("duration", math.nan)), ".3g")
    leader = max(known, key=lambda name: number(known[name], "longest_n"))
    told = [f"{name} {_told_length(row)} ({word(row, 'method')})" for name, row in known.items()]
    scene = listed(distinct(records(results.cases), "scene"))
    parts = [f"The longest chain in real time, {seconds} s of {scene} in ever more links: {listed(told)} links."]
    ratios = [
        f"{times_text(number(known[leader], 'longest_n') / number(row, 'longest_n'))} {name}'s"
        for name, row in known.items()
        if name != leader
    ]
    if ratios:
        parts.append(f"That of {leader} is {listed(ratios)}.")
    fitted = [row for row in growth if not math.isnan(number(row, "step_exponent"))]
    exponents = [
        f"{pair_name(row)} {shown('step_exponent', row['step_exponent'])} ({_fitted_range(row)})" for row in fitted
    ]
    if exponents:
        parts.append(f"The cost of a step grows like n to the power of: {listed(exponents)}.")
    return " ".join(parts)


def _fitted_range(row: Row) -> str:
    return f"{shown('n_from', row['n_from'])} to {shown('n_to', row['n_to'])}"


def _told_length(row: Row) -> str:
    """How many links; at least so many, where a refusal, a fault or the finest step ended the search."""
    length = shown("longest_n", row["longest_n"])
    bounded = word(row, "outcome") not in ("too slow", "lost") or "no step below" in word(row, "reason")
    return f"at least {length}" if bounded else length


def _best(rows: Sequence[Row]) -> Row | None:
    known = [row for row in rows if number(row, "longest_n") > 0]
    return max(known, key=lambda row: number(row, "longest_n"), default=None)


def pictures(results: Results) -> Iterator[Picture]:
    """The longest chains, and the cost of a step against n."""
    longest, cases = records(results.tables.get("longest")), records(results.cases)
    if any(number(row, "longest_n") > 0 for row in longest):
        caption = "The longest chain that each engine and method runs in real time with an energy error below 1 %."
        yield Picture("longest", "", caption, draw(partial(longest_figure, Look.of_cases(longest), longest)))
    timed = [row for row in cases if number(row, "step_us") > 0]
    if timed:
        caption = "The cost of a step for each link against the number of links. Level: the cost grows like the chain."
        yield Picture("cost", "", caption, draw(partial(cost_figure, Look.of_cases(timed), timed)))


def markdown_page(results: Results, plots: Sequence[Picture]) -> str:
    """The report."""
    cases, named = records(results.cases), {plot.name: sections.picture(plot) for plot in plots}
    longest, growth = records(results.tables.get("longest")), records(results.tables.get("growth"))
    names = ("engine", "method", "settings")
    parts = [
        *sections.opening(results),
        "## The answer",
        markdown(answer(results), 4000),
        "## The longest chain in real time",
        *(named[name] for name in ("longest",) if name in named),
        _LONGEST,
        sections.rows_table(
            longest, (*names, "longest_n", "dt", "energy_drift_max", "race_spent_s", "next_n", "outcome", "reason")
        ),
        "## What a step costs",
        *(named[name] for name in ("cost",) if name in named),
        _COST,
        _by_links(cases, "step_us", "µs"),
        "Nanoseconds for each link:",
        _by_links(cases, "step_per_link_ns", "ns"),
        "## How cost grows",
        _GROWTH,
        sections.rows_table(growth, (*names, "n_from", "n_to", "step_exponent", "status", "reason")),
        "## Error at equal step",
        _ERRORS,
        _by_links(cases, "error_max", "L"),
        "## Memory",
        _MEMORY,
        _by_links(cases, "memory_mb", "MB"),
        "## What stopped",
        sections.failures(cases),
        "## How it was measured",
        sections.definitions(str(name) for frame in (results.cases, *results.tables.values()) for name in frame),
        sections.timing_trust(cases),
        "## Where the numbers come from",
        sections.provenance_table(results.provenance),
        sections.files(results),
    ]
    return "\n\n".join(parts) + "\n"


def _by_links(cases: Sequence[Row], column: str, unit: str) -> str:
    """A row for each number of links, a column for each method."""
    names = pairs(cases)
    lines = []
    for n in sorted({number(row, "n") for row in cases}):
        own = {pair_name(row): row for row in cases if number(row, "n") == n}
        cells = [_cell(own.get(name), column) for name in names]
        lines.append([number_text(n, "d"), *cells])
    return table([f"n ({unit})", *(markdown(name) for name in names)], lines, range(len(names) + 1))


def _cell(row: Row | None, column: str) -> str:
    if row is None:
        return ""
    return markdown(word(row, "status")) if word(row, "status") != "ok" else sections.cell(row, column)
