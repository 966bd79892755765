"""What the rows of a study of kind `stability` add up to: counts, medians and lists for its page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendbench.kinds.stability.columns import STABLE_DT_STIFFEST, CaseRow, StepRow
from pendbench.measures.verdict import is_known
from pendbench.report.columns import Column, Table, text_column
from pendbench.report.names import engine_of, finite, grouped, pair_of, scene_of
from pendbench.report.numbers import times_text
from pendbench.study.case import Case

#: The step of a display at 240 pictures a second, s: what games and robots run at.
FRAME: Final = 1 / 240

#: Verdicts whose reasons are the same in many scenes.
_TELLING: Final = ("refused", "crashed", "error")


@dataclass(frozen=True)
class Best:
    """How many scenes a method holds. case: one of its own.

    at_frame: how many with a step of 1/240 s; nan where that was not tried. smaller: how many times smaller its largest
    stable steps are than those of the best method of all with a fixed step, in the median of the scenes that both hold.
    """

    case: Case
    scenes: int
    held: int
    unknown: int
    refused: int
    at_frame: float
    smaller: float


@dataclass(frozen=True)
class Limit:
    """Step times stiffest frequency (rad) over the scenes that a method holds: in the middle, and at the ends with
    their scenes; and how much larger than the largest stable step is the largest unbroken one.
    """

    case: Case
    scenes: int
    middle: float
    smallest: str
    largest: str
    room: float


@dataclass(frozen=True)
class Loss:
    """How it ends where no step of a method holds, and in which scenes."""

    how: str
    scenes: Sequence[str]


_METHOD: Final = text_column("method", "method", "engine and method", pair_of)
_BEST: Final = (
    _METHOD,
    Column("scenes", "1", "d", "scenes", "how many were tried"),
    Column("held", "1", "d", "held by some step", "scenes that some step holds"),
    Column("unknown", "1", "d", "not known", "scenes that the study's limits left open"),
    Column("refused", "1", "d", "refused", "scenes that the engine refuses"),
    Column("at_frame", "1", "d", "held at 1/240 s", "scenes held with that step", empty="not tried"),
    Column(
        "smaller", "1", ".2g", "steps smaller by", "than those of the best fixed step, in the median scene",
        lambda row: "" if math.isnan(row.smaller) else times_text(row.smaller),
    ),
)  # fmt: skip
_LIMITS: Final = (
    _METHOD,
    Column("scenes", "1", "d", "scenes held", "scenes that it holds"),
    Column("middle", "rad", ".2g", "step times frequency, median", "over these scenes"),
    text_column("smallest", "smallest", "and its scene"),
    text_column("largest", "largest", "and its scene"),
    Column(
        "room", "1", ".2g", "breaks only above, median", "the largest unbroken step over the largest stable one",
        lambda row: times_text(row.room),
    ),
)  # fmt: skip


def own_steps(steps: Sequence[StepRow], cases: Sequence[CaseRow]) -> Table:
    """Every method that chooses or divides its steps."""
    own = [row for row in steps if row.adaptive or row.substeps]
    return Table("own_steps", _BEST, [_tallied(rows, cases, ()) for rows in grouped(own, pair_of).values()])


def best_fixed(steps: Sequence[StepRow], cases: Sequence[CaseRow]) -> Table:
    """Of each engine the best method with a fixed step: that which holds most scenes, or those with the larger steps.

    The best of all comes first.
    """
    fixed = [row for row in steps if not (row.adaptive or row.substeps)]
    best = [
        max(grouped(own, pair_of).values(), key=_goodness)  # the first of equals
        for own in grouped(fixed, engine_of).values()
    ]
    best.sort(key=_goodness, reverse=True)
    return Table("best_fixed", _BEST, [_tallied(own, cases, best[0]) for own in best])


def _goodness(rows: Sequence[StepRow]) -> tuple[int, float]:
    """How many scenes some step holds, and how large these steps are beside those of each scene's best method."""
    sizes = [math.log(row.stable_dt_ratio) for row in rows if row.stable_dt_ratio > 0]
    return sum(row.holds for row in rows), float(np.mean(sizes)) if sizes else -math.inf


def _tallied(rows: Sequence[StepRow], cases: Sequence[CaseRow], leader: Sequence[StepRow]) -> Best:
    near = [row for row in cases if pair_of(row) == pair_of(rows[0]) and _is_frame(row.case.dt)]
    return Best(
        case=rows[0].case,
        scenes=len(rows),
        held=sum(row.holds for row in rows),
        unknown=sum(row.is_unknown for row in rows),
        refused=sum(row.is_refused for row in rows),
        at_frame=sum(row.run.verdict == "holds" for row in near) if near else math.nan,
        smaller=_smaller(rows, leader),
    )


def _is_frame(dt: float | None) -> bool:
    """Whether a step is 1/240 s, as people type it."""
    return dt is not None and math.isclose(dt, FRAME, rel_tol=1e-4)


def _smaller(rows: Sequence[StepRow], leader: Sequence[StepRow]) -> float:
    theirs = {scene_of(row): row.stable_dt for row in leader}
    ratios = finite(theirs.get(scene_of(row), math.nan) / row.stable_dt for row in rows)
    return float(np.median(ratios)) if ratios else math.nan


def limits(steps: Sequence[StepRow]) -> Table:
    """Step times stiffest frequency, of each method with a fixed step."""
    fixed = [row for row in steps if not (row.adaptive or row.substeps)]
    known = ([row for row in own if row.stable_dt_stiffest > 0] for own in grouped(fixed, pair_of).values())
    return Table("limits", _LIMITS, [_limit(own) for own in known if own])


def _limit(rows: Sequence[StepRow]) -> Limit:
    ordered = sorted(rows, key=lambda row: row.stable_dt_stiffest)
    low, high = (f"{STABLE_DT_STIFFEST.text(row)} ({scene_of(row)})" for row in (ordered[0], ordered[-1]))
    room = finite(row.unbroken_dt / row.stable_dt for row in rows)
    middle = float(np.median([row.stable_dt_stiffest for row in rows]))
    return Limit(rows[0].case, len(rows), middle, low, high, float(np.median(room)) if room else math.nan)


def losses(steps: Sequence[StepRow]) -> dict[str, list[Loss]]:
    """For each method that does not hold everything: how that ends, and where."""
    lost = grouped((row for row in steps if not row.holds), pair_of)
    return {
        name: [Loss(how, [scene_of(row) for row in rows]) for how, rows in grouped(own, _how).items()]
        for name, own in lost.items()
    }


def _how(row: StepRow) -> str:
    if row.is_unknown:
        told = "not known" if not is_known(row.best_verdict) else f"not known ({row.best_verdict} so far)"
    else:
        told = row.best_verdict
    return f"{told} ({row.reason})" if row.best_verdict in _TELLING else told


def standing(cases: Sequence[CaseRow]) -> Iterator[CaseRow]:
    """Of chains that stand where nothing pulls them: the finest step of each method that holds."""
    stood = [row for row in cases if row.run.stays_s >= 0 and row.run.verdict == "holds"]
    for own in grouped(stood, lambda row: (scene_of(row), pair_of(row))).values():
        yield min(own, key=lambda row: row.case.dt or 0.0)
