"""The answer of a study of kind `cost` in a few sentences, made from its numbers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Final

from pendbench.report.columns import number_text, shown
from pendbench.report.cost_prices import Prices
from pendbench.report.rows import Row, is_noisy, method_name, number, of, word
from pendbench.report.text import counted, listed
from pendbench.study.results import Results

#: Where engines are compared: half-way between a plot that looks right and rounding, on a logarithmic scale.
_COMPARED_AT: Final = 1e-4

_Winners = Mapping[tuple[str, float], Row]


def answer(results: Results) -> str:
    """Who reaches which accuracy in the least time, how much more the others need, and what is out of reach."""
    prices = Prices.of_results(results)
    winners = {(scene, accuracy): row for scene in prices.scenes for accuracy in prices.accuracies
               if (row := prices.cheapest(scene, accuracy)) is not None}  # fmt: skip
    if not winners:
        return (
            f"None of the {counted(len(prices.cases), 'case')} of this study reached an accuracy that it asks for in a "
            "time that was measured. The reasons are listed under what failed."
        )
    told = [_who(prices, winners), _how(prices, winners), _others(prices, winners), _not_reached(prices)]
    told.append(_noise(prices))
    return " ".join(sentence for sentence in told if sentence)


def compared_at(prices: Prices) -> float:
    """The accuracy at which engines are compared."""
    return min(prices.accuracies, key=lambda accuracy: abs(math.log(accuracy / _COMPARED_AT)), default=math.nan)


def _who(prices: Prices, winners: _Winners) -> str:
    """Which engine is the cheapest."""
    wins = Counter(word(row, "engine") for row in winners.values())
    first, most = wins.most_common(1)[0]
    if len(prices.engines) == 1:
        return f"The only engine that took part is {first}."
    if len(wins) == 1:
        if len(winners) < len(prices.scenes) * len(prices.accuracies):
            return f"Where an error is reached at all, the cheapest engine is {first}: {_wins(first, prices, winners)}."
        span = _span(prices.accuracies)
        every = "every accuracy from " if " to " in span else ""
        return f"The cheapest engine is {first}: at {every}{span}, in {_places(prices.scenes, prices.scenes)}."
    others = [f"{engine} {_wins(engine, prices, winners)}" for engine in wins if engine != first]
    pairs = f"{most} of {len(winners)} pairs of scene and accuracy"
    return f"No engine is the cheapest everywhere: {first} is in {pairs}, {listed(others)}."


def _wins(engine: str, prices: Prices, winners: _Winners) -> str:
    """Where one engine is the cheapest: ``at 1e-2 to 1e-4 in double and triple``."""

    def scenes(accuracy: float) -> list[str]:
        return [scene for scene in prices.scenes if word(winners.get((scene, accuracy), {}), "engine") == engine]

    groups = [(places, list(own)) for places, own in groupby(prices.accuracies, key=scenes)]
    return listed([f"at {_span(own)} in {_places(places, prices.scenes)}" for places, own in groups if places])


def _how(prices: Prices, winners: _Winners) -> str:
    """Which method is the cheapest, for accuracies in a row with the same one."""
    names: dict[float, Counter[str]] = {}
    for (_, accuracy), row in winners.items():
        names.setdefault(accuracy, Counter())[f"{word(row, 'engine')} {method_name(row)}"] += 1
    found = [(accuracy, *names[accuracy].most_common(1)[0]) for accuracy in prices.accuracies if accuracy in names]
    told = []
    for name, group in groupby(found, key=lambda one: one[1]):
        own = list(group)
        total = sum(names[accuracy].total() for accuracy, _, _ in own)
        what = "scenes" if len(own) == 1 else "pairs of scene and accuracy"
        counts = f"in {sum(count for _, _, count in own)} of {total} {what}"
        told.append(f"{name} at {_span([accuracy for accuracy, _, _ in own])} ({counts})")
    return f"Cheapest method: {'; '.join(told)}."


def _others(prices: Prices, winners: _Winners) -> str:
    """How much longer the best of each other engine takes than the best of the one that is cheapest most often."""
    accuracy = compared_at(prices)
    best = {(scene, engine): row for scene in prices.scenes for engine in prices.engines
            if (row := prices.cheapest(scene, accuracy, engine)) is not None}  # fmt: skip
    here = Counter(word(row, "engine") for (_, at), row in winners.items() if at == accuracy)
    all_told = Counter(word(row, "engine") for row in winners.values())
    if not here or len(prices.engines) == 1:
        return ""
    leader = max(prices.engines, key=lambda engine: (here[engine], all_told[engine]))
    told = [_compared(engine, leader, best, prices.scenes) for engine in prices.engines if engine != leader]
    return f"To reach {shown('accuracy', accuracy)}, compared with the best of {leader}, {'; '.join(told)}."


def _compared(engine: str, leader: str, best: Mapping[tuple[str, str], Row], scenes: Sequence[str]) -> str:
    ratios = [number(best[scene, engine], "run_s") / number(best[scene, leader], "run_s")
              for scene in scenes if (scene, engine) in best and (scene, leader) in best]  # fmt: skip
    if not ratios:
        return f"{engine} cannot be: it does not get there"
    mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
    low, high = number_text(min(ratios), ".2g"), number_text(max(ratios), ".2g")
    of_what = f"geometric mean of {len(ratios)} scenes, {low} to {high}"
    if low == high:
        of_what = "in one scene" if len(ratios) == 1 else f"in each of {len(ratios)} scenes"
    bounds = sum(str(best[scene, engine].get("bound")).lower() == "true" for scene in scenes if (scene, engine) in best)
    if bounds:
        of_what += f"; in {bounds} of them its coarsest run is more accurate than that, so a coarser one might do"
    return f"the best of {engine} takes {number_text(mean, '.2g')} times as long ({of_what})"


def _not_reached(prices: Prices) -> str:
    """The largest error that each engine does not get below, with the scenes."""
    told = []
    for engine in prices.engines:
        missed: dict[float, list[str]] = {}
        for scene in prices.scenes:
            if of(prices.cases, scene=scene, engine=engine):
                out = [at for at in prices.accuracies if prices.cheapest(scene, at, engine) is None]
                if out:
                    missed.setdefault(max(out), []).append(scene)
        if missed:
            places = [f"{shown('accuracy', at)} in {listed(missed[at])}" for at in sorted(missed, reverse=True)]
            told.append(f"for {engine} {listed(places)}")
    if not told:
        return "With the steps of this study every engine reaches every accuracy in every scene."
    return f"Out of reach with the steps of this study, and so is what is finer: {'; '.join(told)}."


def _noise(prices: Prices) -> str:
    timed = [row for row in prices.cases if math.isfinite(number(row, "step_spread"))]
    if 2 * sum(map(is_noisy, timed)) <= len(timed):
        return ""
    return "Most of the timings are noisy, so these factors are rough."


def _span(accuracies: Sequence[float]) -> str:
    """``1e-2``, or ``1e-2 to 1e-10``."""
    first, last = (shown("accuracy", at) for at in (max(accuracies), min(accuracies)))
    return first if first == last else f"{first} to {last}"


def _places(scenes: Sequence[str], all_of: Sequence[str]) -> str:
    if len(scenes) == 1:
        return f"scene {scenes[0]}" if len(all_of) == 1 else scenes[0]
    if len(scenes) == len(all_of):
        return "both scenes" if len(scenes) == 2 else f"all {len(scenes)} scenes"
    return listed(scenes)
