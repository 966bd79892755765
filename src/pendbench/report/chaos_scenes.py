"""What a study of kind `chaos` found in each scene: facts, plots and a table of its cases."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from pendbench.report import sections
from pendbench.report.chaos_causes import is_chaotic
from pendbench.report.columns import NOTHING, is_missing, number_text, shown
from pendbench.report.plots import Picture
from pendbench.report.rows import Row, distinct, in_order, is_ok, method_name, number, of, word
from pendbench.report.text import counted, markdown, table

_THRESHOLDS: Final = ("1e-3", "1e-2", "1e-1")
_NOT_BEFORE: Final = "not before the horizon"

_TRUTH: Final = """\
The truth is computed twice, in arithmetic of 32 digits and from two formulations. The horizon is the time until which
the two agree to 1e-9 of the chain's length; nothing is compared past it. Each start has its own, and where one number
is given it is that of the scene's own start: a median over the starts can lie a little past it. A Lyapunov time is one
over the exponent: the time in which a small error grows e-fold in the long run. A neighbour's growth is the rate at
which a start 1e-10 rad away leaves the truth in these very seconds."""

_READING: Final = """\
How to read what follows:

- **Error plots.** The error e(t), from the scene's own start: a panel for each engine, a shade for each method, a
  stroke for each step. Wide lines lie below thin ones, so methods that give the same numbers show as one line with a
  rim. Grey lines: the thresholds 1e-3, 1e-2 and 1e-1. Black line: the horizon. A straight rise on the logarithmic axis
  is exponential growth.
- **Energy plots.** The largest energy error so far, over the scene's energy scale. Flat: the method keeps the energy in
  a band. Rising: it drifts. What runs along the top is beyond it: it has blown up.
