"""The page of a study of kind `chaos`, from top to bottom."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

from pendbench.report import sections
from pendbench.report.chaos_answer import answer
from pendbench.report.chaos_causes import engine_sentences, growth_sentences, is_chaotic, twins
from pendbench.report.chaos_plots import COST, pictures
from pendbench.report.columns import is_missing, number_text, shown
from pendbench.report.plots import Picture
from pendbench.report.rows import Row, distinct, in_order, is_ok, method_name, number, of, records, word
from pendbench.report.text import counted, listed, markdown, table
from pendbench.study.results import Results

__all__ = ["SUMMARY", "answer", "markdown_page", "pictures"]

#: The columns of the terminal's table.
SUMMARY: Final = ("scene", "engine", "method", "dt", "status", "t_1e-2_s", "error_half", "energy_drift_max", "step_us", "flags")

_THRESHOLDS: Final = ("1e-3", "1e-2", "1e-1")
_NOT_BEFORE: Final = "not before the horizon"
_READING: Final = """How to read what follows:

- **Error plots.** The error e(t), from the scene's own start: a panel for each engine, a shade for each method, a stroke
  for each step. Wide lines lie below thin ones, so methods that give the same numbers show as one line with a rim. Grey
  lines: the thresholds 1e-3, 1e-2 and 1e-1. Black line: the horizon, past which nothing is compared. A straight rise on
  the logarithmic axis is exponential growth.
- **Energy plots.** The largest energy error so far, |E(t) - E(0)| over the scene's energy scale. Flat: the method keeps
  the energy in a band. Rising: it drifts. What runs along the top is beyond it: it has blown up.
