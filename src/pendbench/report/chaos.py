"""The page of a study of kind `chaos`, from top to bottom."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

from pendbench.report import sections
from pendbench.report.chaos_answer import answer
from pendbench.report.chaos_causes import engine_sentences, growth_sentences, twins
from pendbench.report.chaos_method import method
from pendbench.report.chaos_plots import COST, pictures
from pendbench.report.chaos_prices import prices
from pendbench.report.chaos_scenes import each_scene, overview
from pendbench.report.columns import NOTHING, is_missing, number_text, shown
from pendbench.report.plots import Picture
from pendbench.report.rows import Row, distinct, finite, in_order, is_ok, method_name, of, records, word
from pendbench.report.text import counted, listed, markdown
from pendbench.study.results import Results

__all__ = ["SUMMARY", "answer", "markdown_page", "pictures"]

#: The columns of the terminal's table.
SUMMARY: Final = (
    "scene", "engine", "method", "dt", "status", "t_1e-2_s", "error_half", "energy_drift_max", "step_us", "flags",
)  # fmt: skip

_PARTS: Final = """\
An engine leaves the truth for up to three reasons: its **model** is another one (its accelerations differ from the
equations'), its **integration** is inexact (the error falls with the step, at the method's order), and **chaos** makes
whatever error there is grow exponentially."""

_LIMIT: Final = """\
Coarse steps pass 1e-2 within a few Lyapunov times, before anything grows exponentially: their rates in the table are
the method's own. From rounding (1e-16) to 1e-2 is a factor of e^32, so a run in double precision stays with the truth
for about 32 Lyapunov times, however good its method; where one stays longer, the first seconds of the motion are less
chaotic than its mean."""


def markdown_page(results: Results, plots: Sequence[Picture]) -> str:
    """The report."""
    cases, scenes = records(results.cases), records(results.tables.get("scenes"))
    parts = [
        *sections.opening(results),
        "## What was asked",
        _question(results, cases),
        "## The answer",
        markdown(answer(results), 4000),
        "## The scenes",
        *overview(scenes),
        *each_scene(cases, scenes, plots),
        "## Why they leave the truth",
        *_causes(records(results.tables.get("causes")), cases, scenes),
        "## What time on the true path costs",
        *_cost(plots, cases),
        "## What failed",
        sections.failures(cases, scenes),
        "## How it was measured",
        method(results.options),
        sections.definitions(str(name) for frame in (results.cases, *results.tables.values()) for name in frame),
        "## How far to trust the timings",
        sections.timing_trust(cases),
        *_costs_of_failures(cases),
        "## Where the numbers come from",
        sections.provenance_table(results.provenance),
        sections.files(results),
    ]
    return "\n\n".join(parts) + "\n"


def _question(results: Results, cases: Sequence[Row]) -> str:
    scenes = [markdown(name) for name in distinct(cases, "scene")]
    engines = [_methods(engine, of(cases, engine=engine)) for engine in distinct(cases, "engine")]
    steps = sorted(set(finite(cases, "dt")), reverse=True)
    parts = [
        "How long does each engine stay with the true motion of a chain of pendulums, and why does it leave it?",
        f"{counted(len(cases), 'case')}: {counted(len(scenes), 'scene')} ({listed(scenes)}), "
        f"{counted(len(engines), 'engine')}: {listed(engines)}.",
    ]
    if steps:
        parts.append(f"Steps of {listed([shown('dt', dt) for dt in steps])} s.")
    if (starts := int(max(finite(cases, "starts"), default=0))) > 1:
        spread = results.options.get("perturbation")
        change = "" if is_missing(spread) else f", its angles changed by {number_text(spread)} rad (standard deviation)"
        others = counted(starts - 1, "perturbed one")
        parts.append(f"Every case was run from the scene's own start and from {others}{change}.")
    return " ".join(parts)


def _methods(engine: str, rows: Sequence[Row]) -> str:
    return f"{markdown(engine)} ({listed([markdown(name) for name in sorted({method_name(row) for row in rows})])})"


def _causes(causes: Sequence[Row], cases: Sequence[Row], scenes: Sequence[Row]) -> Iterator[str]:
    yield _PARTS
    if causes:
        names = ["scene", "engine", "method", "model_error", "model_error_limit", "order_claimed", "order_observed",
                 "plateau", "growth_per_s", "neighbours_growth_per_s", "cause"]  # fmt: skip
        by_scene = [row for scene in distinct(causes, "scene") for row in in_order(of(causes, scene=scene))]
        yield sections.rows_table([_cause(row) for row in by_scene], names)
    yield "What that says about each engine:"
    yield sections.bullets(engine_sentences(causes, cases))
    yield from _same(twins(cases))
    yield "What the growth of errors says about each scene:"
    yield sections.bullets(growth_sentences(scenes, cases))
    yield _LIMIT


def _same(groups: Sequence[Sequence[str]]) -> Iterator[str]:
    if groups:
        yield (
            "These give the same errors, to 0.1 % in every case that can be compared: they are the same method on the "
            "same system, and what differs between them is the cost."
        )
        yield sections.bullets(listed(group) for group in groups)


def _cause(row: Row) -> dict[str, Any]:
    """A row of causes as people read it."""
    nothing = all(is_missing(row.get(name)) for name in ("model_error", "order_observed", "growth_per_s"))
    order = shown("order_observed", row.get("order_observed"))
    seen = not is_missing(row.get("order_observed"))
    steps = [shown(name, row.get(name)) for name in ("order_dt_coarse", "order_dt_fine")]
    return {
        **row,
        "method": method_name(row),
        "order_observed": f"{order} ({steps[0]} to {steps[1]} s)" if seen else NOTHING,
        "plateau": row.get("plateau") if seen else NOTHING,
        "neighbours_growth_per_s": _neighbour(row),
        "cause": "not known: nothing could be measured" if nothing else word(row, "cause"),
    }


def _neighbour(row: Row) -> Any:
    return "regular motion" if is_missing(row.get("lyapunov_per_s")) else row.get("neighbours_growth_per_s")


def _cost(plots: Sequence[Picture], cases: Sequence[Row]) -> Iterator[str]:
    found = [plot for plot in plots if plot.name == COST]
    yield from (sections.picture(plot) for plot in found)
    if not found:
        yield "Nothing was timed, so there is no plot of costs."
        return
    yield (
        "Engines compare at equal accuracy, not at equal step. The cheapest case of each that ends well and does not "
        "pass 1e-2 before half of the horizon:"
    )
    yield prices(cases)


def _costs_of_failures(cases: Sequence[Row]) -> Iterator[str]:
    timed = [row for row in cases if not is_ok(row) and math.isfinite(float(row.get("step_us") or math.nan))]
    if timed:
        yield (
            f"{counted(len(timed), 'case')} that did not end well {'was' if len(timed) == 1 else 'were'} timed all the "
            "same: that is what the steps cost, whatever they are worth."
        )