- **Crosses.** The run ended there, not well.
- **Tables.** Times until e(t) passes 1e-3, 1e-2 and 1e-1: the median over the starts [earliest .. latest]; then the
  three medians in Lyapunov times. A time no longer than the sampling interval is an upper bound. Errors, energies and
  the joint gap are those of the scene's own start; the status is that of the start that ended worst. *Not before the
  horizon*: the median start is still nearer to the truth than that when there is nothing left to compare it with."""

_HEADINGS: Final = (
    "engine", "method", "step, s", "to 1e-3, s", "to 1e-2, s", "to 1e-1, s", "Lyapunov times", "e to half horizon",
    "energy drift", "drift per s", "joint gap", "step, µs", "simulated s/s", "status and flags",
)  # fmt: skip
_MEASURES: Final = (
    "error_half", "energy_drift_max", "energy_drift_slope_per_s", "gap_max", "step_us", "simulated_s_per_s",
)  # fmt: skip


def overview(scenes: Sequence[Row]) -> Iterator[str]:
    """The scenes in one table, and how to read what is said about each."""
    headings = ["scene", "n", "duration, s", "starts", "motion", "Lyapunov exponent, 1/s",
                "a neighbour's growth, 1/s", "horizon, s", "horizon, Lyapunov times", "reference error"]  # fmt: skip
    yield table(headings, [_overview_row(row) for row in scenes], (1, 2, 3, 5, 6, 7, 8, 9))
    yield _TRUTH
    yield _READING


def _overview_row(row: Row) -> list[str]:
    exponent = sections.cell(row, "lyapunov_per_s")
    if not is_missing(row.get("lyapunov_error_per_s")):
        exponent += f" ± {sections.cell(row, 'lyapunov_error_per_s')}"
    horizon = number(row, "horizon_s") * number(row, "lyapunov_per_s")
    return [
        *(sections.cell(row, name) for name in ("scene", "n", "duration_s", "starts")),
        "chaotic" if is_chaotic(row) else "regular",
        exponent,
        sections.cell(row, "growth_per_s") if is_chaotic(row) else NOTHING,
        _horizon(row),
        number_text(horizon) if is_chaotic(row) else "regular motion",
        sections.cell(row, "reference_error"),
    ]


def _horizon(scene: Row, unit: str = "") -> str:
    """The horizon, what ends it, and how it differs between the starts. unit: of its first number."""
    if math.isnan(number(scene, "horizon_s")):
        return f"none ({sections.status_text(scene)})"
    end = ", the scene's end" if number(scene, "horizon_s") >= number(scene, "duration_s") else ""
    low, high = sections.cell(scene, "horizon_min_s"), sections.cell(scene, "horizon_max_s")
    starts = "" if low == high else f" ({low} to {high} over the starts)"
    return f"{sections.cell(scene, 'horizon_s')}{unit}{end}{starts}"


def each_scene(cases: Sequence[Row], scenes: Sequence[Row], plots: Sequence[Picture]) -> Iterator[str]:
    """Every scene: what is known about it, its plots, and its cases."""
    facts = {word(row, "scene"): row for row in scenes}
    for name in distinct([*scenes, *cases], "scene"):
        scene = facts.get(name, {})
        yield f"## Scene {markdown(name)}"
        yield _facts(scene)
        yield from (sections.picture(plot) for plot in plots if plot.scene == name)
        yield table(_HEADINGS, [_case(row, scene) for row in in_order(of(cases, scene=name))], range(2, 13))


def _facts(scene: Row) -> str:
    if math.isnan(number(scene, "horizon_s")):
        return f"There is no truth to compare with: {sections.status_text(scene, 300)}."
    links = "" if is_missing(scene.get("n")) else f"{counted(int(number(scene, 'n')), 'link')}. "
    text = (
        f"{links}Horizon: {_horizon(scene, ' s')}; up to there the reference's two solves differ by "
        f"{sections.cell(scene, 'reference_error')} at most."
    )
    exponent, error = number(scene, "lyapunov_per_s"), sections.cell(scene, "lyapunov_error_per_s")
    if not is_chaotic(scene):
        return f"{text} The motion is regular: errors grow slowly, and what there is of them is the method's own."
    efold = number_text(1.0 / exponent if exponent else math.inf)
    return f"{text} Lyapunov exponent {number_text(exponent)} ± {error} per s: a small error grows e-fold in {efold} s."


def _case(row: Row, scene: Row) -> list[str]:
    return [
        sections.cell(row, "engine"),
        markdown(method_name(row)),
        sections.cell(row, "dt"),
        *(_time(row, name) for name in _THRESHOLDS),
        _lyapunov_times(row, scene),
        *(sections.cell(row, name) for name in _MEASURES),
        sections.status_text(row),
    ]


def _time(row: Row, threshold: str) -> str:
    """The time to one threshold: the median and the extremes over the starts, or why there is none."""
    name = f"t_{threshold}"
    median, first, last = (shown(f"{name}_{part}", row.get(f"{name}_{part}")) for part in ("s", "min_s", "max_s"))
    missed = number(row, f"{name}_not_reached")
    if is_missing(row.get(f"{name}_s")):
        if not missed > 0:
            return NOTHING
        return _NOT_BEFORE if is_missing(row.get(f"{name}_min_s")) else f"{_NOT_BEFORE} [{first} ..]"
    if missed > 0:
        return f"{median} [{first} .. {_NOT_BEFORE}]"
    return median if first == last else f"{median} [{first} .. {last}]"


def _lyapunov_times(row: Row, scene: Row) -> str:
    """The three medians in Lyapunov times."""
    if not is_chaotic(scene):
        return "regular motion" if scene and is_ok(row) else NOTHING
    return " / ".join(_one_lyapunov_time(row, f"t_{name}", scene) for name in _THRESHOLDS)


def _one_lyapunov_time(row: Row, name: str, scene: Row) -> str:
    if not is_missing(row.get(f"{name}_lyapunov")):
        return shown(f"{name}_lyapunov", row[f"{name}_lyapunov"])
    if number(row, f"{name}_not_reached") > 0:
        return markdown(f"> {number_text(number(scene, 'horizon_s') * number(scene, 'lyapunov_per_s'))}")
    return NOTHING
