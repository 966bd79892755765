"""What an accuracy costs. Each follows its definition in docs/measuring.md."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray

#: A price that is known to less than this factor is worth a number.
_UNSURE: Final = 1.25


class Price(NamedTuple):
    """What an accuracy costs: run_s of stepping with this step (or tolerance), nan where it was not reached.

    best: the smallest error there was. bound: whether already the coarsest step was that good, so that the price is an
    upper bound.
    """

    run_s: float
    step: float
    best: float
    bound: bool


def price_of(accuracy: float, step: FloatArray, error: FloatArray, run_s: FloatArray) -> Price:
    """The price of `accuracy` from points (j,) measured at different steps; nan among the errors: a run that failed.

    Between two neighbouring steps of which the coarser misses the accuracy and the finer has it, by interpolation of
    logarithms; never beyond what was measured. Which step that is does not depend on the clock.
    """
    by_step = np.argsort(step)[::-1]
    h, e, cost = step[by_step], error[by_step], run_s[by_step]
    finite = np.isfinite(e)
    best = float(e[finite].min()) if finite.any() else math.nan
    good = np.flatnonzero(e <= accuracy)
    if not good.size:
        return Price(math.nan, math.nan, best, bound=False)
    i = int(good[0])
    if i == 0 or not np.isfinite(e[i - 1]) or e[i] <= 0:
        return Price(float(cost[i]), float(h[i]), best, bound=i == 0)
    share = math.log(accuracy / e[i - 1]) / math.log(e[i] / e[i - 1])
    between = [math.exp(math.log(v[i - 1]) + share * math.log(v[i] / v[i - 1])) for v in (cost, h)]
    return Price(between[0], between[1], best, bound=False)


def price_of_digit(error: FloatArray, run_s: FloatArray, floor: float, ceiling: float) -> float:
    """By what factor the cost grows for one more digit: a line through log run_s against log error, between the two.

    nan where there are fewer than three such points, where no cost brings the error down, and where the points leave
    the factor unsure by more than a quarter: two standard errors of the line's slope.
    """
    usable = np.isfinite(error) & (error > floor) & (error < ceiling)
    digits, cost = -np.log10(error[usable]), np.log10(run_s[usable])
    if len(digits) < 3 or np.ptp(digits) < math.log10(2):
        return math.nan
    slope, height = np.polyfit(digits, cost, 1)
    left = cost - (slope * digits + height)
    unsure = math.sqrt(float(left @ left) / (len(digits) - 2) / float(np.sum((digits - digits.mean()) ** 2)))
    return float(10.0**slope) if slope > 0 and 2 * unsure <= math.log10(_UNSURE) else math.nan
