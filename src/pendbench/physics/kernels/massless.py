"""The accelerations of a chain on massless rods on whose masses forces act, in O(n), from tip to pivot and back.

docs/equations.md derives it, and docs/effects.md says what effects cost in digits. Where only weight acts on the
masses, `both_ends` needs less time.
"""

from __future__ import annotations

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.physics.kernels import forces, laws
from pendbench.physics.kernels.both_ends import LARGE, LINKS_BETWEEN
from pendbench.physics.kernels.scratch import (
    ACROSS,
    COSINE,
    FORCE_ACROSS,
    FORCE_ALONG,
    HELD,
    OWN,
    PASSED,
    TENSION,
    WHOLE,
)
from pendbench.physics.kernels.system import System
from pendbench.solvers.trigonometry import direction, write_bends


@inlined
def inwards(system: System, t: float, theta: FloatArray, omega: FloatArray) -> tuple[float, float]:
    """Eliminate the chain from the tip to the pivot.

    Leaves in `system.scratch`, for each joint between rods i and i+1: the two parts of the mean
    `T_{i+1} = own_i + passed_i T_i`, and `across_i = sin / m_i`, with which T_{i+1} turns into the acceleration of mass
    i across rod i. Returns (alpha_1, beta_1), with which the tension in the first rod is `beta - alpha u.a'`.

    T is what is left of a rod's tension without the force along it on its own mass, and `held_i / m_i` the acceleration
    across the rod but for T_i (docs/equations.md, (E44)).
    """
    masses, lengths, ratios = system.masses, system.lengths, system.ratios
    scratch = system.scratch
    write_bends(theta, scratch, COSINE, ACROSS)
    tip = len(masses) - 1
    # (E31): each link's division would have to wait for that of the link before it, so none is made until the end.
    whole, loose, moving = 1.0, 1.0, lengths[tip] * omega[tip] ** 2
    forces.write_forces(system, t, theta, omega, COSINE, ACROSS)
    scratch[HELD, tip] = scratch[FORCE_ACROSS, tip]
    for last in range(tip, 0, -LINKS_BETWEEN):
        for i in range(last - 1, max(last - LINKS_BETWEEN, 0) - 1, -1):
            c, s = scratch[COSINE, i], scratch[ACROSS, i]
            scratch[OWN, i], scratch[PASSED, i] = masses[i] * moving, c * whole
            scratch[ACROSS, i] = s * system.inverse_masses[i]
            heavier = ratios[i] * loose
            outer, across = scratch[FORCE_ALONG, i + 1], scratch[FORCE_ACROSS, i]
            scratch[HELD, i] = s * (scratch[OWN, i] + heavier * outer) + across * (c * c * whole + heavier)
            scratch[OWN, i] -= whole * (outer + s * across)
            moving = moving + outer * loose * system.inverse_masses[i + 1]
            moving = moving - s * whole * across * system.inverse_masses[i]
            loose = heavier + s * s * whole
            whole = whole + heavier
            moving = c * moving + lengths[i] * omega[i] ** 2 * whole
            scratch[WHOLE, i] = whole
        if whole > LARGE:
            share = 1.0 / whole
            whole, loose, moving = 1.0, loose * share, moving * share
    for i in range(tip):
        share = 1.0 / scratch[WHOLE, i]
        scratch[OWN, i] *= share
        scratch[PASSED, i] *= share
        scratch[HELD, i] *= share
    scratch[OWN, tip], scratch[PASSED, tip], scratch[ACROSS, tip] = 0.0, 0.0, 0.0
    jerked = masses[0] / loose
    return jerked * whole, jerked * moving


@inlined
def outwards(system: System, t: float, theta: FloatArray, alpha: float, beta: float, out: FloatArray) -> None:
    """Carry the first rod's tension to the tip; write theta'' (n,) into `out`, and leave T (n,) in the scratch.

    Takes what `inwards` returned and left behind. Tensions, not accelerations, are carried: each is a mean of two with
    positive weights (but for the cosine), so a light mass between heavy ones costs no digits.
    """
    lengths, scratch = system.lengths, system.scratch
    c, s = direction(theta[0])
    tension = beta + alpha * system.gravity * c
    start = system.gravity * s  # how the inner end of the rod accelerates across it
    if len(system.pivots) > 0:
        x, y = laws.pivot_acceleration(system.pivots, t)
        tension = tension + alpha * (c * y - s * x)
        start = start + (c * x + s * y)
    for i in range(len(lengths)):
        c = scratch[COSINE, i]
        scratch[TENSION, i] = tension
        following = scratch[OWN, i] + scratch[PASSED, i] * tension
        inverse = system.inverse_masses[i]
        end = scratch[HELD, i] * inverse + scratch[ACROSS, i] * (scratch[PASSED, i] * tension)
        out[i] = (end - start) / lengths[i]
        start = scratch[ACROSS, i] * tension + c * scratch[FORCE_ACROSS, i] * inverse
        tension = following


@inlined
def write_accelerations(system: System, t: float, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write theta'' (n,) rad/s^2 at time t s, theta (n,) rad, omega (n,) rad/s into `out`."""
    alpha, beta = inwards(system, t, theta, omega)
    outwards(system, t, theta, alpha, beta, out)
