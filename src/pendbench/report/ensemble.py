"""The page of a study of kind `ensemble`, from top to bottom."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
import pandas as pd

from pendbench.report import sections
from pendbench.report.columns import duration_text, number_text, shown
from pendbench.report.ensemble_plots import differences_figure, exponents_figure, map_figure
from pendbench.report.plots import Picture, draw
from pendbench.report.rows import Row, case_name, is_ok, number, records, word
from pendbench.report.text import counted, listed, markdown
from pendbench.study.flips import edge_of
from pendbench.study.results import Results

#: The columns of the terminal's table.
SUMMARY: Final = ("engine", "method", "dt", "chains", "chain_us", "pixels", "changed", "changed_away", "status")

_OURS: Final = (
    "tolerance", "chains", "chain_us", "pixels", "pixels_at_edge", "changed", "changed_away", "largest_away_s",
)  # fmt: skip
_OTHERS: Final = (
    "engine", "method", "settings", "dt", "chain_us", "pixels", "pixels_at_edge", "changed", "changed_away",
    "largest_away_s", "changed_from_map", "energy_drift_max",
)  # fmt: skip
_ENERGIES: Final = (
    "energy_from", "energy_to", "chains", "exponent_first_quartile_per_s", "exponent_median_per_s",
    "exponent_third_quartile_per_s", "regular_share",
)  # fmt: skip
_CASE: Final = ("scene", "engine", "method", "settings", "dt", "status", "chains", "run_s", "reason")

_ELSEWHERE: Final = """\
A coarser grid of the map's pixels, compared with the finest tolerance there. Compared with the map itself, some of the
differences at its edge are the map's own."""
_EXPONENTS: Final = """\
How fast neighbouring chains part, over a finite time, from releases at rest spread evenly over those of each energy.
A start whose exponent is below three times ln(T) / T, T in units of sqrt(L / g), parts no faster than regular motion
can, and is called regular. Releases at rest are a thin part of all states with an energy: the share that is regular is
that of releases."""


def answer(results: Results) -> str:
    """What the map costs and how exact it is; and who else gets the same picture."""
    ours, others = _split(records(results.cases))
    maps = records(results.tables.get("maps"))
    mapped = _mapped(ours, results.options)
    parts = []
    if maps and mapped is not None and is_ok(mapped):
        parts += [_cost(mapped, maps[0], results), _exactness(mapped, ours, maps[0])]
    elif mapped is not None:
        parts.append(f"There is no whole map ({word(mapped, 'reason')}).")
    parts += [_other(row) for row in others if number(row, "pixels") > 0]
    return " ".join(parts)


