"""How an energy strays. Each follows its definition in docs/measuring.md."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray


class Drift(NamedTuple):
    """How an energy strays, in units of the energy scale: largest and last deviation from the first value, the band
    (peak to peak) and the slope of a least-squares line, per second.
    """

    largest: float
    final: float
    band: float
    slope: float


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
