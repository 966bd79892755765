"""What the page of a study of kind `league` says; the sentences are in page.md.j2."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from pendbench.kinds.league.challenge import Entry, challenge_tables
from pendbench.kinds.league.plots import cost_figure
from pendbench.kinds.league.rows import CaseRow, EngineRow, PairRow, SceneRow, rows_with_ratios
from pendbench.kinds.league.study import LEAVES, OWN, Found
from pendbench.kinds.league.verdicts import STANDARD
from pendbench.report.columns import Table
from pendbench.report.names import distinct, grouped, in_one_scene
from pendbench.report.plots import Drawn, Picture
from pendbench.report.styles import Styles
from pendbench.study.case import Case
from pendbench.study.results import Results
from pendbench.truth.proof.known import Proven, proven


@dataclass(frozen=True)
class OfScene:
    """What the engines do in one scene."""

    name: str
    pairs: Table


@dataclass(frozen=True)
class Challenge:
    """A scene of the Pendulum Challenge, its table, and how position-based dynamics and our own engine stand in it."""

    name: str
    entries: Table
    pbd: Entry | None
    own: Entry | None


@dataclass(frozen=True)
class Facts:
    """Everything that the template says.

    here: engines that are there; others: the same without our own, whose costs are over the cheapest of them. first:
    the best of them. steady: whose energy stays as they come. absent: those that are not there. known_s: how long the
    truths of all scenes are known together. untold: scenes whose truth is not known.
    """

    here: Table
    others: Table
    first: EngineRow | None
    steady: Sequence[str]
    absent: Sequence[EngineRow]
    by_scene: Sequence[OfScene]
    challenges: Sequence[Challenge]
    own: str
    leaves: float
    known_s: float
    proven: Sequence[Proven]
    untold: Sequence[SceneRow]


def facts(results: Results[Found], tables: dict[str, Table]) -> Facts:
    """What the page says."""
    engines: list[EngineRow] = list(tables["engines"])
    here = [row for row in engines if not row.absent]
    pairs: list[PairRow] = list(tables["engines_by_scene"])
    others = rows_with_ratios([row for row in here if row.engine != OWN])
    return Facts(
        here=tables["engines"].of(here),
        others=tables["engines"].of(others),
        first=others[0] if others else None,
        steady=[row.engine for row in here if row.energy("standard") <= STANDARD[0][0]],
        absent=[row for row in engines if row.absent],
        by_scene=[
            OfScene(name, tables["engines_by_scene"].of(own))
            for name, own in grouped(pairs, lambda pair: pair.scene).items()
        ],
        challenges=[
            Challenge(name, entries, _of(entries, "xpbd"), _of(entries, OWN))
            for name, entries in challenge_tables(results.options.challenge, here)
        ],
        own=OWN,
        leaves=LEAVES,
        known_s=sum(row.known_s for row in tables["scenes"]),
        proven=proven(row.scene for row in tables["scenes"]),
        untold=[row for row in tables["scenes"] if not row.known_s > 0],
    )


def _of(entries: Table, engine: str) -> Entry | None:
    return next((row for row in entries if row.engine == engine), None)


def moving(results: Results[Found], tables: dict[str, Table]) -> list[Case]:
    """Every engine as it comes, in the scene that most of them simulate."""
    del results
    rows: list[CaseRow] = list(tables["cases"])
    return in_one_scene(row.case for row in rows if row.as_it_comes and row.status != "refused")


def pictures(results: Results[Found], tables: dict[str, Table]) -> Iterator[Picture]:
    """What accuracy costs with each engine, in each scene."""
    rows: list[CaseRow] = [row for row in tables["cases"] if row.cost_s_per_s > 0 and row.run.error_early > 0]
    if not rows:
        return
    styles, scenes = Styles.of_cases(row.case for row in rows), distinct(rows, lambda row: row.case.scene.name)
    caption = (
        "the largest error of the early part of each scene against the cost of a second. Crosses: each engine as it "
        "comes. Filled: the coarsest step of each of its methods that is accurate enough."
    )
    yield Picture("cost", "", caption, Drawn(partial(cost_figure, styles, scenes, rows, results.options.error)))
