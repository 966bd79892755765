"""What the page of a study of kind `stability` says; the sentences are in page.md.j2."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

from pendbench.kinds.stability.columns import CaseRow, GrowthRow, StepRow
from pendbench.kinds.stability.plots import cell_text, growth_figure, map_figure
from pendbench.kinds.stability.study import Found
from pendbench.kinds.stability.tallies import Best, Loss, best_fixed, limits, losses, own_steps, standing
from pendbench.measures.energy import conserves_energy
from pendbench.measures.verdict import BREAKS, HOLDS, VERDICTS
from pendbench.report.columns import Table
from pendbench.report.names import distinct, engine_of, finite, grouped, pair_of, scene_of
from pendbench.report.numbers import number_text, times_text
from pendbench.report.plots import Drawn, Picture
from pendbench.report.styles import Styles
from pendbench.report.tables import cross_table
from pendbench.report.text import Safe, markdown
from pendbench.study.case import Case
from pendbench.study.motions import MOST_LINKS
from pendbench.study.results import Results

_FRAME_S: Final = 1 / 240


@dataclass(frozen=True)
class Facts:
    """Everything that the template says. followers: the best methods of the other engines than the first's."""

    own_steps: Table
    best_fixed: Table
    followers: Sequence[Best]
    stable_steps: Safe
    growth: Table
    fitted: Sequence[GrowthRow]
    limits: Table
    losses: Mapping[str, Sequence[Loss]]
    stays: Safe
    balanced: Sequence[str]
    verdicts: Mapping[str, str]
    holds: float
    breaks: float


def facts(results: Results[Found], tables: dict[str, Table]) -> Facts:
    """What the page says."""
    del results
    cases, steps = list(tables["cases"]), list(tables["stable_steps"])
    best = best_fixed(steps, cases)
    return Facts(
        own_steps=own_steps(steps, cases),
        best_fixed=best,
        followers=[row for row in best.rows[1:] if finite([row.smaller])],
        stable_steps=cross_table("scene", steps, scene_of, pair_of, _step),
        growth=tables["growth"],
        fitted=[row for row in tables["growth"] if finite([row.growth.exponent])],
        limits=limits(steps),
        losses=losses(steps),
        stays=_stays(list(standing(cases))),
        balanced=[row.scene.name for row in tables["scenes"] if not conserves_energy(row.scene)],
        verdicts=VERDICTS,
        holds=HOLDS,
        breaks=BREAKS,
    )


def _step(row: StepRow) -> str:
    """A scene's best step in bold; beside the others by how much they are smaller."""
    text, ratio = markdown(cell_text(row)), row.stable_dt_ratio
    if row.substeps or not ratio > 0:
        return text
    return f"**{text}**" if ratio > 0.999 else f"{text} ({markdown(times_text(1 / ratio))})"


def _stays(rows: Sequence[CaseRow]) -> Safe:
    return cross_table("scene", rows, scene_of, pair_of, _stay) if rows else Safe("")


def _stay(row: CaseRow) -> str:
    stood = row.run.stays_s > 0.999 * row.duration_s
    return markdown(f"{'≥ ' if stood else ''}{number_text(row.run.stays_s)} s")


def moving(results: Results[Found], tables: dict[str, Table]) -> list[Case]:
    """The first method of each engine at a game's step, in the scene in which they fare most differently."""
    del results
    rows: list[CaseRow] = [row for row in tables["cases"] if row.status != "refused" and row.case.dt is not None]
    scenes = grouped((row for row in rows if row.case.scene.n <= MOST_LINKS), scene_of)
    shown = [_typical(own) for own in scenes.values()]
    best = max(shown, key=lambda own: (len({row.run.verdict for row in own}), len(own)), default=[])
    return [row.case for row in best]


def _typical(rows: Sequence[CaseRow]) -> list[CaseRow]:
    """Of each engine, the first method with a fixed step, at the step nearest to a frame of a game."""
    methods = (own[0] for own in grouped(rows, engine_of).values())
    of_method = [[row for row in rows if pair_of(row) == pair_of(first)] for first in methods]
    return [min(own, key=lambda row: abs(math.log((row.case.dt or _FRAME_S) / _FRAME_S))) for own in of_method]


def pictures(results: Results[Found], tables: dict[str, Table]) -> Iterator[Picture]:
    """The map, and the largest stable step against n."""
    steps = list(tables["stable_steps"])
    if not steps:
        return
    caption = "Scene by engine and method: the best verdict of all steps, and the largest step that holds, s."
    yield Picture("map", "", caption, Drawn(partial(map_figure, steps)))
    own = [row for row in steps if scene_of(row) in results.options.lengths and row.stable_dt > 0]
    if len(distinct(own, scene_of)) > 1:
        caption = "The largest stable step against the number of links, in one chain of the same length and mass. "
        caption += "Hollow: a lower bound."
        styles = Styles.of_cases(row.case for row in own)
        yield Picture("growth", "", caption, Drawn(partial(growth_figure, styles, own)))
