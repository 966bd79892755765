"""The page of a study of kind `effects`, from top to bottom."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

import numpy as np

from pendbench.report import sections
from pendbench.report.columns import number_text, shown, times_text
from pendbench.report.effects_plots import balance_figure, price_figure
from pendbench.report.look import Look
from pendbench.report.plots import Picture, draw
from pendbench.report.rows import Row, case_name, distinct, is_ok, number, of, records, word
from pendbench.report.stability_map import pair_name, pairs
from pendbench.report.text import counted, listed, markdown, table
from pendbench.study.results import Results

__all__ = ["SUMMARY", "answer", "markdown_page", "pictures"]

#: The columns of the terminal's table.
SUMMARY: Final = ("scene", "engine", "method", "dt", "status", "error_max", "balance_error")

_BARE, _ALL, _DEFAULTS = "bare", "all", "bare, default flags"
_UNSMOOTH: Final = 0.5

_ERRORS: Final = """\
The largest distance of any mass from where it should be, over the chain's length, up to the reference's horizon, at the
finest step of each method; and the energy's balance: its change less the work of damping, drag and drives, integrated
along the same run. A balance near its floor is as good as can be told. The error is against the truth; the balance
needs none, so the two check each other. A method of order 1 takes angles and rates that belong half a step apart: where
a pivot shakes fast its balance is large, and falls with the step."""
_ORDERS: Final = """\
The order with which the error falls as the step does, and the order that the method claims. Quadratic drag is not
smooth where a mass stands still (its force turns about within no time), and methods of high order lose some of theirs
there. Where errors have reached rounding, or are too large to be small, there is no order to see."""
_PRICES: Final = """\
The cost of a step of one chain with one effect at a time, over that of the same chain under gravity alone, measured in
turn in one process: three rounds, and the median. 1.00 is free. An absent effect is not in the kernel that the analytic
engine runs, and not in the model that MuJoCo gets."""
_FLAGS: Final = """\
What leaving things on that the scene does not call for would cost: MuJoCo with the flags it has by itself (contacts,
constraints, springs, dampers, actuation, sensors) against the same chain with these turned off."""
_UPRIGHT: Final = """\
Upside down it stays there if its pivot shakes up and down fast enough (amplitude times frequency above the root of
2 g l), and falls if it does not: an effect that is approximated silently shows as a pendulum that does the wrong one.
"Moved by" is the farthest from where it started; the truth's is in the table of scenes."""


def answer(results: Results) -> str:
    """How accurate effects are, what they cost, and who refuses."""
    cases, prices = records(results.cases), records(results.tables.get("prices"))
    parts = []
    for name in distinct(cases, "engine"):
        fine = [
            row for row in _finest(of(cases, engine=name)) if is_ok(row) and math.isfinite(number(row, "error_max"))
        ]
        best = _best_method(fine)
        if best:
            worst = max(number(row, "error_max") for row in best)
            told = f"{pair_name(best[0])}, errors up to {shown('error_max', worst)} in {counted(len(best), 'scene')}"
            parts.append(told)
    text = [f"At the finest step of the study, the best method of each engine: {'; '.join(parts)}."] if parts else []
    for name in distinct(prices, "engine"):
        alone = [row for row in _priced(prices, name) if word(row, "effect") not in (_BARE, _ALL, _DEFAULTS)]
        if alone:
            ends = (f(alone, key=lambda row: number(row, "step_price")) for f in (min, max))
            told = " to ".join(dict.fromkeys(_told_price(row) for row in ends))
            text.append(f"An effect alone costs {name} {told} the bare chain's step.")
    refused = [row for row in cases if word(row, "status") == "refused"]
    if refused:
        refusals = [f"{name} ({_scenes_of(refused, cases, name)})" for name in pairs(refused)]
        text.append(f"Refused by {listed(refusals)}.")
    return " ".join(text) or "No case of this study ended well."


def _priced(prices: Sequence[Row], name: str) -> list[Row]:
    """An engine's prices that were measured."""
    return [row for row in of(prices, engine=name) if is_ok(row)]


def _told_price(row: Row) -> str:
    return f"{times_text(number(row, 'step_price'))} ({word(row, 'effect')}, {word(row, 'method')})"


def _scenes_of(rows: Sequence[Row], cases: Sequence[Row], name: str) -> str:
    """The scenes of a method's rows, or that they are all."""
    own = distinct([row for row in rows if pair_name(row) == name], "scene")
    return "every scene" if len(own) == len(distinct(cases, "scene")) else listed(own)


def _finest(rows: Sequence[Row]) -> list[Row]:
    """Of each scene and method, the row with the finest step."""
    found: dict[tuple[str, str, str], Row] = {}
    for row in rows:
        key = (word(row, "scene"), word(row, "engine"), word(row, "method"))
        if key not in found or number(row, "dt") < number(found[key], "dt"):
            found[key] = row
    return list(found.values())


def _best_method(rows: Sequence[Row]) -> list[Row]:
    """The rows of the method with most scenes, and of these the one with the smallest worst error."""
    groups = [of(rows, method=name) for name in distinct(rows, "method")]
    return min(groups, key=lambda own: (-len(own), max(number(row, "error_max") for row in own)), default=[])


def pictures(results: Results) -> Iterator[Picture]:
    """The prices of effects, and the balance of energy against the error."""
    prices, cases = records(results.tables.get("prices")), records(results.cases)
    prices = [row for row in prices if is_ok(row)]
    if prices:
        caption = "The cost of a step with one effect at a time, over that of the chain under gravity alone."
        yield Picture("prices", "", caption, draw(partial(price_figure, Look.of_cases(prices), prices)))
    measured = [row for row in cases if number(row, "balance_error") > 0 and number(row, "error_max") > 0]
    if measured:
        caption = "The energy's balance against the error, each mark a scene and a step. An effect that were simulated "
        caption += "with a wrong law would keep both as steps shrink."
        yield Picture("balance", "", caption, draw(partial(balance_figure, Look.of_cases(measured), measured)))


