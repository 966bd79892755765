"""Every column that a study can have, declared once: its unit, how people read it, what it means.

CSV files, Markdown tables, the terminal and the list of definitions follow these declarations, and numbers become text
nowhere else. A new measurement gets its line in `COLUMNS`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pandas as pd

#: What people read where there is nothing to be read.
NOTHING: Final = "\u2013"


@dataclass(frozen=True)
class Column:
    """unit: empty for text. format: how people read a number: "" text, "d" whole, ".3g" digits, ".1e", ".0%".

    heading: for tables. meaning: one sentence. is_time: whether it depends on the clock and so differs from run to run,
    on the same machine; all the others can be reproduced. empty: what people read where there is no number.
    """

    unit: str
    format: str
    heading: str
    meaning: str
    is_time: bool = False
    empty: str = NOTHING


def _text(heading: str, meaning: str, *, is_time: bool = False) -> Column:
    return Column("", "", heading, meaning, is_time, "")


def _threshold(name: str) -> dict[str, Column]:
    passes = "e(t) passes the threshold in the column's name"
    return {
        f"t_{name}_s": Column(
            "s",
            ".3g",
            f"to {name}, s",
            f"the first time at which {passes}: the median over the starts (in starts.csv: of one start); empty where "
            "the median start does not get there before its horizon",
        ),
        f"t_{name}_min_s": Column("s", ".3g", "earliest", f"the earliest start's time until {passes}"),
        f"t_{name}_max_s": Column(
            "s",
            ".3g",
            "latest",
            f"the latest start's time until {passes}; empty where a start does not get there before its horizon",
        ),
        f"t_{name}_lyapunov": Column(
            "Lyapunov times",
            ".3g",
            "Lyapunov times",
            "the median time, s, times the scene's Lyapunov exponent; empty where the motion is regular",
        ),
        f"t_{name}_not_reached": Column(
            "1", "d", "not reached", "how many starts do not get there before their horizon"
        ),
        f"t_{name}_band_s": Column(
            "s", ".1e", "band", "the widest gap between the two samples around one of these times: how well it is known"
        ),
    }


_WHAT: Final = {
    "scene": _text("scene", "the scene's name"),
    "n": Column("1", "d", "n", "links of the chain"),
    "accuracy": Column("L", ".0e", "error up to", "the error that is allowed: the largest e(t) up to compare_s"),
    "start": Column("1", "d", "start", "0: the scene's own start; the others are perturbed"),
    "engine": _text("engine", "the program that simulated"),
    "method": _text("method", "one way in which the engine advances time"),
    "dt": Column(
        "s",
        ".3g",
        "step, s",
        "the step; empty for a method that chooses its own (in prices.csv: interpolated, empty where not reached)",
        empty="its own",
    ),
    "tolerance": Column(
        "1",
        ".1e",
        "tolerance",
        "the tolerance of a method that chooses its steps (in prices.csv: interpolated, empty where not reached)",
    ),
    "settings": _text("settings", "settings of the method that differ from its defaults"),
    "status": _text("status", "how the case ended: as the worst of its starts did"),
    "reason": _text("reason", "why, where it did not end well"),
}

_TRUTH: Final = {
    "duration_s": Column("s", ".3g", "duration, s", "how long the scene lasts"),
    "starts": Column("1", "d", "starts", "starts that were run: the scene's own and the perturbed ones"),
    "compare_s": Column("s", ".4g", "compared up to, s", "until when errors are compared and costs are counted"),
    "samples": Column("1", "d", "samples", "evenly spaced times at which errors are compared"),
    "horizon_s": Column("s", ".3g", "horizon, s", "until when the reference is known; nothing is compared past it"),
    "horizon_min_s": Column("s", ".3g", "earliest horizon, s", "the earliest horizon of the starts"),
    "horizon_max_s": Column("s", ".3g", "latest horizon, s", "the latest horizon of the starts"),
    "reference_error": Column(
        "L", ".1e", "reference error", "the largest e between the reference's two solves up to the horizon"
    ),
    "lyapunov_per_s": Column(
        "1/s",
        ".3g",
        "Lyapunov exponent, 1/s",
        "the rate at which neighbouring starts of the scene part; in causes.csv empty where the motion is regular",
    ),
    "lyapunov_error_per_s": Column(
        "1/s", ".1g", "its error, 1/s", "the standard error of the exponent, over blocks of time"
    ),
    "chaotic": _text("chaotic", "whether the exponent can be told from regular motion"),
}

_ERRORS: Final = {
    "t_s": Column("s", ".4g", "t, s", "time"),
    "error": Column(
        "L", ".1e", "e", "the largest distance of any mass from where it should be; empty past the horizon"
    ),
    "energy_error": Column("energy scale", ".1e", "energy error", "deviation of the energy from its first value"),
    "error_max": Column(
        "L", ".1e", "e max", "the largest e(t) up to the horizon (or compare_s), or to where the run ended"
    ),
    "error_half": Column("L", ".1e", "e to half horizon", "the largest e(t) up to half of the horizon"),
    "angle_error_max_rad": Column(
        "rad", ".1e", "angle error", "the largest error of any angle, wrapped, up to the horizon (or compare_s)"
    ),
    "reference_error_half": Column(
        "L", ".1e", "reference error to half", "the reference's own e up to half of the horizon"
    ),
    "best_error": Column("L", ".1e", "best e", "the smallest error max of all steps or tolerances of a method"),
}

_ENERGY: Final = {
    "energy_drift_max": Column(
        "energy scale",
        ".1e",
        "energy drift",
        "the largest deviation of the energy from its first value at any sample of the whole run",
    ),
    "energy_drift_final": Column("energy scale", ".1e", "final drift", "the energy's deviation at the run's end"),
    "energy_drift_band": Column("energy scale", ".1e", "band", "the energy's largest value less its smallest one"),
    "energy_drift_slope_per_s": Column(
        "energy scale/s",
        ".1e",
        "drift per s",
        "the slope of a least-squares line through the energy: near zero for a method that keeps it in a band",
    ),
    "energy_slope_share": Column(
        "1", ".2g", "slope's share", "what the slope alone moves the energy by over the whole run, over the band"
    ),
    "energy_band_first_tenth": Column(
        "energy scale", ".1e", "band, first tenth", "the energy's band over the first tenth of the run"
    ),
    "energy_band_last_tenth": Column(
        "energy scale", ".1e", "band, last tenth", "the energy's band over the last tenth of the run"
    ),
    "energy_drift_half": Column(
        "energy scale", ".1e", "drift to half", "the largest deviation of the energy up to half of the horizon"
    ),
    "gap_max": Column(
        "1",
        ".1e",
        "joint gap",
        "how far the worst rod was from its length, over that length; 0 for engines that work in angles",
    ),
}

_CAUSES: Final = {
    "model_error": Column(
        "1",
        ".1e",
        "model error",
        "how far the engine's accelerations are from the equations', over the largest acceleration",
    ),
    "model_error_limit": Column(
        "1",
        ".1e",
        "last change",
        "what the last refinement changed in the model error: how well it is known, give or take a factor of some tens",
    ),
    "order_claimed": Column("1", "d", "order claimed", "the method's order by its makers", empty="adaptive"),
    "order_observed": Column("1", ".2f", "order observed", "the order with which the error falls between two steps"),
    "order_dt_coarse": Column("s", ".3g", "from step, s", "the coarser of the two steps that show the order"),
    "order_dt_fine": Column("s", ".3g", "to step, s", "the finer of the two steps that show the order"),
    "plateau": Column("L", ".1e", "plateau", "the error below which smaller steps do not bring it", empty="none"),
    "growth_per_s": Column(
        "1/s",
        ".3g",
        "growth, 1/s",
        "the rate of the exponential through e(t) between 1e-12 and 1e-2 (in causes.csv: the median over starts and "
        "steps; in scenes.csv: of a neighbouring start)",
    ),
    "neighbours_growth_per_s": Column(
        "1/s",
        ".3g",
        "a neighbour's growth, 1/s",
        "the rate at which a start 1e-10 rad away leaves the truth: what chaos does here to any small error",
    ),
    "cause": _text("cause", "what makes this method leave the truth"),
}

_STABILITY: Final = {
    "title": _text("title", "what the scene is, in its own words"),
    "verdict": _text("verdict", "whether the run was stable"),
    "best_verdict": _text("best verdict", "the verdict with the best step of all that were tried"),
    "broke_s": Column("s", ".3g", "broke at, s", "when the energy was first astray by more than its scale"),
    "stays_s": Column(
        "s",
        ".3g",
        "stays for, s",
        "for a chain released at rest where nothing pulls it: when it had first moved by 0.1 rad, or how long it was "
        "run where it never had",
    ),
    "stable_dt": Column(
        "s", ".2g", "largest stable step, s", "the largest step that holds, of those tried: known to a tenth"
    ),
    "unbroken_dt": Column(
        "s",
        ".2g",
        "largest unbroken step, s",
        "the largest step, of those tried, that holds or drifts, but does not break",
    ),
    "unsettled": _text("unsettled", "whether no step holds, but finer ones took too long to tell"),
    "substeps": _text("substeps", "whether the method divides its step as it sees fit"),
    "stable_dt_ratio": Column(
        "1", ".2g", "of the best", "the largest stable step over that of the scene's best method"
    ),
    "stable_dt_stiffest": Column(
        "rad",
        ".2g",
        "step times frequency",
        "the largest stable step times stiffest_rad_per_s: near a method's stability limit (2.8 for RK4, 2 for "
        "semi-implicit Euler and RATTLE) where stiffness is what limits the step",
    ),
    "stable_dt_exponent": Column(
        "1", ".2f", "exponent", "p in: largest stable step ~ n^p, by least squares over scenes that differ in n alone"
    ),
    "n_from": Column("1", "d", "from n", "the fewest links that the exponent is fitted to"),
    "n_to": Column("1", "d", "to n", "the most links that the exponent is fitted to"),
    "scenes_held": Column("1", "d", "scenes held", "of these scenes, those that some step holds"),
    "scenes": Column("1", "d", "scenes", "how many scenes these are"),
    "adaptive": _text("adaptive", "whether the method chooses its own steps"),
    "stiffest_rad_per_s": Column(
        "rad/s", ".3g", "stiffest, rad/s", "the fastest small oscillation about the hanging chain"
    ),
    "fastest_rad_per_s": Column("rad/s", ".3g", "fastest at the start, rad/s", "the largest angular rate at the start"),
}

_COSTS: Final = {
    "steps": Column("1", "d", "steps", "steps that the run took"),
    "step_us": Column("us", ".3g", "step, µs", "the median cost of a step", is_time=True),
    "step_and_state_us": Column(
        "us",
        ".3g",
        "step and state, µs",
        "a step and a look at the state from Python; for a method that chooses its steps: advancing by compare_s / "
        "samples and a look",
        is_time=True,
    ),
    "step_spread": Column(
        "1", ".0%", "spread", "largest less smallest sample of the step's cost, over the median", is_time=True
    ),
    "simulated_s_per_s": Column("s/s", ".3g", "simulated s/s", "simulated time per time spent stepping", is_time=True),
    "build_s": Column("s", ".2g", "build, s", "building the run", is_time=True),
    "first_call_s": Column(
        "s", ".2g", "first call, s", "the first step of all, with what is compiled or loaded then", is_time=True
    ),
    "run_s": Column("s", ".3g", "run, s", "time spent stepping up to the horizon (or compare_s)", is_time=True),
    "with_states_s": Column(
        "s",
        ".3g",
        "with states, s",
        "the same for a caller who looks at the state after every step (at the samples, of a method that chooses its "
        "steps)",
        is_time=True,
    ),
    "digit_price": Column(
        "1", ".3g", "one more digit", "by what factor the cost grows where the error is to fall tenfold", is_time=True
    ),
    "bound": _text("bound", "whether the coarsest step that ran is as accurate already: the time is an upper bound"),
    "flags": _text("flags", "what a reader should know about the row, its timing included", is_time=True),
}

_SCALING: Final = {
    "step_per_link_ns": Column("ns", ".3g", "step per link, ns", "the cost of a step over n", is_time=True),
    "step_exponent": Column("1", ".2f", "exponent", "p in: cost of a step ~ n^p", is_time=True),
    "memory_mb": Column(
        "MB", ".3g", "memory, MB", "by how much the process grew while it had the chain and took a step", is_time=True
    ),
    "longest_n": Column(
        "1", "d", "longest chain", "the most links that run in real time with an energy error below 1 %", is_time=True
    ),
    "race_spent_s": Column("s", ".3g", "spent, s", "time spent stepping", is_time=True),
    "reached_s": Column("s", ".3g", "reached, s", "how far the motion was followed", is_time=True),
    "next_n": Column("1", "d", "next chain", "the shortest chain beyond the longest that was tried", is_time=True),
    "outcome": _text("outcome", "held, lost (energy or rods), too slow for real time, or a status", is_time=True),
}

_EFFECTS: Final = {
    "effects": _text("effects", "what acts on the scene's chain"),
    "effect": _text("effect", "the effect; in prices.csv what acts besides gravity"),
    "means": _text("means", "by what means the engine simulates the effect, or why it refuses to"),
    "balance_error": Column(
        "1",
        ".1e",
        "energy balance",
        "the largest difference between the energy's change and the work of the effects without a potential, over the "
        "scene's energy (or the largest change, where that is larger)",
    ),
    "balance_floor": Column(
        "1", ".0e", "its floor", "how well the work is known from the samples: a balance below this is not told from 0"
    ),
    "moved_max_rad": Column("rad", ".3g", "moved by, rad", "the farthest that any angle gets from where it started"),
    "step_price": Column(
        "1", ".2f", "price", "the cost of a step over that of the bare chain, under gravity alone", is_time=True
    ),
    "price_spread": Column(
        "1", ".2f", "its spread", "largest less smallest of three measurements of the price in turn", is_time=True
    ),
}

_ENSEMBLE: Final = {
    "chains": Column("1", "d", "chains", "how many chains were run"),
    "pixels": Column("1", "d", "pixels", "how many pixels of the map are compared (in maps.csv: it has)"),
    "pixels_failed": Column("1", "d", "failed", "pixels whose flip time is not known, for a run failed"),
    "pixels_at_edge": Column(
        "1",
        "d",
        "at the edge",
        "those of them at the map's edge, where a neighbour's flip time differs by more than is allowed",
    ),
    "changed": Column(
        "1",
        "d",
        "different",
        "pixels whose flip time differs by more than is allowed from that of the finest tolerance",
    ),
    "changed_away": Column("1", "d", "away from the edge", "those of the different pixels away from the map's edge"),
    "changed_from_map": Column(
        "1", "d", "not as the map", "pixels whose flip time differs from the map's, which has errors of its own"
    ),
    "largest_away_s": Column(
        "s", ".1e", "largest away, s", "the largest difference of flip times at pixels away from the map's edge"
    ),
    "chain_us": Column("us", ".3g", "chain, µs", "run_s over chains: what a chain costs one thread", is_time=True),
    "theta1_rad": Column("rad", ".4g", "θ1, rad", "the first angle at release"),
    "theta2_rad": Column("rad", ".4g", "θ2, rad", "the second angle at release"),
    "flip_s": Column("s", ".4g", "flips at, s", "when a rod first goes over the top; infinite where none does"),
    "expected_flip_s": Column(
        "s", ".4g", "expected, s", "the flip time that it is compared with: that of the finest tolerance"
    ),
    "is_at_edge": _text("at the edge", "whether the pixel is at the map's edge"),
    "is_changed": _text("different", "whether the flip time differs from the expected one by more than is allowed"),
    "never_share": Column("1", ".1%", "never", "the share of the map's chains that do not flip within the duration"),
    "barred_share": Column("1", ".1%", "cannot", "the share with less energy than the lowest state with a rod upright"),
    "barred_flips": Column("1", "d", "yet do", "how many of these flip all the same"),
    "mirror_largest_s": Column(
        "s", ".1e", "mirror, s", "the largest difference between the map and that of the mirrored chains"
    ),
    "energy_from": Column("1", ".2g", "energy from", "the lowest energy share of these starts"),
    "energy_to": Column("1", ".2g", "to", "the energy share that they do not reach"),
    "energy_share": Column("1", ".3g", "energy", "the energy at release: 0 for the hanging chain, 1 for the upright"),
    "exponent_first_quartile_per_s": Column(
        "1/s", ".3g", "exponent, first quartile, 1/s", "a quarter of these starts has a smaller Lyapunov exponent"
    ),
    "exponent_median_per_s": Column("1/s", ".3g", "median, 1/s", "half of these starts have a smaller one"),
    "exponent_third_quartile_per_s": Column(
        "1/s", ".3g", "third quartile, 1/s", "three quarters of these starts have a smaller one"
    ),
    "regular_share": Column("1", ".0%", "regular", "the share of these starts whose motion is regular"),
    "is_regular": _text("regular", "whether the exponent cannot be told from regular motion"),
}

#: Every column by its name in the CSV files, in the order in which they are written.
COLUMNS: Final = MappingProxyType(
    {
        **_WHAT,
        **_TRUTH,
        **_ERRORS,
        **_threshold("1e-3"),
        **_threshold("1e-2"),
        **_threshold("1e-1"),
        **_ENERGY,
        **_CAUSES,
        **_STABILITY,
        **_COSTS,
        **_SCALING,
        **_EFFECTS,
        **_ENSEMBLE,
    }
)

_UNKNOWN: Final = Column("", ".4g", "", "")


def column(name: str) -> Column:
    """The declaration of a column; one that nobody declared is shown with four digits."""
    return COLUMNS.get(name, _UNKNOWN)


def in_order(names: Iterable[str]) -> list[str]:
    """The names as declared, and those that nobody declared last."""
    places = {name: place for place, name in enumerate(COLUMNS)}
    return sorted(names, key=lambda name: places.get(name, len(places)))


def is_missing(value: Any) -> bool:
    """Whether there is no value: None, not a number, or empty text."""
    if isinstance(value, (float, np.floating)):
        return math.isnan(value)
    return value is None or value is pd.NA or (isinstance(value, str) and not value)


def shown(name: str, value: Any) -> str:
    """A value of a column for people. Text comes back as it is: whoever writes it escapes it."""
    if is_missing(value):
        return column(name).empty
    return value if isinstance(value, str) else number_text(value, column(name).format or ".4g")


def number_text(value: Any, spec: str = ".3g") -> str:
    """A number for people: three digits rather than an exponent where it is of everyday size."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    number = float(value)
    if math.isnan(number):
        return NOTHING
    if math.isinf(number):
        return "infinite" if number > 0 else "-infinite"
    if number == 0:
        return "0"
    if spec == "d":
        return f"{number:.0f}"
    if spec.endswith("e") and 0.1 <= abs(number) < 1000:
        spec = ".2g"
    text = f"{number:{spec}}"
    if spec.endswith("g"):
        text = f"{float(text):.6g}"
    return re.sub(r"e([+-])0*(\d)", lambda m: f"e{m[1].strip('+')}{m[2]}", text)


def duration_text(seconds: float) -> str:
    """A time for people, to the two digits that a timing is worth, in the unit of its size: ``38 µs``, ``2.3 ms``."""
    for unit, size in (("µs", 1e-6), ("ms", 1e-3)):
        if seconds < 995 * size:  # what reads as 1000 is one of the next unit
            return f"{number_text(seconds / size, '.2g')} {unit}"
    return f"{number_text(seconds, '.2g')} s" if math.isfinite(seconds) else NOTHING


def times_text(ratio: float) -> str:
    """How many times as much, to two digits, with its sign."""
    return f"{number_text(ratio, '.2g')}\u00d7"


def stored(name: str, value: Any) -> str | int | float:
    """A value of a column for a CSV file: numbers to the last digit, nothing where there is none, text as it is."""
    if is_missing(value):
        return ""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        number = float(value)
        # A column of whole numbers becomes one of floats where a table lacks some of them.
        return int(number) if column(name).format == "d" and number.is_integer() else repr(number)
    return str(value)
