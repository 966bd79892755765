"""The page of a study of kind `cost`, from top to bottom."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from pendbench.report import sections
from pendbench.report.columns import shown
from pendbench.report.cost_answer import answer, compared_at
from pendbench.report.cost_long import READING, long_runs
from pendbench.report.cost_looks import callers
from pendbench.report.cost_method import method
from pendbench.report.cost_pendulum import pendulum
from pendbench.report.cost_plots import LONG, pictures
from pendbench.report.cost_prices import Prices
from pendbench.report.cost_series import without_tolerance
from pendbench.report.cost_tables import every_method, orders, time_to_accuracy, what_to_use
from pendbench.report.cost_trust import odd, timings
from pendbench.report.plots import Picture
from pendbench.report.rows import Row, distinct, finite, is_ok, method_name, of, records
from pendbench.report.text import counted, listed, markdown
from pendbench.study.results import Results

__all__ = ["SUMMARY", "answer", "markdown_page", "pictures"]

#: The columns of the terminal's table.
SUMMARY: Final = (
    "scene", "engine", "method", "dt", "status", "error_max", "energy_drift_max", "step_us", "run_s", "flags",
)  # fmt: skip

_SCENES: Final = ("scene", "n", "compare_s", "samples", "reference_error", "status")
_USE: Final = """\
The cheapest way to each error, and the best of each other engine. Steps and tolerances are interpolated between those
that were run. "≤": the coarsest step that ran is as accurate already, so a coarser one might do."""
_TIMES: Final = """\
Stepping up to the time of comparison, and how many times as long as the cheapest (bold) that is. First the best of each
engine, then every method: what does not reach one error does not reach a smaller one either."""
_ORDERS: Final = """\
The order with which the error falls, between which steps it was seen, and where it stops falling. One more digit: by
what factor the cost grows for an error ten times smaller. An order that is one higher than claimed is no mistake over
many periods: an explicit method of order 4 loses energy with order 5, the phase follows the energy with the square of
the time, and in a run of hundreds of periods that is larger than the error of order 4, which grows with the time."""


def markdown_page(results: Results, plots: Sequence[Picture]) -> str:
    """The report."""
    prices, scenes = Prices.of_results(results), records(results.tables.get("scenes"))
    cases, long_rows = prices.cases, records(results.tables.get("long_runs"))
    parts = [
        *sections.opening(results),
        "## What was asked",
        _question(prices),
        "## The answer",
        markdown(answer(results), 6000),
        "## What to use",
        _USE,
        what_to_use(prices),
        *_each_scene(prices, scenes, plots),
        "## Orders, and the price of a digit",
        _ORDERS,
        orders(records(results.tables.get("orders"))),
        "## What drifts in long runs",
        *_long_runs(long_rows, plots),
        *pendulum(prices),
        "## For callers who need every state",
        *callers(prices, compared_at(prices)),
        "## What failed",
        sections.failures(cases, scenes),
        *_failed_long_runs(long_rows),
        "## What is odd",
        odd(cases),
        "## How it was measured",
        method(results.options),
        sections.definitions(str(name) for frame in (results.cases, *results.tables.values()) for name in frame),
        "## How far to trust the timings",
        *timings(cases),
        "## Where the numbers come from",
        sections.provenance_table(results.provenance),
        sections.files(results),
    ]
    return "\n\n".join(parts) + "\n"


def _question(prices: Prices) -> str:
    cases = [without_tolerance(row) for row in prices.cases]
    engines = [f"{markdown(engine)} ({listed(_methods(of(cases, engine=engine)))})" for engine in prices.engines]
    scenes = [markdown(scene) for scene in prices.scenes]
    errors, steps = prices.accuracies, sorted(set(finite(cases, "dt")), reverse=True)
    parts = ["What does accuracy cost in time, and what does ten times more of it?"]
    parts.append(
        f"{counted(len(cases), 'case')}: {counted(len(scenes), 'scene')} ({listed(scenes)}), "
        f"{counted(len(engines), 'engine')}: {listed(engines)}."
    )
    if errors:
        parts.append(f"Errors of {listed([shown('accuracy', error) for error in errors])} of the chain's length.")
    if steps:
        parts.append(f"Steps of {listed([shown('dt', step) for step in steps])} s.")
    return " ".join(parts)


def _methods(rows: Sequence[Row]) -> list[str]:
    return [markdown(name) for name in sorted({method_name(row) for row in rows})]


def _each_scene(prices: Prices, scenes: Sequence[Row], plots: Sequence[Picture]) -> Iterator[str]:
    """The scenes in one table, and for each its plots and its times to accuracy."""
    yield "## The scenes"
    yield sections.rows_table(scenes, _SCENES)
    for name in distinct([*scenes, *prices.cases], "scene"):
        yield f"## Scene {markdown(name)}"
        yield from (sections.picture(plot) for plot in plots if plot.scene == name and not _is_long(plot))
        yield _TIMES
        yield time_to_accuracy(prices, name)
        yield every_method(prices, name)


def _is_long(plot: Picture) -> bool:
    return plot.name.startswith(LONG)


def _long_runs(rows: Sequence[Row], plots: Sequence[Picture]) -> Iterator[str]:
    if not rows:
        yield "The study asks for no long runs, or no engine could take part in them."
        return
    yield READING
    yield long_runs(rows)
    yield from (sections.picture(plot) for plot in plots if _is_long(plot))


def _failed_long_runs(rows: Sequence[Row]) -> Iterator[str]:
    if any(not is_ok(row) for row in rows):
        yield "Of the long runs:"
        yield sections.failures(rows)
