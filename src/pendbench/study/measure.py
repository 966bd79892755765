"""What is measured, as pure functions of arrays. Each follows its definition in docs/measuring.md."""

from __future__ import annotations

from typing import NamedTuple

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
    """The order seen between the steps `coarse` and `fine` (s), and the error at which it stops, or None."""

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
    if scale <= 0 or not len(t):
        return Drift(np.nan, np.nan, np.nan, np.nan)
    relative = (energy - energy[0]) / scale
    slope = float(np.polyfit(t, relative, 1)[0]) if len(t) > 1 else np.nan
    return Drift(float(np.abs(relative).max()), float(relative[-1]), float(np.ptp(relative)), slope)


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


def observed_order(dt: FloatArray, error: FloatArray, floor: float, ceiling: float) -> OrderFit | None:
    """The order with which `error` (j,) falls with the steps `dt` (j,) s.

    Taken from the two finest neighbouring steps whose errors lie between `floor` (rounding) and `ceiling` (no longer
    small) and still fall; the plateau is the error from which a finer step no longer brings it down by half of what
    that order promises. None where there are no two such steps.
    """
    by_step = np.argsort(dt)[::-1]
    h, e = dt[by_step], error[by_step]
    usable = [i for i in range(len(h) - 1) if e[i] < ceiling and e[i + 1] > floor and e[i + 1] < e[i]]
    orders = {i: float(np.log(e[i] / e[i + 1]) / np.log(h[i] / h[i + 1])) for i in usable}
    if not orders:
        return None
    # Past the steps that show the order, rounding or another floor bends the line: it only ever gets flatter.
    best = max(orders.values())
    shown = [i for i, order in orders.items() if order > 0.75 * best]
    last = shown[-1]
    stops = last + 2 < len(h) and not e[last + 2] < e[last + 1] / (h[last + 1] / h[last + 2]) ** (0.5 * orders[last])
    plateau = float(e[last + 1 :].min()) if stops else None
    return OrderFit(orders[last], float(h[last]), float(h[last + 1]), plateau)
