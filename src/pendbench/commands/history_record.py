"""What the releases of an engine changed: rows, what moved between one and the next, and the page that says so."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendbench.base.files import write_whole
from pendbench.base.processes import processor
from pendbench.base.source import surroundings
from pendbench.commands.releases import STEP_S, WINDOW_S, Release
from pendbench.report.columns import Column, Table, text_column
from pendbench.report.html_page import html_page
from pendbench.report.plots import Drawn, Picture
from pendbench.report.releases import Point, history_figure
from pendbench.report.tables import csv_text
from pendbench.report.template import render, render_block
from pendbench.study.case_table import case_key
from pendbench.study.changes import BETTER, UNTOLD, WORSE
from pendbench.study.comparison import Change, Compared, compare_cases
from pendbench.study.timing import SPREAD_LIMIT

if TYPE_CHECKING:
    import pandas as pd

_TEMPLATE: Final = "history.md.j2"
#: Numbers of a run that nothing but the run decides: the same to the last digit where its program has not changed.
_DECIDED: Final = ("status", "error_max", "energy_drift_max", "gap_max", "steps")


@dataclass(frozen=True)
class HistoryRow:
    """A release with a method in a scene; or a release of which nothing could be measured, with the reason."""

    version: str
    status: str
    reason: str = ""
    scene: str = ""
    method: str = ""
    dt: float = math.nan
    error_max: float = math.nan
    energy_drift_max: float = math.nan
    stable_dt: float = math.nan
    step_us: float = math.nan
    step_spread: float = math.nan


COLUMNS: Final = (
    text_column("version", "release", "the engine's release"),
    text_column("scene", "scene", "the scene's name"),
    text_column("method", "method", "the engine's method, with its settings"),
    Column("dt", "s", ".3g", "step, s", "the step of errors and costs; none of a method that chooses its own"),
    text_column("status", "status", "how the run ended, or that there is none"),
    text_column("reason", "reason", "why it did not end well"),
    Column("error_max", "1", ".2g", "error", f"largest error up to {WINDOW_S:g} s, in lengths of the chain"),
    Column("energy_drift_max", "1", ".2g", "energy", "largest error of the energy, over its scale"),
    Column("stable_dt", "s", ".3g", "largest stable step, s", "the largest step that holds, to a tenth"),
    Column("step_us", "us", ".3g", "step, µs", "the cost of a step: the median of the calm rounds", is_time=True),
    Column("step_spread", "1", ".0%", "spread", "largest less smallest cost of all rounds, over it", is_time=True),
)  # fmt: skip


@dataclass(frozen=True)
class Step:
    """What happened from one release to the next. same: how many of the shared cases have the same digits; of: all."""

    before: str
    after: str
    costs: Compared
    stability: Compared
    same: int
    of: int

    @property
    def changes(self) -> tuple[Change, ...]:
        """What moved, for the worse first."""
        found = [*self.costs.changes, *self.stability.changes]
        return tuple(each for outcome in (WORSE, BETTER) for each in found if each.outcome == outcome)

    @property
    def alike(self) -> bool:
        """Whether every shared case has the same digits."""
        return self.same == self.of > 0

    @property
    def methods(self) -> str:
        """The methods that only one of the two has: ``+discrete``, ``-euler``."""
        named = (("-", self.costs.gone), ("+", self.costs.new))
        return ", ".join(dict.fromkeys(f"{sign}{case.split()[2]}" for sign, cases in named for case in cases))

    @property
    def untold(self) -> int:
        """How many numbers were too noisy to tell."""
        return len(self.costs.of(UNTOLD))


@dataclass(frozen=True)
class History:
    """Releases of an engine, the earliest first, and what they changed. rounds: of the clock."""

    engine: str
    releases: tuple[Release, ...]
    rounds: int

    @property
    def measured(self) -> tuple[Release, ...]:
        """The releases of which there are numbers."""
        return tuple(each for each in self.releases if each.costs)

    @cached_property
    def steps(self) -> tuple[Step, ...]:
        """From each release that has numbers to the next that has."""
        return tuple(_step(before, after) for before, after in pairwise(self.measured))

    @cached_property
    def whole(self) -> Step | None:
        """From the first to the last, for what moved so slowly that no release shows it."""
        return _step(self.measured[0], self.measured[-1]) if len(self.measured) > 2 else None

    @cached_property
    def table(self) -> Table:
        """Every row."""
        return Table("history", COLUMNS, [row for each in self.releases for row in _rows(each)])

    @property
    def lines(self) -> list[str]:
        """What moved, and which releases are missing, for a terminal."""
        from pendbench.commands.comparing import line_of

        missing = [f"{each.version}: {each.reason}" for each in self.releases if each.reason]
        moved = [f"{step.after}: {line_of(each)}" for step in self.steps for each in step.changes]
        return [*missing, *moved]

    @cached_property
    def answer(self) -> str:
        """The outcome in a few sentences."""
        return render_block(_TEMPLATE, "answer", self._facts)

    def save(self, out: Path) -> None:
        """Write history.csv, plots/history.png, report.html and, last, report.md into a folder."""
        text = render(_TEMPLATE, self._facts)
        pictures = {f"plots/{each.name}.png": each.drawn for each in self._pictures}
        files = {"history.csv": csv_text(self.table).encode()}
        files |= {path: drawn.png for path, drawn in pictures.items()}
        files |= {"report.html": html_page(text, self.answer, pictures).encode(), "report.md": text.encode()}
        for name, content in files.items():
            write_whole(out / name, lambda file, content=content: file.write(content))  # type: ignore[misc]

    @cached_property
    def _pictures(self) -> list[Picture]:
        points = [
            Point(row.version, row.scene, row.method,
                  (row.error_max, row.energy_drift_max, row.stable_dt, row.step_us))
            for row in self.table if row.method
        ]  # fmt: skip
        if not points:
            return []
        drawn = Drawn(lambda: history_figure(self.engine, [each.version for each in self.releases], points))
        said = f"Error and energy up to {WINDOW_S:g} s at a step of {STEP_S:g} s, the largest stable step, and the cost"
        return [Picture("history", "", f"{said} of a step, by release.", drawn)]

    @property
    def _facts(self) -> dict[str, Any]:
        return {
            "history": self,
            "rows": self.table,
            "columns": [column.name for column in COLUMNS if column.name != "reason"],
            "shown": [row for row in self.table if row.method],
            "missing": [each for each in self.releases if each.reason],
            "steps": self.steps,
            "whole": self.whole,
            "pictures": self._pictures,
            "machine": [processor(), f"Python {surroundings()[0]}", *surroundings()[2:]],
            "step": STEP_S,
            "window": WINDOW_S,
        }


def _step(before: Release, after: Release) -> Step:
    stable = [[each.stability] if each.stability is not None else [] for each in (before, after)]
    stability = compare_cases(*stable, clock=False) if all(stable) else Compared(())
    pairs = _shared(before.costs[0], after.costs[0])
    same = sum(all(str(was.get(name)) == str(now.get(name)) for name in _DECIDED) for was, now in pairs)
    costs = compare_cases(before.costs, after.costs, clock=True)
    return Step(before.version, after.version, costs, stability, same, len(pairs))


def _shared(before: pd.DataFrame, after: pd.DataFrame) -> list[tuple[pd.Series, pd.Series]]:
    later = {case_key(row): row for _, row in after.iterrows()}
    return [(row, later[key]) for _, row in before.iterrows() if (key := case_key(row)) in later]


def _rows(release: Release) -> Iterator[HistoryRow]:
    if not release.costs:
        yield HistoryRow(release.version, "not measured", release.reason)
        return
    stable = {}
    for _, row in release.stability.iterrows() if release.stability is not None else ():
        stable[_method(row)] = float(row["stable_dt"])
    by_round: list[dict[tuple[str, ...], Any]] = [
        {case_key(row): row for _, row in table.iterrows()} for table in release.costs
    ]
    for key, row in by_round[0].items():
        cost, spread = _cost([table[key] for table in by_round if key in table])
        yield HistoryRow(
            release.version, str(row["status"]), str(row["reason"]), str(row["scene"]),
            " ".join(filter(None, (str(row["method"]), str(row["settings"])))), float(row["dt"]),
            float(row["error_max"]), float(row["energy_drift_max"]), stable.get(_method(row), math.nan), cost, spread,
        )  # fmt: skip


def _method(row: pd.Series) -> tuple[str, ...]:
    scene, engine, method, _, settings = case_key(row)
    return scene, engine, method, settings


def _cost(rows: Sequence[pd.Series]) -> tuple[float, float]:
    """The cost of a step, us, by the rounds that were calm, or by all where none was; and the spread of all."""
    costs = np.array([float(row["step_us"]) for row in rows])
    calm = np.array([float(row["step_spread"]) <= SPREAD_LIMIT for row in rows])
    if np.isnan(costs).all():
        return math.nan, math.nan
    median = float(np.nanmedian(costs[calm] if calm.any() else costs))
    return median, float(np.nanmax(costs) - np.nanmin(costs)) / median
