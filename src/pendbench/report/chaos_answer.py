"""The answer of a study of kind `chaos` in two sentences, made from its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from pendbench.report.columns import number_text
from pendbench.report.rows import Row, case_name, distinct, finite, is_noisy, number, records, spanned, word
from pendbench.report.text import counted, listed
from pendbench.study.results import Results

_TIME: Final = "t_1e-2_s"
_NOT_REACHED: Final = "t_1e-2_not_reached"


@dataclass(frozen=True)
class _Stay:
    """How long one case stays with the truth.

    share: of the horizon, 1 where it does not leave before, 0 where it failed. time: s, nan in both these cases.
    """

    scene: str
    row: Row
    share: float
    time: float
    stays: bool


@dataclass(frozen=True)
class _Candidate:
    """One engine, method and step over all the scenes that count. score: the mean share of the horizon."""

    name: str
    engine: str
    stays: list[_Stay]

    @property
    def score(self) -> float:
        """The mean share of the horizon for which it stays with the truth."""
        return sum(stay.share for stay in self.stays) / len(self.stays)

    @property
    def cost(self) -> float:
        """The largest cost, s of computing per simulated second; infinite where it was not timed."""
        speeds = finite([stay.row for stay in self.stays], "simulated_s_per_s")
        return 1.0 / min(speeds) if speeds and min(speeds) > 0 else math.inf


def answer(results: Results) -> str:
    """Who stays with the truth longest, who is best of the others, and what that costs, in two sentences."""
    cases = records(results.cases)
    scenes, kind = _scenes_that_count(results)
    candidates = _candidates(cases, scenes, _shares(results))
    ranked = sorted(candidates, key=lambda candidate: (-candidate.score, candidate.cost, candidate.name))
    if not ranked or ranked[0].score <= 0:
        return (
            f"None of the {counted(len(cases), 'case')} of this study stayed with the truth for any time that could "
            "be measured. The reasons are listed under what failed."
        )
    best = ranked[0]
    where = f"in the {kind} scene {scenes[0]}" if len(scenes) == 1 else f"in the {len(scenes)} {kind} scenes"
    equals = {one.engine: one.name for one in reversed(ranked) if one.score == best.score and one.engine != best.engine}
    shared = f" (and {listed(sorted(equals.values()))} as long)" if equals else ""
    where = f"{where[0].upper()}{where[1:]}"
    first = f"{where} {best.name} stays with the truth longest{shared}, until e = 1e-2: it {_says(best)}."
    return f"{first} {_others(ranked, best)}"


def _scenes_that_count(results: Results) -> tuple[list[str], str]:
    """The chaotic scenes with a truth, or all with one where none is chaotic, and which of the two these are."""
    known = [row for row in records(results.tables.get("scenes")) if math.isfinite(number(row, "horizon_s"))]
    chaotic = distinct([row for row in known if row.get("chaotic") is True or word(row, "chaotic") == "True"], "scene")
    if chaotic:
        return chaotic, "chaotic"
    return (distinct(known, "scene"), "regular") if known else (distinct(records(results.cases), "scene"), "study's")


def _shares(results: Results) -> dict[tuple[str, ...], float]:
    """By scene and case: the median over the starts of the time to divergence over that start's own horizon."""
    groups: dict[tuple[str, ...], list[float]] = {}
    for row in records(results.tables.get("starts")):
        horizon, time = number(row, "horizon_s"), number(row, _TIME)
        if not horizon > 0 or math.isnan(number(row, "error_max")):
            continue
        share = 1.0 if math.isnan(time) else min(1.0, time / horizon)
        groups.setdefault((word(row, "scene"), case_name(row, with_scene=False)), []).append(share)
    return {key: sorted(values)[len(values) // 2] for key, values in groups.items()}


def _candidates(cases: Sequence[Row], scenes: list[str], shares: dict[tuple[str, ...], float]) -> list[_Candidate]:
    by_name: dict[str, dict[str, Row]] = {}
    for row in cases:
        if word(row, "scene") in scenes:
            by_name.setdefault(case_name(row, with_scene=False), {})[word(row, "scene")] = row
    return [
        _Candidate(name, word(next(iter(rows.values())), "engine"),
                   [_stay(scene, rows.get(scene, {}), shares.get((scene, name))) for scene in scenes])
        for name, rows in by_name.items()
    ]  # fmt: skip


def _stay(scene: str, row: Row, share: float | None) -> _Stay:
    time, horizon = number(row, _TIME), number(row, "horizon_s")
    stays = math.isnan(time) and number(row, _NOT_REACHED) > 0
    if share is None and not math.isnan(time) and horizon > 0:
        share = min(1.0, time / horizon)
    known = stays or not math.isnan(time)
    return _Stay(scene, row, 1.0 if stays else share or 0.0 if known else 0.0, time, stays)


def _others(ranked: list[_Candidate], best: _Candidate) -> str:
    """A sentence about the best of each other engine."""
    engines = dict.fromkeys(candidate.engine for candidate in ranked if candidate.engine != best.engine)
    if not engines:
        return "No other engine took part."
    leaders = [next(candidate for candidate in ranked if candidate.engine == engine) for engine in engines]
    able = [leader for leader in leaders if leader.score > 0]
    if not able:
        return f"Of the other engines ({listed(list(engines))}) none stayed for a time that could be measured."
    told = [f"the best of the other engines is {able[0].name}, which {_says(able[0])}"]
    told += [f"the best of {leader.engine} is {leader.name}, which {_says(leader)}" for leader in able[1:]]
    failed = [leader.engine for leader in leaders if leader.score <= 0]
    if failed:
        told.append(f"{listed(failed)} did not stay for a time that could be measured")
    sentence = "; ".join(told)
    return f"{sentence[0].upper()}{sentence[1:]}."


def _says(candidate: _Candidate) -> str:
    """How long one candidate stays and what that costs, as a clause."""
    left = [stay for stay in candidate.stays if not math.isnan(stay.time)]
    stayed = [stay for stay in candidate.stays if stay.stays]
    failed = [stay for stay in candidate.stays if math.isnan(stay.time) and not stay.stays]
    clauses = []
    if left:
        times = spanned([stay.time for stay in left], _TIME)
        where = _places(left) if stayed or failed else ""
        clauses.append(f"leaves it after {times} s ({_percents([stay.share for stay in left])} of the horizon){where}")
    if stayed:
        horizon = spanned(finite([stay.row for stay in stayed], "horizon_s") or [math.nan], "horizon_s")
        where = _places(stayed) if left or failed else ""
        clauses.append(f"{'not' if left else 'does not leave it'} before the horizon ({horizon} s){where}")
    if failed:
        clauses.append(f"fails{_places(failed)}")
    return f"{listed(clauses)}, {_price(candidate)}"


def _places(stays: Sequence[_Stay]) -> str:
    """`` in double and triple``, or how many scenes where they are more."""
    return f" in {listed([stay.scene for stay in stays])}" if len(stays) <= 2 else f" in {len(stays)} scenes"


def _price(candidate: _Candidate) -> str:
    speeds = finite([stay.row for stay in candidate.stays], "simulated_s_per_s")
    costs = sorted(1e3 / speed for speed in speeds if speed > 0)
    if not costs:
        return "at a cost that was not measured"
    low, high = number_text(costs[0], ".2g"), number_text(costs[-1], ".2g")
    noise = " (noisy timings)" if any(is_noisy(stay.row) for stay in candidate.stays) else ""
    return f"for {low if low == high else f'{low} to {high}'} ms of computing per simulated second{noise}"


def _percents(shares: Sequence[float]) -> str:
    first, last = number_text(min(shares), ".0%"), number_text(max(shares), ".0%")
    return first if first == last else f"{first} to {last}"
