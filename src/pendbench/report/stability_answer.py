"""The answer of a study of kind `stability`, from its own numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from pendbench.report.columns import number_text, shown, times_text
from pendbench.report.rows import Row, distinct, number, of, records, word
from pendbench.report.stability_map import is_true, pair_name, pairs
from pendbench.report.text import counted, listed
from pendbench.study.results import Results

#: The step of a display at 240 pictures a second, s: what games and robots run at.
FRAME: Final = 1 / 240


def answer(results: Results) -> str:
    """Who holds everything; what each engine holds with a fixed step; and how much larger the best one's steps are."""
    steps, cases = records(results.tables.get("stable_steps")), records(results.cases)
    scenes = distinct(steps, "scene")
    plain = [row for row in steps if not is_true(row, "substeps")]
    parts = [_adaptive(steps, scenes), *(_fixed(of(plain, engine=name), name) for name in distinct(plain, "engine"))]
    parts += [_steps(plain), _frame(cases)]
    return " ".join(part for part in parts if part)


def held(rows: Sequence[Row]) -> list[Row]:
    """The rows that some step holds."""
    return [row for row in rows if word(row, "best_verdict") == "holds"]


def is_adaptive(row: Row) -> bool:
    """Whether a method chooses its own steps."""
    return is_true(row, "adaptive")


def _adaptive(steps: Sequence[Row], scenes: Sequence[str]) -> str:
    told = []
    for name in pairs([row for row in steps if is_adaptive(row)]):
        own = [row for row in steps if pair_name(row) == name]
        lost = [word(row, "scene") for row in own if row not in held(own)]
        told.append(f"{name} holds {'all' if not lost else f'all but {listed(lost)}'}")
    if not told:
        return ""
    return f"Of {counted(len(scenes), 'hard scene')}, methods that choose their own steps: {'; '.join(told)}."


def _fixed(rows: Sequence[Row], engine: str) -> str:
    """An engine's best method with a fixed step, and what it never holds."""
    fixed = [row for row in rows if not is_adaptive(row)]
    if not fixed:
        return ""
    counts = {name: len(held([row for row in fixed if pair_name(row) == name])) for name in pairs(fixed)}
    best = max(counts, key=lambda name: counts[name])
    own = [row for row in fixed if pair_name(row) == best]
    never = [row for row in own if word(row, "best_verdict") not in ("holds", "refused") and not _is_open(row)]
    unsettled = [word(row, "scene") for row in own if _is_open(row)]
    refused = [word(row, "scene") for row in own if word(row, "best_verdict") == "refused"]
    text = f"With a fixed step, {best} is the best of {engine}: some step holds {counts[best]} of {len(own)}"
    if never:
        text += f"; none holds {listed([word(row, 'scene') for row in never])}"
    if unsettled:
        text += f"; not settled, since finer steps took too long, are {listed(unsettled)}"
    if refused:
        text += f"; it refuses {listed(refused)}"
    return f"{text}."


def _is_open(row: Row) -> bool:
    return is_true(row, "unsettled")


def _steps(steps: Sequence[Row]) -> str:
    """How much larger the steps that hold may be with one engine's best method than with the others' best."""
    best: dict[str, dict[str, float]] = {}
    for row in steps:
        dt = number(row, "stable_dt")
        if not math.isnan(dt):
            its = best.setdefault(word(row, "engine"), {})
            its[word(row, "scene")] = max(its.get(word(row, "scene"), 0.0), dt)
    if len(best) < 2:
        return ""
    leader = max(best, key=lambda name: (len(best[name]), sum(map(math.log, best[name].values()))))
    told = []
    for name, own in best.items():
        ratios = sorted(best[leader][scene] / dt for scene, dt in own.items() if scene in best[leader])
        if name != leader and ratios:
            middle = times_text(ratios[len(ratios) // 2])
            told.append(f"{middle} those of {name} ({times_text(ratios[0])} to {times_text(ratios[-1])})")
    return f"The largest steps that hold with {leader} are, in the median scene, {listed(told)}." if told else ""


def _frame(cases: Sequence[Row]) -> str:
    """What holds at the step of a display."""
    near = [row for row in cases if abs(number(row, "dt") - FRAME) < 1e-6]
    if not near:
        return ""
    scenes = distinct(near, "scene")
    counts = {
        name: sum(word(row, "verdict") == "holds" for row in near if pair_name(row) == name) for name in pairs(near)
    }
    ranked = sorted(counts, key=lambda name: -counts[name])
    told = [f"{name} {counts[name]}" for name in ranked]
    return f"At {number_text(FRAME, '.3g')} s, 1/240 of a second, of {len(scenes)} scenes hold: {listed(told)}."


def exponents(growth: Sequence[Row]) -> str:
    """How the largest stable step falls with n, in a sentence."""
    known = [row for row in growth if not math.isnan(number(row, "stable_dt_exponent"))]
    if not known:
        return "Too few lengths were held to see how the step falls with n."
    told = [f"{pair_name(row)} {shown('stable_dt_exponent', row['stable_dt_exponent'])}" for row in known]
    return (
        f"The largest stable step grows like n to the power of: {listed(told)}. The stiffest oscillation of n links in "
        "one metre grows like n, so a method that is limited by stiffness alone has -1."
    )
