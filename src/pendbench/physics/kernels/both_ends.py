"""The accelerations of a chain on massless rods on whose masses nothing acts but weight, in O(n).

The tridiagonal system of the tensions is eliminated from the tip and from the pivot towards the middle: while one side
waits for a result, the other is computed. It is free of cancellation. docs/equations.md, (E66) to (E68).
"""

from __future__ import annotations

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.physics.kernels import laws
from pendbench.physics.kernels.scratch import ACROSS, COSINE, OWN, PASSED, TENSION, WHOLE
from pendbench.physics.kernels.system import System
from pendbench.solvers.trigonometry import direction, write_bends

#: The elimination's fractions are reduced where they have become large. To ask at every fourth link will do: each link
#: multiplies them by 1 + the ratio of two masses, and four of these make 1e200 at most, since masses end at 1e50.
LINKS_BETWEEN, LARGE = 4, 1e20


@inlined
def _past_joint(
    c: float, s: float, ratio: float, whirl: float, whole: float, loose: float, moving: float
) -> tuple[float, float, float]:
    """W, L and V beyond a joint with cosine and sine of its bend, (E31); whirl: l omega^2 of the rod there."""
    heavier = ratio * loose
    beyond = whole + heavier
    return beyond, heavier + s * s * whole, c * moving + whirl * beyond


@inlined
def _reduced(whole: float, loose: float, moving: float) -> tuple[float, float, float]:
    """The same fractions, over one where they have become large."""
    share = 1.0 / whole if whole > LARGE else 1.0
    return whole * share, loose * share, moving * share


@inlined
def write_tensions(system: System, omega: FloatArray, moving: float) -> None:
    """Leave T (n,) in the scratch; moving: how the first mass would accelerate along its rod without rods, m/s^2.

    Nothing here returns early or asks whether there are joints: numba would then count references at every call.
    """
    lengths, scratch, masses = system.lengths, system.scratch, system.masses
    from_tip, from_pivot = system.ratios, system.inner_ratios
    tip = len(masses) - 1
    middle = max(tip - 1, 0) // 2  # the joint where both sides meet; of an even number the outer side has one more
    last = min(2 * middle, tip - 1)
    whole, loose = 1.0, 0.0
    whole_out, loose_out, moving_out = 1.0, 1.0, lengths[tip] * omega[tip] ** 2
    for i in range(tip - 1, last, -1):
        c, s, whirl = scratch[COSINE, i], scratch[ACROSS, i], lengths[i] * omega[i] ** 2
        scratch[OWN, i], scratch[PASSED, i] = moving_out, c * whole_out
        whole_out, loose_out, moving_out = _past_joint(c, s, from_tip[i], whirl, whole_out, loose_out, moving_out)
        scratch[WHOLE, i] = whole_out
    for start in range(0, middle, LINKS_BETWEEN):
        for k in range(start, min(start + LINKS_BETWEEN, middle)):
            c, s, whirl = scratch[COSINE, k], scratch[ACROSS, k], lengths[k + 1] * omega[k + 1] ** 2
            scratch[OWN, k], scratch[PASSED, k] = moving, c * whole
            whole, loose, moving = _past_joint(c, s, from_pivot[k], whirl, whole, loose, moving)
            scratch[WHOLE, k] = whole
            i = last - k
            c, s, whirl = scratch[COSINE, i], scratch[ACROSS, i], lengths[i] * omega[i] ** 2
            scratch[OWN, i], scratch[PASSED, i] = moving_out, c * whole_out
            whole_out, loose_out, moving_out = _past_joint(c, s, from_tip[i], whirl, whole_out, loose_out, moving_out)
            scratch[WHOLE, i] = whole_out
        whole, loose, moving = _reduced(whole, loose, moving)
        whole_out, loose_out, moving_out = _reduced(whole_out, loose_out, moving_out)
    c, s = scratch[COSINE, middle], scratch[ACROSS, middle]
    held, held_out = from_pivot[middle] * loose, from_tip[middle] * loose_out
    share = masses[middle] / ((whole * s * s + held) * whole_out + (whole + held) * held_out)
    inner = share * (moving * (whole_out + held_out) + c * whole * moving_out)
    outer = share * (moving_out * (whole + held) + c * whole_out * moving)
    for i in range(tip):
        share = 1.0 / scratch[WHOLE, i]
        scratch[OWN, i] *= masses[i] * share
        scratch[PASSED, i] *= share
        scratch[ACROSS, i] *= system.inverse_masses[i]
    scratch[TENSION, min(middle + 1, tip)] = outer
    scratch[TENSION, middle] = inner
    for k in range(middle):
        i, j = middle - 1 - k, middle + 1 + k
        inner = scratch[OWN, i] + scratch[PASSED, i] * inner
        outer = scratch[OWN, j] + scratch[PASSED, j] * outer
        scratch[TENSION, i], scratch[TENSION, j + 1] = inner, outer
    for i in range(last + 1, tip):
        scratch[TENSION, i + 1] = scratch[OWN, i] + scratch[PASSED, i] * outer


@inlined
def write_accelerations(system: System, t: float, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write theta'' (n,) rad/s^2 at time t s, theta (n,) rad, omega (n,) rad/s into `out`; leaves T (n,) in scratch."""
    lengths, scratch, tip = system.lengths, system.scratch, len(system.masses) - 1
    write_bends(theta, scratch, COSINE, ACROSS)
    scratch[COSINE, tip], scratch[ACROSS, tip] = 0.0, 1.0
    c, s = direction(theta[0])
    along, start = system.gravity * c, system.gravity * s
    if len(system.pivots) > 0:
        x, y = laws.pivot_acceleration(system.pivots, t)
        along, start = along + (c * y - s * x), start + (c * x + s * y)
    write_tensions(system, omega, along + lengths[0] * omega[0] ** 2)
    out[tip] = -start / lengths[tip]
    for i in range(min(tip, 1)):
        out[i] = (scratch[ACROSS, i] * scratch[TENSION, i + 1] - start) / lengths[i]
        out[tip] = -scratch[ACROSS, tip - 1] * scratch[TENSION, tip - 1] / lengths[tip]
    for i in range(1, tip):
        pulled = scratch[ACROSS, i] * scratch[TENSION, i + 1] - scratch[ACROSS, i - 1] * scratch[TENSION, i - 1]
        out[i] = pulled / lengths[i]
