"""The Pendulum Challenge (M. Mueller, matthias-research.github.io/pages/challenges/challenges.html): who beats
position-based dynamics in accuracy, stability, speed or simplicity, each as a number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from pendbench.kinds.league.rows import CaseRow, EngineRow, PairRow
from pendbench.report.columns import Column, Table, text_column

#: The engine that is position-based dynamics, and the method and step of the challenge's own page.
PBD: Final = "xpbd"


@dataclass(frozen=True)
class Entry:
    """An engine in a scene of the challenge.

    follows_s: accuracy, how long it stays on the truth, s. stable_dt: stability, the largest step that holds, s;
    infinite where the best method chooses its steps and holds. cost_s_per_s: speed, of the accuracy asked for; nan
    where it is not reached. lines: simplicity. beats: in which of these it is better than position-based dynamics.
    """

    engine: str
    pair: PairRow
    follows_s: float
    stable_dt: float
    cost_s_per_s: float
    lines: float
    beats: tuple[str, ...] = ()


#: Each criterion: its name, its value in an entry, and whether more of it is better.
CRITERIA: Final[tuple[tuple[str, Callable[[Entry], float], bool], ...]] = (
    ("accuracy", lambda entry: entry.follows_s, True),
    ("stability", lambda entry: entry.stable_dt, True),
    ("speed", lambda entry: entry.cost_s_per_s, False),
    ("simplicity", lambda entry: entry.lines, False),
)


def challenge_tables(scenes: Sequence[str], engines: Sequence[EngineRow]) -> Iterator[tuple[str, Table]]:
    """For each scene of the challenge the entries of all engines, those that beat it in most first."""
    for scene in scenes:
        entries = [
            _entry(row, pair) for row in engines for pair in row.pairs if pair.scene == scene and not pair.is_refused
        ]
        yield scene, Table(f"challenge_{scene}", _COLUMNS, judged(entries))


def _entry(row: EngineRow, pair: PairRow) -> Entry:
    follows = math.nan if pair.best is None else pair.best.run.follows_s
    cost = math.nan if pair.cheapest is None else pair.cheapest.cost_s_per_s
    return Entry(row.engine, pair, follows, _stable(pair), cost, row.lines)


def _stable(pair: PairRow) -> float:
    """The largest step that holds, s; infinite where the best method chooses its steps, and holds."""
    if pair.best is not None and pair.best.case.dt is None and pair.best.run.verdict == "holds":
        return math.inf
    stable: CaseRow | None = pair.stable
    return math.nan if stable is None or stable.case.dt is None else stable.case.dt


def judged(entries: Sequence[Entry]) -> list[Entry]:
    """The entries, each with what it beats position-based dynamics in; those that beat it in most first."""
    pbd = next((entry for entry in entries if entry.engine == PBD), None)
    if pbd is None:
        return list(entries)
    told = [replace(entry, beats=_beats(entry, pbd)) for entry in entries]
    return sorted(told, key=lambda entry: -len(entry.beats))


def _beats(entry: Entry, pbd: Entry) -> tuple[str, ...]:
    return tuple(name for name, of, more in CRITERIA if is_better(of(entry), of(pbd), more=more))


def is_better(value: float, other: float, *, more: bool) -> bool:
    """Whether a number is better than another; what is not reached (nan) is worse than any that is."""
    if math.isnan(value):
        return False
    return math.isnan(other) or (value > other if more else value < other)


def _beaten(entry: Entry) -> str:
    return "itself" if entry.engine == PBD else ", ".join(entry.beats) or "nothing"


_COLUMNS: Final = (
    text_column("engine", "engine", "the program that simulated"),
    Column("follows_s", "s", ".3g", "accuracy: on the truth, s", "at its best"),
    Column("stable_dt", "s", ".2g", "stability: largest step, s", "with which energy and rods stay within 1 %"),
    Column("cost_s_per_s", "s/s", ".2g", "speed: cost of the accuracy, s per s", "in one processor", is_time=True),
    Column("lines", "1", "d", "simplicity: lines of code", "that a user writes"),
    text_column("beats", "beats position-based dynamics in", "of these four", _beaten),
)
