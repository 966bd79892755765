"""What it takes to stay with the truth: engines compared at equal accuracy, not at equal step."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pendbench.report.columns import NOTHING, number_text, shown
from pendbench.report.rows import Row, case_name, distinct, finite, is_noisy, is_ok, number, of, stays_until
from pendbench.report.text import markdown, table


def prices(cases: Sequence[Row]) -> str:
    """For each scene and engine the cheapest case that stays with the truth up to half of the horizon, as a table."""
    lines = []
    for scene in distinct(cases, "scene"):
        half = max(finite(of(cases, scene=scene), "horizon_s"), default=math.nan) / 2
        for engine in distinct(cases, "engine"):
            able = [row for row in of(cases, scene=scene, engine=engine) if _is_able(row, half)]
            cheapest = min(able, key=_price, default=None)
            lines.append([markdown(scene), markdown(engine), shown("horizon_s", half), *_cells(cheapest)])
    return table(["scene", "engine", "up to, s", "cheapest case", "ms per simulated s", "timing"], lines, (2, 4))


def _is_able(row: Row, time: float) -> bool:
    return is_ok(row) and stays_until(row) >= time and math.isfinite(_price(row))


def _price(row: Row) -> float:
    """Ms of computing for a simulated second; infinite where that is not known."""
    speed = number(row, "simulated_s_per_s")
    return 1e3 / speed if speed > 0 else math.inf


def _cells(row: Row | None) -> list[str]:
    if row is None:
        return ["none of its cases", NOTHING, NOTHING]
    spread = f"noisy ({shown('step_spread', row.get('step_spread'))})" if is_noisy(row) else "steady"
    return [markdown(case_name(row, with_scene=False)), number_text(_price(row)), spread]
