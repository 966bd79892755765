"""The accelerations of a chain with rotors in its joints, in O(n) (docs/equations.md, (E55) to (E57)).

A rotor turns with the angle between two links, so what hangs on a joint answers to how the link before it turns, too:
an inertia (3, 3), for two directions and an angle. Where a joint has no rotor, all that is new is 0.
"""

from __future__ import annotations

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.physics.kernels import canonical, massive
from pendbench.physics.kernels.scratch import (
    COSINE,
    DRIVEN,
    FORCE_ACROSS,
    FORCE_ALONG,
    OWN,
    PASSED,
    SINE,
    TURNED,
    WHIRL,
)
from pendbench.physics.kernels.system import RotorSystem


@inlined
def _inwards(system: RotorSystem, forced: bool) -> None:
    """Eliminate the chain from the tip to the pivot.

    Leaves, for each link, `own`, `turned`, `passed` and `driven`: its outer end accelerates across it by own - turned
    a_along + passed a_across + driven theta'', where a is the acceleration of its inner end, and theta'' that of the
    angle of the link before it.
    """
    chain, rotors = system.chain, system.rotors
    scratch = chain.scratch
    along, both, across = 0.0, 0.0, 0.0  # the inertia (3, 3) at the joint: (along, both; both, across) and the angle's
    with_along, with_across, angular = 0.0, 0.0, 0.0
    pull_along, pull_across, pull_angular = 0.0, 0.0, 0.0
    for i in range(len(rotors) - 1, -1, -1):
        c, s, m, length = scratch[COSINE, i], scratch[SINE, i], chain.points[i], chain.lengths[i]
        cc, cs, ss = c * c, c * s, s * s
        # The inertia of mass i and of all that hangs on it; the angle's is that of this link, times its length.
        end_along = m + (cc * along + ss * across) - 2.0 * (cs * both)
        end_across = m + (ss * along + cc * across) + 2.0 * (cs * both)
        end_both = cs * (along - across) + (cc - ss) * both
        u, v, w = (c * with_along - s * with_across) / length, (s * with_along + c * with_across) / length, angular
        w = w / length / length
        rotor = rotors[i] / length / length
        # What the turning of the link itself moves, (E55).
        weight, about_joint = chain.weights[i], chain.about_joints[i]
        turning = about_joint + end_across + 2.0 * v + w + rotor
        inverse = 1.0 / turning
        leaning, lifting = end_both + u, weight - chain.inner[i] + end_across + v
        left = chain.leans[i] + v + w + rotor
        whirl = scratch[WHIRL, i]
        pulled = c * pull_along - s * pull_across
        pushed = s * pull_along + c * pull_across
        if forced:
            pulled = pulled + scratch[FORCE_ALONG, i]
            pushed = pushed + scratch[FORCE_ACROSS, i]
        own = (pushed + pull_angular / length + leaning * whirl) * inverse
        scratch[OWN, i], scratch[TURNED, i], scratch[PASSED, i] = own, leaning * inverse, left * inverse
        scratch[DRIVEN, i] = rotor * length * inverse
        # And the same without it, seen from the joint, (E56).
        pull_along = pulled + (weight - chain.inner[i] + end_along) * whirl - leaning * own
        pull_across = (pushed + end_both * whirl) - lifting * own
        pull_angular = rotor * length * own
        spread = weight * chain.about_centres[i] + chain.about_ends[i] * end_across + 2.0 * v * chain.inner[i]
        along = weight + (end_along - leaning * leaning * inverse)
        both = (end_both * left - u * lifting) * inverse
        across = (spread + (weight + end_across) * (w + rotor) - v * v) * inverse
        with_along, with_across = leaning * scratch[DRIVEN, i], lifting * scratch[DRIVEN, i]
        angular = rotors[i] * ((turning - rotor) * inverse)


@inlined
def _outwards(system: RotorSystem, along: float, across: float, out: FloatArray) -> None:
    """Carry the pivot's acceleration, along and across the first link, to the tip; write theta'' (n,) into `out`."""
    lengths, scratch = system.chain.lengths, system.chain.scratch
    angular = 0.0
    for i in range(len(lengths)):
        outer = scratch[OWN, i] - scratch[TURNED, i] * along + scratch[PASSED, i] * across
        outer = outer + scratch[DRIVEN, i] * angular
        angular = (outer - across) / lengths[i]
        out[i] = angular
        along = along - scratch[WHIRL, i]
        c, s = scratch[COSINE, i], scratch[SINE, i]
        along, across = c * along + s * outer, c * outer - s * along


@inlined
def write_accelerations(system: RotorSystem, t: float, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write theta'' (n,) rad/s^2 at time t s, theta (n,) rad, omega (n,) rad/s into `out`."""
    _inwards(system, massive.begin(system.chain, t, theta, omega))
    along, across = massive.at_pivot(system.chain, t, theta[0])
    _outwards(system, along, across, out)


@inlined
def write_rates(system: RotorSystem, theta: FloatArray, momenta: FloatArray, out: FloatArray) -> None:
    """Write omega = C(theta)^-1 p (n,) rad/s into `out`: what torques p do to a chain at rest, without weight."""
    massive.begin_at_rest(system.chain, theta, momenta)
    _inwards(system, True)
    _outwards(system, 0.0, 0.0, out)


@inlined
def write_momenta(system: RotorSystem, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write p = C(theta) omega (n,) kg m^2/s into `out`."""
    canonical.write_massive_momenta(system.chain, theta, omega, out)
    out[0] += system.rotors[0] * omega[0]
    for i in range(1, len(out)):
        turning = system.rotors[i] * (omega[i] - omega[i - 1])
        out[i] += turning
        out[i - 1] -= turning


@inlined
def write_forces(system: RotorSystem, t: float, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write dL/dtheta (n,) N m into `out`, and what effects without a Lagrangian do: rotors have no part in either."""
    canonical.write_forces(system.chain, t, theta, omega, out)
