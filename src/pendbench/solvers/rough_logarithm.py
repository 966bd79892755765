"""A logarithm to four digits, where how long a step may be is asked of many numbers."""

from __future__ import annotations

import numpy as np

from pendbench.base.compiled import inlined

# A double: how many bits its mantissa has, and what is added to its exponent.
_BITS, _BIAS = 52, 1023
_MANTISSA, _EXPONENT_OF_ONE = (1 << _BITS) - 1, _BIAS << _BITS

# log2 from 1 to 2, a polynomial fitted by least squares in the zeros of a Chebyshev polynomial: 1.0e-4 off at most.
_LOG2 = (-2.50561466, 4.04961689, -2.09940228, 0.63551112, -0.08001088)


@inlined
def rough_log2(x: float) -> float:
    """log2 of a normal x > 0 to 1e-4, in half the time of the exact one; below -1022 for 0 and what is smaller."""
    bits = np.float64(x).view(np.int64)
    m = np.int64((bits & _MANTISSA) | _EXPONENT_OF_ONE).view(np.float64)
    square = m * m
    of_mantissa = (_LOG2[0] + _LOG2[1] * m) + square * ((_LOG2[2] + _LOG2[3] * m) + square * _LOG2[4])
    return float(((bits >> _BITS) - _BIAS) + of_mantissa)
