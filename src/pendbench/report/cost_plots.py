"""The plots of a study of kind `cost`: error against time and against step, and the energy of long runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import accumulate
from typing import Final

from pendbench.report.columns import number_text
from pendbench.report.cost_series import without_tolerance
from pendbench.report.cost_steps import steps_figure
from pendbench.report.cost_work import work_figure
from pendbench.report.curves import Frame, curves_figure, curves_of
from pendbench.report.look import Look
from pendbench.report.plots import Picture, bounds, draw
from pendbench.report.rows import Row, distinct, finite, of, records
from pendbench.report.text import file_name, label
from pendbench.study.results import Results

#: The beginnings of the names of the plots' files.
WORK, STEPS, LONG = "work", "steps", "long"

_CAPTIONS: Final = {
    WORK: "the largest error against the cost of a simulated second: further left is cheaper, further down is more "
    "accurate. A hue for each engine, a shade and a marker for each method, a line along its steps. Black stairs: the "
    "cheapest way to each error. Crosses along the top: steps with which the run failed, at what they would have cost.",
    STEPS: "the largest error against the step (the mean step of a method that chooses its own). Dashed: the orders "
    "that the methods claim. Crosses along the top: steps with which the run failed.",
    LONG: "the largest energy error so far in long runs, a panel for each engine. Flat: the method keeps the energy in "
    "a band. Rising: it drifts. Crosses: the run ended there, not well.",
}


def pictures(results: Results) -> Iterator[Picture]:
    """Every plot that the tables allow."""
    cases = [without_tolerance(row) for row in records(results.cases)]
    look = Look.of_cases(cases)
    orders, names = records(results.tables.get("orders")), set[str]()
    for scene in distinct(cases, "scene"):
        own = of(cases, scene=scene)
        if any(finite(own, "error_max")):
            yield _picture(WORK, scene, names, draw(partial(work_figure, look, scene, own)))
            yield _picture(STEPS, scene, names, draw(partial(steps_figure, look, scene, own, of(orders, scene=scene))))
    long_runs, curves = records(results.tables.get("long_runs")), records(results.tables.get("curves"))
    for scene in distinct(long_runs, "scene"):
        yield from _long(look, of(long_runs, scene=scene), of(curves, scene=scene), names)


def _picture(kind: str, scene: str, names: set[str], png: bytes) -> Picture:
    file = file_name(f"{kind}_{scene}", names)
    names.add(file)
    return Picture(file, scene, f"{scene}: {_CAPTIONS[kind]}", png)


def _long(look: Look, runs: Sequence[Row], rows: Sequence[Row], names: set[str]) -> Iterator[Picture]:
    """The energies of a scene's long runs: the largest error so far. What swings through zero has no logarithm."""
    scene = str(runs[0]["scene"])
    found = curves_of(rows, "energy_error", [{**row, "start": 0} for row in runs])
    curves = [replace(curve, y=list(accumulate(curve.y, max))) for curve in found]
    if not curves:
        return
    its = Look.of_cases(runs)
    its = replace(its, engines=look.engines, methods={name: its.methods.get(name, []) for name in look.engines})
    steps = number_text(max(finite(runs, "steps"), default=0), "d")
    title = f"{label(scene)}: energy over {steps} steps"
    limits = bounds([y for curve in curves for y in curve.y], 1e-17, 1e2)
    frame = Frame(title, "energy error so far, energy scale", runs, limits)
    yield _picture(LONG, scene, names, draw(partial(curves_figure, its, curves, frame)))