- **Crosses.** The run ended there, not well.
- **Tables.** Times until e(t) passes 1e-3, 1e-2 and 1e-1: the median over the starts [earliest .. latest], then the three
  medians in Lyapunov times. Errors, energies and the joint gap are those of the scene's own start; the status is that of
  the start that ended worst. `not before the horizon`: the median start is still nearer to the truth than that when
  nothing can be compared any more."""


def markdown_page(results: Results, plots: Sequence[Picture]) -> str:
    """The report."""
    cases, scenes = records(results.cases), records(results.tables.get("scenes"))
    causes = records(results.tables.get("causes"))
    parts = [
        *sections.opening(results),
        "## What was asked",
        _question(results, cases),
        "## The answer",
        markdown(answer(results), 4000),
        "## The scenes",
        _scenes(scenes),
        _READING,
        *_each_scene(cases, scenes, plots),
        "## Why they leave the truth",
        *_causes(causes, cases, scenes),
        "## What time on the true path costs",
        *_cost(plots),
        "## What failed",
        sections.failures(cases, scenes),
        "## How it was measured",
        _method(results),
        sections.definitions([*results.cases, *(name for frame in results.tables.values() for name in frame)]),
        "## How far to trust the timings",
        _timings(cases),
        "## Where the numbers come from",
        sections.provenance_table(results.provenance),
        sections.files(results),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _question(results: Results, cases: Sequence[Row]) -> str:
    engines = [
        f"{markdown(engine)} ({listed([markdown(name) for name in sorted({method_name(row) for row in of(cases, engine=engine)})])})"
        for engine in distinct(cases, "engine")
    ]
    scenes = [markdown(name) for name in distinct(cases, "scene")]
    steps = sorted({dt for row in cases if not math.isnan(dt := number(row, "dt"))}, reverse=True)
    text = (
        f"How long does each engine stay with the true motion of a chain of pendulums, and why does it leave it? "
        f"{counted(len(cases), 'case')}: {counted(len(scenes), 'scene')} ({listed(scenes)}), "
        f"{counted(len(engines), 'engine')}: {listed(engines)}"
    )
    if steps:
        text += f"; steps of {listed([shown('dt', dt) for dt in steps])} s"
    starts = max((int(number(row, "starts")) for row in cases if not math.isnan(number(row, "starts"))), default=0)
    if starts > 1:
        spread = results.options.get("perturbation")
        change = "" if is_missing(spread) else f" (angles changed by {number_text(spread)} rad, one standard deviation)"
        text += f". Every case was run from the scene's own start and from {counted(starts - 1, 'perturbed start')}{change}"
    return text + "."


def _scenes(scenes: Sequence[Row]) -> str:
    headings = ["scene", "n", "duration, s", "starts", "Lyapunov exponent, 1/s", "motion", "horizon, s",
                "horizon, Lyapunov times", "reference error"]  # fmt: skip
    text = (
        "The truth is computed twice, in arithmetic of 32 digits and from two formulations; where the two differ by more "
        "than 1e-9 of the chain's length is the horizon, and nothing is compared past it. A Lyapunov time is one over the "
        "exponent: the time in which a small error grows e-fold."
    )
    return f"{table(headings, [_scene(row) for row in scenes], range(1, 9))}\n\n{text}"


def _scene(row: Row) -> list[str]:
    exponent = sections.cell(row, "lyapunov_per_s")
    if not is_missing(row.get("lyapunov_error_per_s")):
        exponent += f" ± {sections.cell(row, 'lyapunov_error_per_s')}"
    names = ("scene", "n", "duration_s", "starts")
    times = number_text(number(row, "horizon_s") * number(row, "lyapunov_per_s")) if is_chaotic(row) else "regular motion"
    return [*(sections.cell(row, name) for name in names), exponent, "chaotic" if is_chaotic(row) else "regular",
            _horizon(row), times, sections.cell(row, "reference_error")]  # fmt: skip


def _horizon(scene: Row) -> str:
    """The horizon in s, what ends it, and how it differs between the starts."""
    if math.isnan(number(scene, "horizon_s")):
        return f"none ({sections.status_text(scene)})"
    end = ", the scene's end" if number(scene, "horizon_s") >= number(scene, "duration_s") else ""
    low, high = sections.cell(scene, "horizon_min_s"), sections.cell(scene, "horizon_max_s")
    starts = "" if low == high else f" ({low} to {high} over the starts)"
    return f"{sections.cell(scene, 'horizon_s')}{end}{starts}"


def _each_scene(cases: Sequence[Row], scenes: Sequence[Row], plots: Sequence[Picture]) -> Iterator[str]:
    facts = {word(row, "scene"): row for row in scenes}
    for name in distinct([*scenes, *cases], "scene"):
        scene = facts.get(name, {})
        yield f"## Scene {markdown(name)}"
        yield _facts(scene)
        yield from (sections.picture(plot) for plot in plots if plot.scene == name)
        yield _scene_table(in_order(of(cases, scene=name)), scene)


def _facts(scene: Row) -> str:
    if not scene:
        return "Nothing is known about the truth of this scene."
    if math.isnan(number(scene, "horizon_s")):
        return f"There is no truth to compare with: {sections.status_text(scene, 300)}."
    links = counted(int(number(scene, "n")), "link") if not is_missing(scene.get("n")) else "A chain"
    text = (
        f"{links}. Horizon, s: {_horizon(scene)}; up to there the reference's two solves differ by "
        f"{sections.cell(scene, 'reference_error')} at most."
    )
    if not is_chaotic(scene):
        return f"{text} The motion is regular: errors grow slowly, and what there is of them is the method's own."
    exponent, error = number(scene, "lyapunov_per_s"), sections.cell(scene, "lyapunov_error_per_s")
    efold = number_text(1.0 / exponent) if exponent > 0 else "–"
    return f"{text} Lyapunov exponent {number_text(exponent)} ± {error} per s: a small error grows e-fold every {efold} s."


def _scene_table(rows: Sequence[Row], scene: Row) -> str:
    headings = ["engine", "method", "step, s", *(f"to {name}, s" for name in _THRESHOLDS), "Lyapunov times",
                "e to half horizon", "energy drift", "drift per s", "joint gap", "step, µs", "simulated s/s",
                "status and flags"]  # fmt: skip
    lines = [
        [
            sections.cell(row, "engine"),
            markdown(method_name(row)),
            sections.cell(row, "dt"),
            *(_time(row, name) for name in _THRESHOLDS),
            _lyapunov_times(row, scene),
            *(sections.cell(row, name) for name in ("error_half", "energy_drift_max", "energy_drift_slope_per_s",
                                                    "gap_max", "step_us", "simulated_s_per_s")),
            sections.status_text(row),
        ]
        for row in rows
    ]  # fmt: skip
    return table(headings, lines, range(2, 13))


def _time(row: Row, threshold: str) -> str:
    """The time to one threshold: the median and the extremes over the starts, or why there is none."""
    name = f"t_{threshold}"
    median, first, last = (shown(f"{name}_{part}", row.get(f"{name}_{part}")) for part in ("s", "min_s", "max_s"))
    missed = number(row, f"{name}_not_reached")
    if is_missing(row.get(f"{name}_s")):
        if not missed > 0:
            return "–"
        return _NOT_BEFORE if is_missing(row.get(f"{name}_min_s")) else f"{_NOT_BEFORE} [{first} ..]"
    if missed > 0:
        return f"{median} [{first} .. {_NOT_BEFORE}]"
    return median if first == last else f"{median} [{first} .. {last}]"


def _lyapunov_times(row: Row, scene: Row) -> str:
    if not is_chaotic(scene):
        return "regular motion" if scene and is_ok(row) else "–"
    return " / ".join(_one_lyapunov_time(row, name, scene) for name in _THRESHOLDS)


def _one_lyapunov_time(row: Row, threshold: str, scene: Row) -> str:
    if not is_missing(row.get(f"t_{threshold}_lyapunov")):
        return shown(f"t_{threshold}_lyapunov", row[f"t_{threshold}_lyapunov"])
    if number(row, f"t_{threshold}_not_reached") > 0:
        return f"&gt; {number_text(number(scene, 'horizon_s') * number(scene, 'lyapunov_per_s'))}"
    return "–"


def _causes(causes: Sequence[Row], cases: Sequence[Row], scenes: Sequence[Row]) -> Iterator[str]:
    yield (
        "An engine leaves the truth for up to three reasons: its **model** is another one (its accelerations differ from the "
        "equations'), its **integration** is inexact (the error falls with the step, at the method's order), and **chaos** "
        "makes whatever error there is grow exponentially."
    )
    names = ["scene", "engine", "method", "model_error", "model_error_limit", "order_claimed", "order_observed",
             "plateau", "growth_per_s", "lyapunov_per_s", "cause"]  # fmt: skip
    if causes:
        yield sections.rows_table([_cause_row(row) for row in _by_scene(causes)], names)
    yield "\n".join(f"- {markdown(text, 2000)}" for text in engine_sentences(causes, cases))
    for group in twins(cases):
        yield (f"The same errors, to 0.1 % in every case that can be compared, come from {listed([markdown(name) for name in group])}: "
               "the same method on the same system, and what differs between them is speed.")  # fmt: skip
    yield "What the growth of errors says:"
    yield "\n".join(f"- {markdown(text, 2000)}" for text in growth_sentences(scenes, cases))
    yield (
        "Coarse steps pass 1e-2 within a few Lyapunov times, before growth is exponential; their rates in the table are the "
        "method's own. From rounding (1e-16) to 1e-2 is a factor of e^32, so a run in double precision stays for about 32 "
        "Lyapunov times at most, however good its method; more than that means that the exponent was below its mean at "
        "first."
    )


def _by_scene(causes: Sequence[Row]) -> list[Row]:
    return [row for scene in distinct(causes, "scene") for row in in_order(of(causes, scene=scene))]


def _cause_row(row: Row) -> dict[str, Any]:
    """A row of causes as people read it."""
    nothing = all(is_missing(row.get(name)) for name in ("model_error", "order_observed", "growth_per_s"))
    exponent, order = row.get("lyapunov_per_s"), shown("order_observed", row.get("order_observed"))
    if not is_missing(row.get("order_observed")):
        steps = [shown(name, row.get(name)) for name in ("order_dt_coarse", "order_dt_fine")]
        order += f" ({steps[0]} to {steps[1]} s)"
    return {
        **row,
        "method": method_name(row),
        "order_observed": order,
        "plateau": "–" if is_missing(row.get("order_observed")) else row.get("plateau"),
        "cause": "not known: nothing could be measured" if nothing else word(row, "cause"),
        "lyapunov_per_s": "regular motion" if is_missing(exponent) else exponent,
    }


def _cost(plots: Sequence[Picture]) -> Iterator[str]:
    found = [plot for plot in plots if plot.name == COST]
    yield from (sections.picture(plot) for plot in found)
    if not found:
        yield "Nothing was timed, so there is no plot of costs."


def _method(results: Results) -> str:
    options = results.options
    sample = options.get("sample")
    order = options.get("order_time")
    every = "" if is_missing(sample) else f" About every {number_text(sample)} s, on whole steps of the case, it is compared."
    until = "" if is_missing(order) else f" after {number_text(order)} s"
    points = [
        f"**Error.** e(t) is the largest distance of any mass from where the reference has it, over the chain's length L.{every}",
        "**Reference.** Two solves in double-double arithmetic (about 32 digits) that share neither formulation nor order nor "
        "steps: angles with a recursion along the chain at order 28, and unit vectors with the rods' tensions at order 24. "
        "The horizon is the last sample at which they agree to 1e-9 L. Its error is their largest difference up to there.",
        "**Time to divergence.** The first time at which e(t) passes a threshold, by interpolation of log e between two "
        "samples. Over the starts the median is given; a start that does not get there before its horizon counts as later "
        "than all that do, and where the median falls on such a start it is empty: not before the horizon. A run that ended "
        "early has diverged when it ended.",
        "**Model error.** In random states of the chain, the engine's acceleration is its mean acceleration over a span of "
        "time, in the limit of shrinking spans (Romberg's scheme); its difference from the equations', over the largest "
        "acceleration. Above 1e-6, and above ten times its own uncertainty, it is another system.",
        f"**Order.** The slope of log error against log step between the two finest steps whose errors{until} are neither "
        "rounding (below 1e-13) nor large (above 0.03).",
        "**Growth.** A least-squares exponential through e(t) while it lies between 1e-12 and 1e-2. The Lyapunov exponent "
        "is the mean rate at which two solutions part that start 1e-7 apart and are brought back to that distance again and again.",
        "**Energy.** From our own formula and the engine's angles and rates, never from the engine. Its scale is the full range "
        "of the potential, or the kinetic energy at the start where that is larger.",
        "**Cost.** Only stepping is timed: the median of five samples of 10 ms or more, after a first step that is not counted. "
        "An engine whose steps are taken one by one from Python pays for that here, as its users do.",
    ]
    return "\n".join(f"- {point}" for point in points) + "\n\nThe full definitions are in `docs/measuring.md`. The columns:"


def _timings(cases: Sequence[Row]) -> str:
    broken = sum(1 for row in cases if not is_ok(row) and not is_missing(row.get("step_us")))
    note = ""
    if broken:
        note = (f"\n\n{counted(broken, 'case')} that did not end well {'was' if broken == 1 else 'were'} timed all the same: "
                "their steps cost that, whatever they are worth.")  # fmt: skip
    return sections.timing_trust(cases) + note
