"""The simple pendulum over 2000 s: the multibody community's benchmark A01, whose errors have time to add up."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pendbench.report.columns import NOTHING, duration_text, number_text, shown
from pendbench.report.cost_prices import Prices, way, why_not
from pendbench.report.rows import Row, case_name, number
from pendbench.report.text import markdown, table

#: The scene, as the bundled one is called.
SCENE: Final = "a01"
_ALLOWED: Final = 1e-3


def pendulum(prices: Prices) -> Iterator[str]:
    """The section; nothing where the scene is no part of the study."""
    if SCENE not in prices.scenes:
        return
    seconds = number_text(prices.seconds[SCENE])
    yield f"## The pendulum of {seconds} s (scene {SCENE})"
    yield (
        "The multibody community's benchmark A01: a pendulum of 1 m swings from the horizontal, and is to be where it "
        f"should be, to {shown('accuracy', _ALLOWED)} m, after all these swings. The motion is regular: errors add up, "
        "and chaos has no part in them. What each engine needs for that, and the smallest error that it reaches:"
    )
    headings = ["engine", f"to {shown('accuracy', _ALLOWED)} m", "with", "smallest error", "of"]
    yield table(headings, [_line(prices, engine) for engine in prices.engines], (1, 3))


def _line(prices: Prices, engine: str) -> list[str]:
    row = prices.cheapest(SCENE, _ALLOWED, engine)
    asked = _ALLOWED in prices.accuracies
    best = prices.most_accurate(SCENE, engine)
    found = [_time(row), markdown(way(row, with_engine=False))] if row else [_without(prices, engine, asked), NOTHING]
    if best is None:
        return [markdown(engine), *found, NOTHING, NOTHING]
    error = shown("best_error", number(best, "error_max"))
    return [markdown(engine), *found, error, markdown(case_name(best, with_scene=False))]


def _time(row: Row) -> str:
    bound = "≤ " if str(row.get("bound")).lower() == "true" else ""
    return f"{bound}{duration_text(number(row, 'run_s'))}"


def _without(prices: Prices, engine: str, asked: bool) -> str:
    return markdown(why_not(prices, SCENE, engine)) if asked else "not asked for by this study"
