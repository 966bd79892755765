"""What got better or worse between two sets of results: of studies, or of gates."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import pandas as pd

from pendbench.base.faults import STATUSES
from pendbench.engines.conformance.check import ERROR, FAILED, PASSED, SKIPPED, Finding
from pendbench.measures.verdict import VERDICTS
from pendbench.study.case_table import case_key, case_text
from pendbench.study.changes import (
    BETTER,
    DIVERGES,
    ORDER,
    SAME,
    STABILITY,
    TIMES,
    UNTOLD,
    WORSE,
    Measure,
    Range,
    change,
    grown,
    told_by,
)
from pendbench.study.spreads import error_range, first_pass, time_range

#: What a check of a gate tells.
CHECKS: Final = "checks"

Rows = Sequence[pd.Series]


@dataclass(frozen=True)
class Change:
    """What became of one number or word of a case. outcome: better, worse, same or not told; why: where it is not told,
    or what the engine says.
    """

    case: str
    about: str
    what: str
    was: float | str
    now: float | str
    outcome: str
    why: str = ""


@dataclass(frozen=True)
class Compared:
    """All that became of cases that both have; gone, new: the cases that only one has, and the same of columns.

    skipped: cases that could not be compared, and why.
    """

    changes: tuple[Change, ...]
    gone: tuple[str, ...] = ()
    new: tuple[str, ...] = ()
    columns_gone: tuple[str, ...] = ()
    columns_new: tuple[str, ...] = ()
    skipped: tuple[str, ...] = ()

    def of(self, outcome: str) -> tuple[Change, ...]:
        """The changes with this outcome."""
        return tuple(each for each in self.changes if each.outcome == outcome)


def compare_cases(
    before: Sequence[pd.DataFrame], after: Sequence[pd.DataFrame], *, clock: bool, others: Collection[str] = ()
) -> Compared:
    """Compare tables of cases; several on a side are repeated runs.

    clock: whether times can be compared: they are of the same machine. others: scenes that are not the same on both
    sides, by name.
    """
    was, now = _by_case(before), _by_case(after)
    both = [key for key in was if key in now]
    columns = [_columns(tables) for tables in (before, after)]
    shared = [name for name in columns[0] if name in columns[1]]
    same = [key for key in both if was[key][0]["scene"] not in others]
    changed = [key for key in both if was[key][0]["scene"] in others]
    found = (each for key in same for each in _of_case(was[key], now[key], shared, clock))
    return Compared(
        tuple(dict.fromkeys(found)),
        tuple(_named(was[key]) for key in was if key not in now),
        tuple(_named(now[key]) for key in now if key not in was),
        tuple(name for name in columns[0] if name not in columns[1]),
        tuple(name for name in columns[1] if name not in columns[0]),
        tuple(_named(was[key]) for key in changed),
    )


def _columns(tables: Sequence[pd.DataFrame]) -> list[str]:
    """Those that each of the tables has."""
    return [str(name) for name in tables[0] if all(name in table for table in tables)]


def _by_case(tables: Sequence[pd.DataFrame]) -> dict[tuple[str, ...], list[pd.Series]]:
    found: dict[tuple[str, ...], list[pd.Series]] = {}
    for table in tables:
        for _, row in table.iterrows():
            found.setdefault((*case_key(row), str(row.get("n", ""))), []).append(row)
    return found


def _named(rows: Rows, *, with_step: bool = True) -> str:
    """A case; with its links, of which a study of long chains has scenes of many lengths."""
    links = f" n={rows[0]['n']}" if "n" in rows[0] else ""
    return case_text(rows[0], with_step=with_step) + links


def _of_case(was: Rows, now: Rows, columns: Collection[str], clock: bool) -> Iterator[Change]:
    word = next(_words(was, now, columns), None)
    if word is not None and word.outcome != SAME:
        yield word  # its numbers follow from that
        return
    well = all(row["status"] == "ok" for row in (*was, *now))
    for measure in told_by(columns):
        if well or measure.of_method:  # how far a run strays that broke is chance
            yield from _number(measure, was, now, error_range)
    if well and DIVERGES.name in columns:
        yield from _number(DIVERGES, was, now, first_pass)
    if well and clock:
        for measure in TIMES:
            if measure.name in columns and (measure.name != "run_s" or pd.isna(was[0]["dt"])):
                yield from _time(measure, was, now)
    if word is not None:
        yield word


def _words(was: Rows, now: Rows, columns: Collection[str]) -> Iterator[Change]:
    """How the runs ended, where it is known better: by a verdict."""
    column, words = ("verdict", list(VERDICTS)) if "verdict" in columns else ("status", list(STATUSES))
    before, after = ([words.index(str(row[column])) for row in rows] for rows in (was, now))
    outcome = WORSE if min(after) > max(before) else BETTER if min(before) > max(after) else SAME
    reason = str(now[0].get("reason", "")) if outcome == WORSE else ""
    yield Change(_named(was), STABILITY, column, words[min(before)], words[min(after)], outcome, reason)


def _number(measure: Measure, was: Rows, now: Rows, range_of: Callable[[str, Rows], Range]) -> Iterator[Change]:
    before, after = (range_of(measure.name, rows) for rows in (was, now))
    if math.isnan(before.low) and math.isnan(after.low):
        return
    claimed = float(now[0].get("order_claimed", math.nan)) if measure is ORDER else math.nan
    outcome = change(measure, before, after, claimed)
    yield _change(measure, was, now, outcome)


def _time(measure: Measure, was: Rows, now: Rows) -> Iterator[Change]:
    before, after = (time_range(measure.name, rows) for rows in (was, now))
    if isinstance(before, str) or isinstance(after, str):
        why = before if isinstance(before, str) else str(after)
        if why:
            yield _change(measure, was, now, UNTOLD, why)
        return
    yield _change(measure, was, now, change(measure, before, after))


def _change(measure: Measure, was: Rows, now: Rows, outcome: str, why: str = "") -> Change:
    case = _named(was, with_step=not measure.of_method)
    before, after = (float(pd.Series([row[measure.name] for row in rows], dtype=float).median()) for rows in (was, now))
    return Change(case, measure.about, measure.name, before, after, outcome, why)


def compare_checks(before: Iterable[Finding], after: Iterable[Finding]) -> Compared:
    """Compare what two gates found. A value within its limit is what rounding and the order explain: no change."""
    was, now = (_by_check(findings) for findings in (before, after))
    both = [name for name in was if name in now]
    skipped = [name for name in both if SKIPPED in (was[name].status, now[name].status)]
    found = (each for name in both if name not in skipped for each in _of_check(name, was[name], now[name]))
    return Compared(
        tuple(found),
        tuple(name for name in was if name not in now),
        tuple(name for name in now if name not in was),
        skipped=tuple(
            f"{name}: {was[name].cause or now[name].cause}" for name in skipped if was[name].status != now[name].status
        ),
    )


def _by_check(findings: Iterable[Finding]) -> dict[str, Finding]:
    return {
        " ".join(filter(None, (each.method, each.check, each.about and f"[{each.about}]"))): each for each in findings
    }


def _of_check(name: str, was: Finding, now: Finding) -> Iterator[Change]:
    ranks = [PASSED, FAILED, ERROR]
    before, after = ranks.index(was.status), ranks.index(now.status)
    if before != after:
        outcome = WORSE if after > before else BETTER
        yield Change(name, CHECKS, "status", was.status, now.status, outcome, now.cause or was.cause)
        return
    if math.isnan(was.value) or math.isnan(now.value):
        return
    measure = Measure("value", CHECKS, grown(max(was.limit, now.limit)))
    outcome = change(measure, Range(was.value, was.value), Range(now.value, now.value))
    yield Change(name, CHECKS, f"value, {now.unit}", was.value, now.value, outcome, now.cause)
