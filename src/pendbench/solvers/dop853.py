"""Dormand and Prince's method of order 8 with Hairer's two estimates of its error: coefficients for `adaptive`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853 as _SCIPY_DOP853

from pendbench.base.arrays import FloatArray


class EmbeddedPair(NamedTuple):
    """A Runge-Kutta method of order `order` with the weights (s,) of two estimates of its error, orders 5 and 3."""

    a: FloatArray
    b: FloatArray
    c: FloatArray
    error5: FloatArray
    error3: FloatArray
    order: int


# Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, p. 181, and code DOP853. scipy publishes the
# coefficients; its error weights have a last entry, zero, for the derivative after the step.
_STAGES = len(_SCIPY_DOP853.B)
DOP853 = EmbeddedPair(
    a=np.ascontiguousarray(_SCIPY_DOP853.A[:_STAGES, :_STAGES]),
    b=np.array(_SCIPY_DOP853.B),
    c=np.array(_SCIPY_DOP853.C[:_STAGES]),
    error5=np.array(_SCIPY_DOP853.E5[:_STAGES]),
    error3=np.array(_SCIPY_DOP853.E3[:_STAGES]),
    order=8,
)
