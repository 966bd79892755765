"""The answer of a study of kind `chaos`: who stays with the truth longest, and what that costs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from pendbench.kinds.chaos.rows import CaseRow, SceneRow
from pendbench.report.columns import DT, ENGINE, METHOD, Column, Table, text_column
from pendbench.report.names import case_name, engine_of, finite, grouped, method_name, scene_of, spanned
from pendbench.report.numbers import number_text
from pendbench.report.text import listed
from pendbench.study.case import Case


@dataclass(frozen=True)
class Standing:
    """One engine, method and step over the scenes that count, `scenes` of them."""

    rows: Sequence[CaseRow]
    scenes: int

    @property
    def case(self) -> Case:
        """The case in one of the scenes."""
        return self.rows[0].case

    @property
    def name(self) -> str:
        """The engine, method and step."""
        return case_name(self.case, with_scene=False)

    @property
    def method(self) -> str:
        """The same without the engine."""
        return self.name.removeprefix(f"{self.case.engine} ")

    @property
    def share(self) -> float:
        """For how much of the horizon it stays with the truth, in the mean of the scenes."""
        return sum(row.share for row in self.rows) / self.scenes

    @property
    def dearest(self) -> float:
        """The largest cost of a simulated second, ms; infinite where none was timed."""
        return max(finite(row.cost_ms for row in self.rows), default=math.inf)

    @property
    def cost(self) -> str:
        """The costs of a simulated second, ms, as a range."""
        costs = finite(row.cost_ms for row in self.rows)
        return spanned(costs, lambda cost: number_text(cost, ".2g")) if costs else ""

    @property
    def timing(self) -> str:
        """What these costs are worth."""
        return "noisy" if any(row.timing.noisy for row in self.rows) else "steady" if self.cost else "not timed"

    @property
    def leaves(self) -> str:
        """After how many seconds it leaves the truth, and in which scenes."""
        left = [row for row in self.rows if math.isfinite(row.left.median)]
        stayed = [row for row in self.rows if row.left.median_is_later]
        lost = [row for row in self.rows if row not in left and row not in stayed]
        told = [f"{spanned([row.left.median for row in left], number_text)}{_places(left, self)}"] if left else []
        told += [f"not before the horizon{_places(stayed, self)}"] if stayed else []
        told += [f"not known{_places(lost, self)}"] if lost else []
        return "; ".join(told)


def _places(rows: Sequence[CaseRow], standing: Standing) -> str:
    if len(rows) == len(standing.rows):
        return ""
    return f" in {listed(list(map(scene_of, rows)))}" if len(rows) <= 2 else f" in {len(rows)} scenes"


#: The columns of the table of the best of each engine.
BEST: Final = (
    ENGINE,
    text_column("name", "method", METHOD.meaning, lambda row: method_name(row.case)),
    DT,
    Column("share", "1", ".0%", "stays for, of the horizon", "the mean share of the horizon until e passes 1e-2"),
    text_column("leaves", "leaves after, s", "when e passes 1e-2"),
    text_column("cost", "ms per simulated s", "computing for a second of motion"),
    text_column("timing", "timing", "whether the costs are noisy"),
)


@dataclass(frozen=True)
class Answer:
    """where: the scenes that count. best: of each engine, the longest first. shared: who stays as long as the first.
    lost: engines of which no case stayed for a time that could be measured. still: scenes in which nothing moves.
    """

    where: str
    best: Table
    shared: Sequence[str]
    lost: Sequence[str]
    still: Sequence[SceneRow]


def answer(scenes: Sequence[SceneRow], cases: Sequence[CaseRow]) -> Answer:
    """What the answer says. Scenes count that are chaotic and have a truth; regular ones where none is."""
    where, names = _scenes_that_count(scenes)
    counted = [row for row in cases if scene_of(row) in names]
    groups = grouped(counted, lambda row: case_name(row.case, with_scene=False))
    standings = [Standing(rows, len(names)) for rows in groups.values()]
    ranked = sorted(standings, key=lambda each: (-each.share, each.dearest, each.name))
    leaders = [own[0] for own in grouped(ranked, engine_of).values()]
    best = [leader for leader in leaders if leader.share > 0]
    return Answer(
        where=where,
        best=Table("best", BEST, best),
        shared=[leader.name for leader in best[1:] if leader.share == best[0].share],
        lost=[leader.case.engine for leader in leaders if leader.share == 0],
        still=[row for row in scenes if row.still],
    )


def _scenes_that_count(scenes: Sequence[SceneRow]) -> tuple[str, list[str]]:
    known = [row for row in scenes if row.truth.horizon > 0 and not row.still]
    chaotic = [row.scene.name for row in known if row.exponent.chaotic]
    names, kind = (chaotic, "chaotic") if chaotic else ([row.scene.name for row in known], "regular")
    return f"the {kind} scene {names[0]}" if len(names) == 1 else f"the {len(names)} {kind} scenes", names
