"""The page of a study of kind `stability`, from top to bottom."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Final

from pendbench.report import sections
from pendbench.report.columns import number_text, shown, times_text
from pendbench.report.look import Look
from pendbench.report.plots import Picture, draw
from pendbench.report.rows import Row, distinct, number, of, records, word
from pendbench.report.stability_answer import answer, exponents, held, is_adaptive
from pendbench.report.stability_map import cell_text, growth_figure, is_true, map_figure, pair_name, pairs
from pendbench.report.text import listed, markdown, table
from pendbench.study.results import Results
from pendbench.study.verdict import BREAKS, HOLDS, VERDICTS

__all__ = ["SUMMARY", "answer", "markdown_page", "pictures"]

#: The columns of the terminal's table.
SUMMARY: Final = ("scene", "engine", "method", "dt", "verdict", "energy_drift_max", "gap_max", "stable_dt")

_CASE: Final = (
    "scene", "engine", "method", "settings", "dt", "verdict", "broke_s", "energy_drift_max", "gap_max", "reason",
)  # fmt: skip
_SCENE: Final = ("scene", "n", "duration_s", "stiffest_rad_per_s", "fastest_rad_per_s", "title")
_GROWTH: Final = (
    "engine", "method", "settings", "n_from", "n_to", "stable_dt_exponent", "scenes_held", "scenes",
)  # fmt: skip

_MAP: Final = """\
Each cell is coloured by the best verdict of all steps that were tried, and holds the largest step with that verdict
"holds". "≥": no larger step was tried that could have failed. "its own": the method chooses its steps. "?": no step
that was tried holds, but finer ones took longer than the study allows: this is the clock's verdict, not the method's.
`frame` divides its step as it sees fit, so its steps are not compared with the others'."""
_STEPS: Final = """\
The largest step with which a method holds each scene, and in brackets how many times smaller it is than that of the
scene's best method (bold). A word stands for the best verdict where no step holds. To hold is to keep the energy to
1 %: a method of order 1 needs small steps for that long before it breaks, and the largest step that does not break is
in `stable_steps.csv` (`unbroken_dt`). Energy hardly sees a light link behind heavy ones: in the graded and alternating
chains a step may hold while the tip's motion is wrong. What a step does for accuracy, the study `cost` says."""
_STIFF: Final = """\
A method with a fixed step is stable for an oscillation of frequency w as long as step times w stays below its limit:
2.8 for RK4 on the imaginary axis, 2 for semi-implicit Euler and RATTLE (Stormer-Verlet); collocation has none, but its
iteration has to converge. The fastest small oscillation of each hanging chain is known. Where the largest stable step
times that frequency is near the limit, stiffness is what limits the step; far below it, something else is: the whip's
crack, whose tension makes the chain stiffer than it is at rest, or an error that adds up before anything breaks."""
#: Verdicts whose reasons are the same in many scenes.
_TELLING: Final = ("refused", "crashed", "error")


def pictures(results: Results) -> Iterator[Picture]:
    """The map, and the largest stable step against n."""
    steps = records(results.tables.get("stable_steps"))
    if not steps:
        return
    caption = "Scene by engine and method: the best verdict of all steps, and the largest step that holds, s."
    yield Picture("map", "", caption, draw(partial(map_figure, steps)))
    lengths = results.options.get("lengths") or []
    own = [row for row in steps if word(row, "scene") in lengths and number(row, "stable_dt") > 0]
    if len(distinct(own, "scene")) > 1:
        caption = "The largest stable step against the number of links, in one chain of the same length and mass."
        yield Picture("growth", "", caption, draw(partial(growth_figure, Look.of_cases(own), own)))


def markdown_page(results: Results, plots: Sequence[Picture]) -> str:
    """The report."""
    cases, steps = records(results.cases), records(results.tables.get("stable_steps"))
    scenes, growth = records(results.tables.get("scenes")), records(results.tables.get("growth"))
    named = {plot.name: plot for plot in plots}
    parts = [
        *sections.opening(results),
        "## The answer",
        markdown(answer(results), 6000),
        "## The map",
        _MAP,
        *(sections.picture(named[name]) for name in ("map",) if name in named),
        "## The scenes",
        sections.rows_table(scenes, _SCENE),
        "## The largest stable steps",
        _STEPS,
        stable_steps(steps),
        "## How the step falls with n",
        markdown(exponents(growth), 3000),
        sections.rows_table(growth, _GROWTH),
        *(sections.picture(named[name]) for name in ("growth",) if name in named),
        "## What breaks whom, and why",
        _STIFF,
        _limits(steps),
        sections.bullets(_reasons(steps)),
        *_staying(cases),
        "## Every case",
        sections.rows_table(cases, _CASE),
        "## How it was judged",
        _judged(results.options),
        sections.definitions(str(name) for frame in (results.cases, *results.tables.values()) for name in frame),
        "## Where the numbers come from",
        sections.provenance_table(results.provenance),
        sections.files(results),
    ]
    return "\n\n".join(parts) + "\n"


