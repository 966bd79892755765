"""When a run leaves the truth, and how fast. Each follows its definition in docs/measuring.md."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray


class Crossing(NamedTuple):
    """When an error passed a threshold, s: between the samples at `low` and `high`, by interpolation at `time`."""

    time: float
    low: float
    high: float


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
