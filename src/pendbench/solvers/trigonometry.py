"""Sines and cosines that vectorise: loops over them run several angles at a time, which calls of libm do not.

Reduction to within pi/4 with pi/2 in three parts (Cody and Waite, Software Manual for the Elementary Functions, 1980)
and the polynomials of fdlibm (Sun Microsystems, 1993, files k_sin.c and k_cos.c): errors below 2.5 units in the last
place for angles up to `FAR`. What lies beyond is left to libm.
"""

from __future__ import annotations

import math

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined

#: The largest angle, rad, whose multiple of pi/2 times the first part of pi/2 is exact.
FAR = 1e5

_PER_QUARTER = 6.36619772367581382433e-01
# pi / 2 = _QUARTER_1 + _QUARTER_2 + _QUARTER_3, the first two with 33 bits, so that their small multiples are exact.
_QUARTER_1, _QUARTER_2, _QUARTER_3 = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
_ROUNDER = 6755399441055744.0  # 1.5 * 2^52: adding it leaves no room for a fraction

_S1, _S2, _S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
_S4, _S5, _S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
_C1, _C2, _C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
_C4, _C5, _C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11


@inlined
def cosine_sine(x: float, tail: float) -> tuple[float, float]:
    """Cosine and sine of x + tail, |x| up to `FAR` rad, where tail is at most a rounding error of x."""
    quarters = (x * _PER_QUARTER + _ROUNDER) - _ROUNDER
    r = ((x - quarters * _QUARTER_1) - quarters * _QUARTER_2) - quarters * _QUARTER_3
    z = r * r
    s = r + r * z * (_S1 + z * (_S2 + z * (_S3 + z * (_S4 + z * (_S5 + z * _S6)))))
    half = 0.5 * z
    near = 1.0 - half
    high = z * z * (_C1 + z * (_C2 + z * (_C3 + z * (_C4 + z * (_C5 + z * _C6)))))
    c = near + (((1.0 - near) - half) + high)
    s, c = s + c * tail, c - s * tail
    # quarters modulo 4, as -2, -1, 0, 1 or 2
    turned = quarters - 4.0 * ((0.25 * quarters + _ROUNDER) - _ROUNDER)
    aside = abs(turned) == 1.0
    cosine = s if aside else c
    sine = c if aside else s
    cosine = -cosine if turned == 1.0 or abs(turned) == 2.0 else cosine
    sine = -sine if turned == -1.0 or abs(turned) == 2.0 else sine
    return cosine, sine


@inlined
def direction(angle: float) -> tuple[float, float]:
    """Cosine and sine of any angle, rad."""
    return cosine_sine(angle, 0.0) if abs(angle) <= FAR else (math.cos(angle), math.sin(angle))


@inlined
def rounded_bend(inner: float, outer: float) -> tuple[float, float]:
    """The rounded outer - inner, and what rounding took from it."""
    bend = outer - inner
    kept = bend - outer
    return bend, (outer - (bend - kept)) - (inner + kept)


@inlined
def write_bends(theta: FloatArray, out: FloatArray, cosine: int, sine: int) -> None:
    """Write cos and sin of theta[i+1] - theta[i] (n - 1,) into the first places of two rows of `out` (rows, n).

    Next to a heavy mass a small bend decides everything, so what rounding takes from the difference is put back (Knuth,
    The Art of Computer Programming 2, 4.2.2, theorem B): without it, alternating masses of 1 and 1e8 lose two digits.
    """
    far = 0
    for i in range(len(theta) - 1):
        bend, lost = rounded_bend(theta[i], theta[i + 1])
        out[cosine, i], out[sine, i] = cosine_sine(bend, lost)
        far += int(not abs(bend) <= FAR)  # a count, since a maximum would keep the loop from vectorising
    if far:
        for i in range(len(theta) - 1):
            bend, lost = rounded_bend(theta[i], theta[i + 1])
            c, s = direction(bend)
            out[cosine, i], out[sine, i] = c - s * lost, s + c * lost


@inlined
def write_directions(theta: FloatArray, cosines: FloatArray, sines: FloatArray) -> None:
    """Write cos and sin of theta (n,) into the first places of two rows."""
    far = 0
    for i in range(len(theta)):
        cosines[i], sines[i] = cosine_sine(theta[i], 0.0)
        far += int(not abs(theta[i]) <= FAR)
    if far:
        for i in range(len(theta)):
            cosines[i], sines[i] = direction(theta[i])