def stable_steps(steps: Sequence[Row]) -> str:
    """A row for each scene, a column for each method."""
    names = pairs(steps)
    lines = []
    for scene in distinct(steps, "scene"):
        own = {pair_name(row): row for row in of(steps, scene=scene)}
        lines.append([markdown(scene), *(_step(own.get(name)) for name in names)])
    return table(["scene", *(markdown(name) for name in names)], lines)


def _step(row: Row | None) -> str:
    if row is None:
        return ""
    text, ratio = markdown(cell_text(row)), number(row, "stable_dt_ratio")
    if is_true(row, "substeps"):
        return text
    if ratio > 0.999:
        return f"**{text}**"
    return f"{text} ({markdown(times_text(1 / ratio))})" if ratio > 0 else text


def _limits(steps: Sequence[Row]) -> str:
    """Step times stiffest frequency, for each method over the scenes that it holds."""
    lines = []
    for name in pairs([row for row in steps if not is_adaptive(row) and not is_true(row, "substeps")]):
        own = held([row for row in steps if pair_name(row) == name])
        found = sorted((number(row, "stable_dt_stiffest"), word(row, "scene")) for row in own)
        found = [(value, scene) for value, scene in found if value > 0]
        if found:
            middle = found[len(found) // 2][0]
            ends = [
                f"{shown('stable_dt_stiffest', value)} ({markdown(scene)})" for value, scene in (found[0], found[-1])
            ]
            room = sorted(number(row, "unbroken_dt") / number(row, "stable_dt") for row in own)
            cells = [
                str(len(found)),
                shown("stable_dt_stiffest", middle),
                *ends,
                markdown(times_text(room[len(room) // 2])),
            ]
            lines.append([markdown(name), *cells])
    headings = [
        "method",
        "scenes held",
        "step times frequency, median",
        "smallest",
        "largest",
        "breaks only above, median",
    ]
    return table(headings, lines, (1, 2))


def _reasons(steps: Sequence[Row]) -> Iterator[str]:
    """For each method, what it never holds and how that ends."""
    for name in pairs(steps):
        groups: dict[str, list[str]] = {}
        for row in steps:
            verdict = word(row, "best_verdict")
            if pair_name(row) == name and verdict != "holds":
                why = f"{verdict} ({word(row, 'reason')})" if verdict in _TELLING else verdict
                groups.setdefault("not settled in time" if is_true(row, "unsettled") else why, []).append(
                    word(row, "scene")
                )
        if groups:
            yield f"{name}: {'; '.join(f'{verdict} in {listed(own)}' for verdict, own in groups.items())}"


def _staying(cases: Sequence[Row]) -> Iterator[str]:
    """How long chains that stand where nothing pulls them stay there."""
    standing = [row for row in cases if number(row, "stays_s") >= 0 and word(row, "verdict") == "holds"]
    if not standing:
        return
    yield "## How long what stands stays"
    yield (
        "Chains released at rest where nothing pulls them. Pi is no floating-point number: an angle of pi in a file is "
        "1.2e-16 rad off, and an upright chain grows that, by a factor of e in 1 / (its stiffest frequency) seconds "
        "at the fastest. A chain that stands longer than its neighbours does so by luck or by symmetry, not by merit. "
        '"≥": it stood to the end of the run. The finest step that holds of each method:'
    )
    names = pairs(standing)
    lines = []
    for scene in distinct(standing, "scene"):
        own = of(standing, scene=scene)
        lines.append([markdown(scene), *(_stay([row for row in own if pair_name(row) == name]) for name in names)])
    yield table(["scene", *(markdown(name) for name in names)], lines)


def _stay(rows: Sequence[Row]) -> str:
    finest = min(rows, key=lambda row: number(row, "dt"), default=None)
    if finest is None:
        return ""
    stood = number(finest, "stays_s") > 0.999 * number(finest, "duration_s")
    return f"{'≥ ' if stood else ''}{shown('stays_s', finest.get('stays_s'))} s"


def _judged(options: Mapping[str, Any]) -> str:
    meanings = "\n".join(f"- **{name}**: {markdown(meaning, 300)}" for name, meaning in VERDICTS.items())
    limit, finest = (number_text(float(options.get(name, 0.0)), ".3g") for name in ("time_limit", "finest"))
    return (
        f"Energy errors are in units of the energy scale; the limits are {number_text(HOLDS, '.0%')} and "
        f"{number_text(BREAKS, '.0%')} of it. They are looked at after every step, or at 1000 to 10,000 samples of "
        f"longer runs. No run may take longer than {limit} s. A step that is not finished in that time spares the "
        "method the finer ones. The search goes between the largest step that holds and the smallest failing one "
        "above it, halving on a logarithmic scale until it is known to a tenth; where none holds, it goes on in fifths "
        f"down to {finest} s. That a step holds does not say that all smaller ones do: rounding and chaos have a part "
        "in it.\n\n"
        f"{meanings}"
    )
