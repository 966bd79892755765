"""What is measured, as pure functions of arrays. Each follows its definition in docs/measuring.md."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from pendbench.arrays import FloatArray


class Crossing(NamedTuple):
    """When an error passed a threshold, s: between the samples at `low` and `high`, by interpolation at `time`."""

    time: float
    low: float
    high: float


class Drift(NamedTuple):
    """How an energy strays, in units of the energy scale: largest and last deviation from the first value, the band
    (peak to peak) and the slope of a least-squares line, per second.
    """

    largest: float
    final: float
    band: float
    slope: float


class OrderFit(NamedTuple):
    """The order seen between the steps `coarse` and `fine` (s), and the error at which it stops, or None.

    Where a plateau is all there is to see, the order is nan and the steps are the two finest.
    """

    order: float
    coarse: float
    fine: float
    plateau: float | None


def time_to(t: FloatArray, error: FloatArray, threshold: float) -> Crossing | None:
    """The first time at which error (k,) at times t (k,) passes `threshold`; None where it does not."""
    above = np.flatnonzero(~(error <= threshold))
    if not above.size:
        return None
    i = int(above[0])
    if i == 0:
        return Crossing(float(t[0]), float(t[0]), float(t[0]))
    before, after = error[i - 1], error[i]
    share = 1.0
    if np.isfinite(after) and before > 0:
        share = float(np.log(threshold / before) / np.log(after / before))
    return Crossing(float(t[i - 1] + share * (t[i] - t[i - 1])), float(t[i - 1]), float(t[i]))


def drift(t: FloatArray, energy: FloatArray, scale: float) -> Drift:
    """How energy (k,) J at times t (k,) s strays from its first value, over `scale` (J)."""
    if not scale > 0 or not len(t):
        return Drift(math.nan, math.nan, math.nan, math.nan)
    with np.errstate(all="ignore"):
        relative = (energy - energy[0]) / scale
    final = float(relative[-1])
    if not np.all(np.isfinite(relative)):  # it blew up: no line goes through that
        return Drift(math.inf, final, math.inf, math.nan)
    slope = float(np.polyfit(t, relative, 1)[0]) if len(t) > 1 else math.nan
    return Drift(float(np.abs(relative).max()), final, float(np.ptp(relative)), slope)


def growth_rate(t: FloatArray, error: FloatArray, low: float, high: float) -> float:
    """The rate, 1/s, of a least-squares exponential through error (k,) while it lies between `low` and `high`.

    The stretch ends where the error first passes `high` and begins after it was last below `low`. nan where the error
    does not grow by a factor of 10 in it, or in fewer than 8 samples.
    """
    above = np.flatnonzero(error > high)
    end = int(above[0]) if above.size else len(error)
    below = np.flatnonzero(~(error[:end] >= low))
    begin = int(below[-1]) + 1 if below.size else 0
    if end - begin < 8 or error[end - 1] < 10 * error[begin]:
        return float("nan")
    return float(np.polyfit(t[begin:end], np.log(error[begin:end]), 1)[0])


#: An error that falls by less than half of what even order 1 brings does not fall.
_FLAT: Final = 0.5
#: Orders of neighbouring pairs of steps this close confirm each other.
_SAME: Final = 0.2


def observed_order(dt: FloatArray, error: FloatArray, floor: float, ceiling: float) -> OrderFit | None:
    """The order with which `error` (j,) falls with the steps `dt` (j,) s, and where it stops falling.

    Each two neighbouring steps show an order, log(e1 / e2) / log(dt1 / dt2), where the coarser one's error is below
    `ceiling` (small), the finer one's above `floor` (not rounding), and it falls at all. A floor that is near bends
    orders down, terms of higher order at coarse steps bend them up; so the order is that of the finest pair that is
    confirmed by a pair beside it, or as good as the steepest. A pair that confirms may reach a tenth of the floor. The
    plateau is the smallest error where finer steps did not bring half of what that order promises, unless it is below
    `floor`. Where no pair shows an order, there still is a plateau if the finest step did not bring the error down.
    None where there is neither.
    """
    known = np.isfinite(error)
    by_step = np.argsort(dt[known])[::-1]
    h, e = dt[known][by_step], error[known][by_step]
    seen = {i: _order(h, e, i) for i in range(len(h) - 1) if e[i + 1] > 0.1 * floor and e[i] > 0}
    orders = {i: order for i, order in seen.items() if e[i + 1] > floor}
    shown = {i: order for i, order in orders.items() if e[i] < ceiling and order >= _FLAT}
    if not shown:
        flat = orders.get(len(h) - 2, math.inf) < _FLAT and floor < e.min() < ceiling
        return OrderFit(math.nan, float(h[-2]), float(h[-1]), float(e.min())) if flat else None
    last = max(i for i in shown if _confirmed(shown, seen, i))
    order, start = shown[last], last + 1
    promised = e[start] * (h[-1] / h[start]) ** (0.5 * order)
    level = float(e[start:].min())
    stops = start + 1 < len(h) and e[-1] > promised and level > floor
    return OrderFit(order, float(h[last]), float(h[start]), level if stops else None)


def _order(h: FloatArray, e: FloatArray, i: int) -> float:
    return float(np.log(e[i] / e[i + 1]) / np.log(h[i] / h[i + 1]))


def _confirmed(orders: Mapping[int, float], seen: Mapping[int, float], i: int) -> bool:
    beside = (orders.get(i - 1, math.inf), seen.get(i + 1, math.inf))
    return orders[i] > 0.75 * max(orders.values()) or any(abs(orders[i] - other) <= _SAME for other in beside)


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

    nan where there are not two such points, or where no cost brings the error down.
    """
    usable = np.isfinite(error) & (error > floor) & (error < ceiling)
    if np.count_nonzero(usable) < 2 or np.ptp(np.log(error[usable])) < math.log(2):
        return math.nan
    slope = float(np.polyfit(-np.log10(error[usable]), np.log10(run_s[usable]), 1)[0])
    return 10.0**slope if slope > 0 else math.nan


def growth_exponent(n: FloatArray, value: FloatArray) -> float:
    """The exponent p of `value ~ n^p` by least squares on logarithms, (k,) each; nan for fewer than three points."""
    if len(n) < 3:
        return math.nan
    return float(np.polyfit(np.log(n), np.log(value), 1)[0])
