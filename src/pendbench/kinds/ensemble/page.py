"""What the page of a study of kind `ensemble` says; the sentences are in page.md.j2."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from pendbench.kinds.ensemble.columns import CaseRow, MapRow
from pendbench.kinds.ensemble.plots import differences_figure, exponents_figure, map_figure
from pendbench.kinds.ensemble.study import Found, is_ours
from pendbench.measures.flips import edge_of
from pendbench.report.columns import Table
from pendbench.report.names import engine_of, grouped, pair_of
from pendbench.report.plots import Drawn, Picture
from pendbench.study.results import Results


@dataclass(frozen=True)
class Facts:
    """Everything that the template says.

    mapped, finest: the cases of the map and of the truth. own: the map in numbers. best: of each engine. closest: of
    the engines that run one chain after the other. loosest: of our tolerances that change nothing away from the edge.
    allowed: by how much flip times may differ, s.
    """

    mapped: CaseRow
    finest: CaseRow
    own: MapRow
    allowed: float
    ours: Sequence[CaseRow]
    others: Sequence[CaseRow]
    best: Sequence[CaseRow]
    closest: CaseRow | None
    loosest: CaseRow | None


def facts(results: Results[Found], tables: dict[str, Table]) -> Facts:
    """What the page says."""
    cases: list[CaseRow] = list(tables["cases"])
    ours, others = [row for row in cases if is_ours(row.case)], [row for row in cases if not is_ours(row.case)]
    judged = [row for row in cases if row.agrees.pixels and not row.is_truth]
    best = [_best(own) for own in grouped(judged, engine_of).values()]
    return Facts(
        mapped=next(row for row in ours if row.case.tolerance == results.options.tolerance),
        finest=next(row for row in ours if row.is_truth),
        own=tables["maps"].rows[0],
        allowed=results.options.changed * results.found.scene.duration,
        ours=ours,
        others=others,
        best=best,
        closest=min((row for row in judged if row in others), key=_far, default=None),
        loosest=_loosest([row for row in ours if row in judged]),
    )


def _far(row: CaseRow) -> tuple[float, float]:
    """The shares of its pixels that are different: away from the map's edge, and at all."""
    return row.agrees.changed_away / row.agrees.pixels, row.agrees.changed / row.agrees.pixels


def _best(own: Sequence[CaseRow]) -> CaseRow:
    """The method with the fewest differences, at its coarsest step or tolerance with no more away from the edge."""
    first = min(own, key=_far)
    same = [row for row in own if pair_of(row) == pair_of(first) or (is_ours(row.case) and is_ours(first.case))]
    as_good = [row for row in same if _far(row)[0] == _far(first)[0]]
    return max(as_good, key=lambda row: row.case.dt or row.case.tolerance)


def _loosest(ours: Sequence[CaseRow]) -> CaseRow | None:
    """The loosest tolerance which, like all finer ones, changes nothing away from the edge."""
    whole = [row for row in ours if not row.agrees.failed]
    bad = min((row.case.tolerance for row in whole if row.agrees.changed_away), default=math.inf)
    good = [row for row in whole if row.case.tolerance < bad]
    return max(good, key=lambda row: row.case.tolerance, default=None)


def pictures(results: Results[Found], tables: dict[str, Table]) -> Iterator[Picture]:
    """The map, where others differ from it, and exponents against energy."""
    flips, duration = results.found.map, results.found.scene.duration
    caption = (
        f"The time until a double pendulum released at rest first goes over the top, {len(flips)} x {len(flips)} "
        "releases; white: not within the scene's duration."
    )
    yield Picture("map", "", caption, Drawn(partial(map_figure, flips, duration)))
    others = grouped((row for row in tables["pixels"] if not is_ours(row.case)), lambda row: row.case)
    if others:
        edge = edge_of(flips, results.options.changed * duration)
        caption = (
            "The map, pale, with its edge shaded: where other methods have another time than the finest tolerance."
        )
        figure = partial(differences_figure, flips, duration, edge, list(others.values()))
        yield Picture("differences", "", caption, Drawn(figure))
    if len(tables["exponents"]):
        caption = "The largest Lyapunov exponent of releases at rest against their energy."
        figure = partial(exponents_figure, list(tables["energies"]), list(tables["exponents"]))
        yield Picture("exponents", "", caption, Drawn(figure))