def markdown_page(results: Results, plots: Sequence[Picture]) -> str:
    """The report."""
    cases, named = records(results.cases), {plot.name: sections.picture(plot) for plot in plots}
    scenes, orders, prices, mappings = (
        records(results.tables.get(name)) for name in ("scenes", "orders", "prices", "mappings")
    )
    driven = {word(row, "scene") for row in scenes if "driven_pivot" in word(row, "effects") and number(row, "n") == 1}
    parts = [
        *sections.opening(results),
        "## The answer",
        markdown(answer(results), 4000),
        "## The scenes",
        sections.rows_table(
            scenes, ("scene", "n", "effects", "duration_s", "horizon_s", "reference_error", "moved_max_rad", "title")
        ),
        "## How each engine simulates each effect",
        sections.rows_table(mappings, ("effect", "engine", "means")),
        "## Error and energy balance",
        *(named[name] for name in ("balance",) if name in named),
        _ERRORS,
        sections.rows_table(
            _finest([row for row in cases if is_ok(row)]),
            ("scene", "engine", "method", "dt", "error_max", "balance_error", "balance_floor"),
        ),
        *_untaken(cases),
        "## Orders",
        _ORDERS,
        _by_scene(orders),
        *_upright(cases, driven),
        "## What an effect costs",
        *(named[name] for name in ("prices",) if name in named),
        _PRICES,
        _by_effect([row for row in prices if word(row, "effect") != _DEFAULTS]),
        *_spread(prices),
        *_flags(prices),
        "## What was refused, and what failed",
        sections.failures(cases, scenes),
        "## How it was measured",
        sections.definitions(str(name) for frame in (results.cases, *results.tables.values()) for name in frame),
        "## Where the numbers come from",
        sections.provenance_table(results.provenance),
        sections.files(results),
    ]
    return "\n\n".join(parts) + "\n"


def _untaken(cases: Sequence[Row]) -> Iterator[str]:
    """Why some runs that ended well have no error."""
    for row in cases:
        if is_ok(row) and word(row, "reason"):
            yield f"- {markdown(case_name(row))}: {markdown(word(row, 'reason'), 200)}"


def _by_scene(orders: Sequence[Row]) -> str:
    """A row for each scene, a column for each method: the order observed, and bold where it is below the claim."""
    names = pairs(orders)
    claims = {pair_name(row): row for row in orders}
    heads = [
        "scene",
        *(f"{markdown(name)} ({shown('order_claimed', claims[name]['order_claimed'])})" for name in names),
    ]
    lines = []
    for scene in distinct(orders, "scene"):
        own = {pair_name(row): row for row in of(orders, scene=scene)}
        lines.append([markdown(scene), *(_order(own.get(name)) for name in names)])
    return table(heads, lines, range(1, len(heads)))


def _order(row: Row | None) -> str:
    if row is None:
        return ""
    told = sections.cell(row, "order_observed")
    return f"**{told}**" if number(row, "order_observed") < number(row, "order_claimed") - _UNSMOOTH else told


def _by_effect(prices: Sequence[Row]) -> str:
    """A row for each effect, a column for each method."""
    names = pairs(prices)
    lines = []
    for effect in distinct(prices, "effect"):
        own = {pair_name(row): row for row in of(prices, effect=effect)}
        lines.append([markdown(effect), *(_price(own.get(name)) for name in names)])
    return table(["effect", *(markdown(name) for name in names)], lines, range(1, len(names) + 1))


def _price(row: Row | None) -> str:
    if row is None:
        return ""
    if word(row, "status") == "refused":
        return "refused"
    if not is_ok(row):
        return sections.status_text(row, 80)
    return f"{sections.cell(row, 'step_price')} ({sections.cell(row, 'step_us')} µs)"


def _spread(prices: Sequence[Row]) -> Iterator[str]:
    """How far the prices can be trusted."""
    measured = [row for row in prices if is_ok(row) and number(row, "step_price") > 0]
    if measured:
        shares = [number(row, "price_spread") / number(row, "step_price") for row in measured]
        least = f"{shown('price_spread', float(np.median(shares)))} of it in the median case"
        yield f"Between the rounds a price varies by {least} and {shown('price_spread', max(shares))} in the worst."


def _flags(prices: Sequence[Row]) -> Iterator[str]:
    rows = [row for row in of(prices, effect=_DEFAULTS) if is_ok(row)]
    if rows:
        yield "## What is left on"
        yield _FLAGS
        yield sections.rows_table(rows, ("engine", "method", "step_us", "step_price", "price_spread"))
        dearest = {name: max(_prices(prices, name), default=math.nan) for name in distinct(prices, "engine")}
        if math.isfinite(dearest.get("analytic", math.nan)):
            cost = number_text(dearest["analytic"], ".2f")
            every = f"all the effects of {markdown(word(prices[0], 'scene'))} in it"
            yield f"A step of the analytic engine's kernel with {every} costs up to {cost} times the bare one's."


def _prices(prices: Sequence[Row], name: str) -> list[float]:
    return [number(row, "step_price") for row in _priced(prices, name) if word(row, "effect") == _ALL]


def _upright(cases: Sequence[Row], scenes: set[str]) -> Iterator[str]:
    rows = [row for row in _finest([row for row in cases if is_ok(row)]) if word(row, "scene") in scenes]
    if rows:
        yield "## A single link on a driven pivot"
        yield _UPRIGHT
        yield sections.rows_table(rows, ("scene", "engine", "method", "dt", "moved_max_rad"))
