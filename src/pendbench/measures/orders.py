"""Orders and exponents. Each follows its definition in docs/measuring.md."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray


class OrderFit(NamedTuple):
    """The order seen between the steps `coarse` and `fine` (s), and the error at which it stops, or None.

    Where a plateau is all there is to see, the order is nan and the steps are the two finest.
    """

    order: float
    coarse: float
    fine: float
    plateau: float | None


#: Where steps show neither.
NO_FIT: Final = OrderFit(math.nan, math.nan, math.nan, None)

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


class Growth(NamedTuple):
    """The exponent p of `value ~ n^p`, and its standard error."""

    exponent: float
    error: float


def growth_exponent(n: FloatArray, value: FloatArray) -> Growth:
    """How `value` (k,) grows with `n` (k,), by least squares on logarithms; nan for fewer than three points.

    The standard error of the slope is that of ordinary least squares (Draper and Smith, Applied Regression Analysis,
    3rd edition, section 1.4): from how the points scatter about the line, whatever makes them do so.
    """
    if len(n) < 3:
        return Growth(math.nan, math.nan)
    x, y = np.log(n), np.log(value)
    slope, offset = np.polyfit(x, y, 1)
    variance = np.sum((y - offset - slope * x) ** 2) / (len(n) - 2)
    return Growth(float(slope), float(np.sqrt(variance / np.sum((x - x.mean()) ** 2))))
