"""What it takes to stay with the truth: engines compared at equal accuracy, not at equal step."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from pendbench.kinds.chaos.rows import CaseRow, SceneRow
from pendbench.report.columns import ENGINE, SCENE_NAME, STEP_SPREAD, Column, Table, text_column
from pendbench.report.names import case_name, distinct, engine_of, is_ok


@dataclass(frozen=True)
class Price:
    """The cheapest case of an engine that stays with the truth of a scene up to half of its horizon; None: none does.

    half: s.
    """

    scene: SceneRow
    engine: str
    half: float
    cheapest: CaseRow | None

    @property
    def name(self) -> str:
        """The method and step."""
        return "none of its cases" if self.cheapest is None else case_name(self.cheapest.case, with_scene=False)

    @property
    def cost_ms(self) -> float:
        """Ms of computing for a simulated second."""
        return math.nan if self.cheapest is None else self.cheapest.cost_ms

    @property
    def timing(self) -> str:
        """What the cost is worth."""
        if self.cheapest is None:
            return ""
        timing = self.cheapest.timing
        return f"noisy ({STEP_SPREAD.shown(timing.step_spread)})" if timing.noisy else "steady"


_PRICES: Final = (
    SCENE_NAME.at(lambda row: row.scene.scene.name),
    text_column("engine", "engine", ENGINE.meaning),
    Column("half", "s", ".3g", "up to, s", "half of the horizon"),
    text_column("name", "cheapest case", "of those that end well and stay with the truth up to there"),
    Column("cost_ms", "ms", ".3g", "ms per simulated s", "computing for a second of motion", is_time=True),
    text_column("timing", "timing", "whether the cost is noisy"),
)


def prices(scenes: Sequence[SceneRow], cases: Sequence[CaseRow]) -> Table:
    """A row for each scene that moves and each engine."""
    return Table("equal accuracy", _PRICES, list(_prices([row for row in scenes if not row.still], cases)))


def _prices(scenes: Sequence[SceneRow], cases: Sequence[CaseRow]) -> Iterator[Price]:
    for scene in scenes:
        half = 0.5 * scene.truth.horizon
        own = [row for row in cases if row.scene is scene]
        for engine in distinct(own, engine_of):
            able = [row for row in own if engine_of(row) == engine and _is_able(row, half)]
            yield Price(scene, engine, half, min(able, key=lambda row: row.cost_ms, default=None))


def _is_able(row: CaseRow, time: float) -> bool:
    return is_ok(row) and row.stays_until >= time and math.isfinite(row.cost_ms)