def _split(cases: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    """The cases that run many chains at once, and the others."""
    ours = [row for row in cases if _is_ours(row)]
    return ours, [row for row in cases if not _is_ours(row)]


def _is_ours(row: Row) -> bool:
    return word(row, "engine") == "analytic" and word(row, "method") == "adaptive"


def _mapped(ours: Sequence[Row], options: Mapping[str, Any]) -> Row | None:
    own = [row for row in ours if number(row, "tolerance") == options.get("tolerance")]
    return own[0] if own else None


def _cost(mapped: Row, own: Row, results: Results) -> str:
    run_s, workers = number(mapped, "run_s"), results.provenance.get("worker processes")
    shared = f", {duration_text(run_s / workers)} if {workers} processors share them evenly" if workers else ""
    beside = shared if workers and workers > 1 else ""
    chains, duration = number_text(number(mapped, "chains"), ",.0f"), shown("duration_s", own["duration_s"])
    return (
        f"{chains} double pendulums over {duration} s at a tolerance of {shown('tolerance', mapped['tolerance'])} take "
        f"{duration_text(run_s)} in jobs of one thread each{beside}: "
        f"{duration_text(number(mapped, 'chain_us') * 1e-6)} each."
    )


def _exactness(mapped: Row, ours: Sequence[Row], own: Row) -> str:
    finest = min(number(row, "tolerance") for row in ours)
    share = number(own, "pixels_at_edge") / max(1.0, number(own, "pixels"))
    return (
        f"Of {number_text(number(mapped, 'pixels'), ',.0f')} of them run again at {shown('tolerance', finest)}, "
        f"{_changes(mapped)}; the edge is {number_text(share, '.0%')} of the map."
    )


def _changes(row: Row) -> str:
    changed, away = int(number(row, "changed")), int(number(row, "changed_away"))
    if not changed:
        return "none gets another time"
    where = f"{away} of them away from the map's edge" if away else "all at the map's edge"
    return f"{number_text(changed, ',.0f')} {'gets' if changed == 1 else 'get'} another time, {where}"


def _other(row: Row) -> str:
    name = case_name(row, with_scene=False)
    return f"{name}: of {number_text(number(row, 'pixels'), ',.0f')} pixels, {_changes(row)}."


def pictures(results: Results) -> Iterator[Picture]:
    """The map, where others differ from it, and exponents against energy."""
    flips, duration = _flips(results), float(results.options.get("duration", math.nan))
    if flips.size:
        caption = (
            f"The time until a double pendulum released at rest first goes over the top, {len(flips)} x {len(flips)} "
            "releases; white: not within the scene's duration."
        )
        yield Picture("map", "", caption, draw(partial(map_figure, flips, duration)))
    _, others = _split(records(results.tables.get("pixels")))
    groups: dict[str, list[Row]] = {}
    for row in others:
        groups.setdefault(case_name(row, with_scene=False), []).append(row)
    if groups and flips.size:
        edge = edge_of(flips, _allowed(results))
        caption = (
            "The map, pale, with its edge shaded: where other methods have another time than the finest tolerance."
        )
        figure = partial(differences_figure, flips, duration, edge, list(groups.values()))
        yield Picture("differences", "", caption, draw(figure))
    energies, starts = records(results.tables.get("energies")), records(results.tables.get("exponents"))
    if starts:
        caption = "The largest Lyapunov exponent of releases at rest against their energy."
        yield Picture("exponents", "", caption, draw(partial(exponents_figure, energies, starts)))


def _flips(results: Results) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The map (k, k), s."""
    table = results.tables.get("map")
    return (pd.DataFrame() if table is None else table.drop(columns="theta1_rad")).to_numpy(np.float64)


def _allowed(results: Results) -> float:
    return float(results.options["changed"]) * float(results.options["duration"])


def markdown_page(results: Results, plots: Sequence[Picture]) -> str:
    """The report."""
    cases, maps = records(results.cases), records(results.tables.get("maps"))
    ours, others = _split(cases)
    energies = records(results.tables.get("energies"))
    named = {plot.name: plot for plot in plots}
    parts = [
        *sections.opening(results),
        "## The answer",
        markdown(answer(results), 6000),
        "## The map",
        *_shown(named, "map"),
        sections.bullets(sentence for own in maps for sentence in _facts(own)),
        "## What counts as a difference",
        _definition(results),
        "## How exact the map is",
        markdown(_choice(ours, results.options), 2000),
        sections.rows_table(ours, _OURS),
        "## Other methods and engines",
        _ELSEWHERE,
        *_shown(named, "differences"),
        sections.rows_table(others, _OTHERS),
        *_chaos(energies, named, results.options),
        "## Every case",
        sections.rows_table(cases, _CASE),
        "## What failed",
        sections.failures(cases),
        "## What the columns mean",
        sections.definitions(str(name) for frame in (results.cases, *results.tables.values()) for name in frame),
        "## Where the numbers come from",
        sections.provenance_table(results.provenance),
        "`map.csv` has a row for each first angle and, in columns numbered from 0, a column for each second angle, the "
        "same angles in the same order: flip times in s, `inf` for never.",
        sections.files(results),
    ]
    return "\n\n".join(parts) + "\n"


def _shown(named: Mapping[str, Picture], name: str) -> list[str]:
    return [sections.picture(named[name])] if name in named else []


def _facts(own: Row) -> Iterator[str]:
    """What the map shows, and what it must show if it is right."""
    yield (
        f"{shown('never_share', own['never_share'])} of the releases do not go over the top within "
        f"{shown('duration_s', own['duration_s'])} s. {shown('barred_share', own['barred_share'])} cannot ever: they "
        "have less energy than the lowest state with a rod upright. Of these, "
        f"{number_text(number(own, 'barred_flips'), 'd') if number(own, 'barred_flips') else 'none'} does."
    )
    yield (
        "A chain and its mirror image, released from (a, b) and (-a, -b), flip together. The largest difference "
        f"between the two in the map is {shown('mirror_largest_s', own['mirror_largest_s'])} s."
    )
    if number(own, "pixels_failed") > 0:
        yield f"{counted(int(number(own, 'pixels_failed')), 'chain')} could not be followed."


def _definition(results: Results) -> str:
    if "changed" not in results.options:
        return "Nothing was compared."
    share, allowed = number_text(results.options["changed"], ".2g"), number_text(_allowed(results))
    return (
        f"Two flip times are **different** where they are more than {allowed} s apart, {share} of the duration, "
        "or where one chain flips and the other does not. A pixel is at the **edge** of the map where its time is "
        "different, in that sense, from that of one of its eight neighbours. At the edge neighbouring releases have "
        "different fates, and there a small error changes a pixel; away from it, only a method that is wrong does."
    )


def _choice(ours: Sequence[Row], options: Mapping[str, Any]) -> str:
    """Which tolerances change no pixel away from the edge."""
    judged = [row for row in ours if number(row, "pixels") > 0 and number(row, "pixels_failed") == 0]
    good = [number(row, "tolerance") for row in judged if number(row, "changed_away") == 0]
    bad = [number(row, "tolerance") for row in judged if number(row, "changed_away") > 0]
    loosest = max((value for value in good if value < min(bad, default=math.inf)), default=None)
    if loosest is None:
        return "No tolerance of those tried leaves every pixel away from the edge as it is."
    spared = f" ({listed([shown('tolerance', value) for value in sorted(bad)])} do not)" if bad else ""
    return (
        "The same random pixels of the map at every tolerance, compared with the finest. The loosest that leaves "
        f"every pixel away from the edge as it is: {shown('tolerance', loosest)}{spared}. The map has "
        f"{shown('tolerance', options.get('tolerance'))}."
    )


def _chaos(energies: Sequence[Row], named: Mapping[str, Picture], options: Mapping[str, Any]) -> Iterator[str]:
    asked = options.get("exponents")
    if not energies or not asked:
        return
    yield "## How chaotic, at which energy"
    yield _EXPONENTS
    yield f"Each exponent is over {number_text(asked['seconds'])} s, after a tenth of that to settle."
    yield from _shown(named, "exponents")
    yield sections.rows_table(energies, _ENERGIES)
