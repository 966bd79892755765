"""What the page of a study of kind `judge` says; the sentences are in page.md.j2."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from pendbench.kinds.judge.columns import CaseRow, MethodRow, SceneRow, StandsRow, best_of_engines
from pendbench.kinds.judge.plots import error_figure
from pendbench.kinds.judge.study import Found
from pendbench.kinds.judge.work import MAGNIFIED
from pendbench.report.columns import Table
from pendbench.report.names import engine_of, grouped, scene_of
from pendbench.report.plots import Drawn, Picture
from pendbench.report.styles import Styles
from pendbench.report.text import file_name
from pendbench.study.case import Case
from pendbench.study.results import Results
from pendbench.truth.proof.known import Proven, proven


@dataclass(frozen=True)
class Judged:
    """A scene and what was found about it. best: of each engine, the cheapest first. lacking: engines that do not
    reach what is asked for.
    """

    row: SceneRow
    best: Table
    methods: Table
    cases: Table

    @property
    def reached(self) -> Sequence[MethodRow]:
        """The best of each engine that does what is asked for, the cheapest first."""
        return [row for row in self.best if row.reached]

    @property
    def lacking(self) -> Sequence[MethodRow]:
        """The best of each engine that does not."""
        return [row for row in self.best if not row.reached]

    @property
    def lacking_engines(self) -> Sequence[str]:
        """Their names."""
        return [row.case.engine for row in self.lacking]

    @property
    def refusing(self) -> Sequence[MethodRow]:
        """A method of each engine, where none simulates the scene."""
        return [own[0] for own in grouped(self.methods, engine_of).values()]

    def of_engine(self, name: str) -> Sequence[MethodRow]:
        """The best of an engine, where it does what is asked for."""
        return [row for row in self.reached if row.case.engine == name]

    def dearer(self, row: MethodRow) -> float:
        """How many times the cheapest one's cost a row's is."""
        return row.cost_s_per_s / self.reached[0].cost_s_per_s


@dataclass(frozen=True)
class Facts:
    """Everything that the template says. goal: the error asked for, in lengths of the chain. stands: the
    file as it stands; notes: what it has beyond a chain.
    """

    judged: Sequence[Judged]
    stands: StandsRow | None
    notes: Sequence[str]
    goal: float
    most: float
    proven: Sequence[Proven]


def facts(results: Results[Found], tables: dict[str, Table]) -> Facts:
    """What the page says."""
    methods, cases = tables["methods"], tables["cases"]
    best = best_of_engines(list(methods))
    judged = [
        Judged(
            row,
            methods.of(best.get(row.scene.name, ())),
            methods.of(own for own in methods if scene_of(own) == row.scene.name),
            cases.of(own for own in cases if scene_of(own) == row.scene.name),
        )
        for row in tables["scenes"]
    ]
    stands = next(iter(tables["as_it_stands"]), None)
    known = proven(one.row.scene for one in judged)
    return Facts(judged, stands, stands.file.notes if stands else (), results.found.goal, MAGNIFIED, known)


def moving(results: Results[Found], tables: dict[str, Table]) -> list[Case]:
    """The best of each engine in the first scene: what is recommended, where something is."""
    del results
    best = best_of_engines(list(tables["methods"]))
    return [row.case for rows in list(best.values())[:1] for row in rows if row.status != "refused"]


def pictures(results: Results[Found], tables: dict[str, Table]) -> Iterator[Picture]:
    """For each scene the error against the step."""
    rows: list[CaseRow] = [row for row in tables["cases"] if row.run.error_max > 0 and row.case.dt is not None]
    styles, taken = Styles.of_cases(row.case for row in rows), list[str]()
    for scene, own in grouped(rows, scene_of).items():
        taken.append(file_name(f"errors_{scene}", taken))
        caption = "The largest error against the step, for methods with a fixed step; ringed: what is recommended."
        yield Picture(taken[-1], scene, caption, Drawn(partial(error_figure, styles, own, results.found.goal)))
