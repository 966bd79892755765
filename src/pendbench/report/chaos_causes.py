"""What the three causes say about each engine, in sentences made from the numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Final

from pendbench.report.columns import number_text, shown
from pendbench.report.rows import Row, distinct, finite, method_name, number, of, spanned, stays_until, word
from pendbench.report.text import listed

#: Errors that agree to this share of themselves, at every step and in every scene, come from the same method.
_SAME: Final = 1e-3
_ROUNDING: Final = 1e-6  # smaller errors hold a share of rounding, amplified by chaos, that matters at `_SAME`
_NEAR: Final = 1.5  # how near a fitted rate is to be: rates over a few Lyapunov times are rough
_LONG: Final = 5.0  # Lyapunov times for which an error must have grown before its rate speaks of chaos


def engine_sentences(causes: Sequence[Row], cases: Sequence[Row]) -> Iterator[str]:
    """One paragraph for each engine: which system it simulates, with which orders, and what its errors are."""
    for engine in distinct(cases, "engine"):
        own = of(causes, engine=engine)
        yield " ".join([_model(engine, own), *_orders(own), *_plateaus(own)])


def _model(engine: str, causes: Sequence[Row]) -> str:
    known = [row for row in causes if not math.isnan(number(row, "model_error"))]
    other = [row for row in known if word(row, "cause").startswith("model")]
    same = [row for row in known if row not in other]
    if not known:
        return f"{engine}: which system it simulates is not known; nothing of it could be measured."
    parts = []
    if other:
        errors = spanned([number(row, "model_error") for row in other], "model_error")
        places = listed(sorted({f"{method_name(row)} in {word(row, 'scene')}" for row in other})[:6])
        parts.append(f"{engine} simulates another system with {places}: its accelerations differ by {errors}.")
    if same:
        error = shown("model_error", max(number(row, "model_error") for row in same))
        begin = f"{engine} simulates the same system" if not other else "Elsewhere it simulates the same system"
        parts.append(f"{begin}: its accelerations agree with the equations to {error} of the largest.")
    return " ".join(parts)


def _orders(causes: Sequence[Row]) -> Iterator[str]:
    """The orders of its methods as a sentence."""
    told = []
    for method in distinct(causes, "method"):
        own = of(causes, method=method)
        orders, claimed = finite(own, "order_observed"), finite(own, "order_claimed")
        if orders:
            told.append(f"{method} {spanned(orders, 'order_observed')} ({number_text(claimed[0], 'd')} claimed)"
                        if claimed else f"{method} {spanned(orders, 'order_observed')}")  # fmt: skip
    if told:
        yield f"Orders seen: {', '.join(told)}."


def _plateaus(causes: Sequence[Row]) -> Iterator[str]:
    for row in causes:
        if math.isfinite(number(row, "plateau")):
            level = shown("plateau", number(row, "plateau"))
            yield f"With {method_name(row)} in {word(row, 'scene')} smaller steps do not bring its error below {level}."


def growth_sentences(scenes: Sequence[Row], cases: Sequence[Row]) -> Iterator[str]:
    """What the growth of errors says about each scene: chaos, or regular motion."""
    for scene in scenes:
        yield f"{word(scene, 'scene')}: {_growth(scene, of(cases, scene=word(scene, 'scene')))}"


def _growth(scene: Row, cases: Sequence[Row]) -> str:
    if not is_chaotic(scene):
        return "the motion is regular, so no error grows exponentially for long."
    exponent, neighbour = number(scene, "lyapunov_per_s"), number(scene, "growth_per_s")
    measure = exponent if math.isnan(neighbour) else neighbour
    told = (
        f"the exponent is {number_text(exponent)} per s"
        if math.isnan(neighbour)
        else f"a neighbouring start leaves the truth at {number_text(neighbour)} per s"
    )
    rates = finite((row for row in cases if _stayed(row, exponent) >= _LONG), "growth_per_s")
    if not rates:
        return f"{told}; no error grew for long enough to be compared with that."
    ratios = [rate / measure for rate in rates]
    near = sum(1 / _NEAR <= ratio <= _NEAR for ratio in ratios)
    return (
        f"{told}, and in the cases that stay with the truth for {_LONG:.0f} Lyapunov times or more errors grow at "
        f"{_span(ratios)} times that rate: {near} of {len(ratios)} are within a factor of {_NEAR:g} of what chaos does."
    )


def _span(ratios: Sequence[float]) -> str:
    low, high = number_text(min(ratios)), number_text(max(ratios))
    return low if low == high else f"{low} to {high}"


def _stayed(row: Row, exponent: float) -> float:
    """For how many Lyapunov times a case stays with the truth."""
    time = stays_until(row)
    return time * exponent if math.isfinite(time) else 0.0


def is_chaotic(scene: Row) -> bool:
    """Whether a row of the scenes' table is of a chaotic scene."""
    return str(scene.get("chaotic")).lower() == "true"


def twins(cases: Sequence[Row]) -> list[list[str]]:
    """Groups of methods, of whatever engines, whose errors are the same wherever they can be compared.

    Different programs that agree on their errors run the same method on the same system; what is left between them is
    speed.
    """
    errors: dict[str, dict[tuple[str, float], float]] = {}
    for row in cases:
        error, dt = number(row, "error_half"), number(row, "dt")
        if error > _ROUNDING and math.isfinite(error) and math.isfinite(dt) and word(row, "status") == "ok":
            errors.setdefault(f"{word(row, 'engine')} {method_name(row)}", {})[word(row, "scene"), dt] = error
    groups = [{name} for name in errors]
    for one, other in combinations(errors, 2):
        if _alike(errors[one], errors[other]):
            joined = [group for group in groups if group & {one, other}]
            groups = [group for group in groups if group not in joined] + [set().union(*joined)]
    return sorted(sorted(group) for group in groups if len(group) > 1)


def _alike(one: dict[tuple[str, float], float], other: dict[tuple[str, float], float]) -> bool:
    common = one.keys() & other.keys()
    return len(common) >= 3 and all(math.isclose(one[key], other[key], rel_tol=_SAME) for key in common)
