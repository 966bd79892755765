"""The accelerations of a chain on rods with mass, in O(n) (docs/equations.md, (E45) to (E48)).

What hangs on a joint is more than a tension here: a matrix (2, 2) of inertia, in the frame of the rod that ends there.
"""

from __future__ import annotations

from pendbench.arrays import FloatArray
from pendbench.compiled import inlined
from pendbench.physics import forces, laws
from pendbench.physics.forces import FORCE_ACROSS, FORCE_ALONG
from pendbench.physics.system import RodSystem
from pendbench.physics.trigonometry import direction, write_bends

# The rows of a system's scratch, here.
_COSINE, _SINE, _TURNED, _PASSED, _OWN, _WHIRL = range(6)

# All inertias are multiples of a common factor, whose inverse is not needed until they are used: no link has to wait
# for the division of the link before it. The factor is taken out where it has become large or small.
_LARGE = 1e20


@inlined
def _inwards(system: RodSystem, forced: bool) -> None:
    """Eliminate the chain from the tip to the pivot.

    Leaves, for each rod, `turned`, `passed` and `own`: its outer end accelerates across it by own - turned a_along -
    passed a_across, where a is the acceleration of its inner end.
    """
    points, rods, scratch = system.points, system.rods, system.scratch
    factor, along, both, across, area = 1.0, 0.0, 0.0, 0.0, 0.0
    pull_along, pull_across = 0.0, 0.0
    for i in range(len(points) - 1, -1, -1):
        c, s, m = scratch[_COSINE, i], scratch[_SINE, i], points[i]
        third, twelfth = rods[i] / 3.0, rods[i] / 12.0
        cc, cs, ss = c * c, c * s, s * s
        loaded = m * factor
        # The inertia of mass i and of all that hangs on it, and its determinant, (E46).
        outer_area = m * (loaded + (along + across)) + area
        outer_along = (loaded + cc * along) + (ss * across - 2.0 * (cs * both))
        outer_across = (loaded + ss * along) + (cc * across + 2.0 * (cs * both))
        outer_both = cs * (along - across) + (cc - ss) * both
        # The same seen from the rod's inner end, (E45), (E46).
        following = third * factor + outer_across
        area = third * (rods[i] * (0.75 * third * factor + outer_across + 0.25 * outer_along) + outer_area)
        along = rods[i] * following + third * outer_along + outer_area
        both = -0.5 * third * outer_both
        across = third * (0.75 * third * factor + outer_across)
        inverse = 1.0 / following
        turned = outer_both * inverse
        passed = 2.0 * twelfth * factor * inverse
        # And what pulls, (E45).
        whirl = scratch[_WHIRL, i]
        pulled = c * pull_along - s * pull_across
        pushed = s * pull_along + c * pull_across
        if forced:
            pulled = pulled + scratch[FORCE_ALONG, i]
            pushed = pushed + scratch[FORCE_ACROSS, i]
        own = factor * inverse * pushed + turned * whirl
        scratch[_TURNED, i], scratch[_PASSED, i], scratch[_OWN, i] = turned, passed, own
        pull_along = (pulled - turned * pushed) + whirl * (along * inverse - 0.5 * rods[i])
        pull_across = -(2.0 * twelfth) * own
        factor = following
        if factor > _LARGE or factor < 1.0 / _LARGE:
            share = 1.0 / factor
            factor, area = 1.0, area * share
            along, both, across = along * share, both * share, across * share


@inlined
def _outwards(system: RodSystem, along: float, across: float, out: FloatArray) -> None:
    """Carry the pivot's acceleration, along and across the first rod, to the tip; write theta'' (n,) into `out`."""
    lengths, scratch = system.lengths, system.scratch
    for i in range(len(lengths)):
        outer = scratch[_OWN, i] - scratch[_TURNED, i] * along - scratch[_PASSED, i] * across
        out[i] = (outer - across) / lengths[i]
        along = along - scratch[_WHIRL, i]
        c, s = scratch[_COSINE, i], scratch[_SINE, i]
        along, across = c * along + s * outer, c * outer - s * along


@inlined
def write_accelerations(system: RodSystem, t: float, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write theta'' (n,) rad/s^2 at time t s, theta (n,) rad, omega (n,) rad/s into `out`."""
    lengths, scratch, tip = system.lengths, system.scratch, len(system.lengths) - 1
    forced = len(system.joints) + len(system.drags) > 0
    write_bends(theta, scratch, _COSINE, _SINE)
    scratch[_COSINE, tip], scratch[_SINE, tip] = 1.0, 0.0
    if forced:
        forces.write_forces(system, t, theta, omega, _COSINE, _SINE)
    for i in range(tip + 1):
        scratch[_WHIRL, i] = lengths[i] * omega[i] ** 2
    _inwards(system, forced)
    c, s = direction(theta[0])
    x, y = 0.0, system.gravity
    if len(system.frames) > 0:
        x, y = laws.pivot_acceleration(system.frames, t)
        y = y + system.gravity
    _outwards(system, s * x - c * y, c * x + s * y, out)


@inlined
def write_rates(system: RodSystem, theta: FloatArray, momenta: FloatArray, out: FloatArray) -> None:
    """Write omega = C(theta)^-1 p (n,) rad/s into `out`: what torques p do to a chain at rest, without weight."""
    scratch, tip = system.scratch, len(system.lengths) - 1
    write_bends(theta, scratch, _COSINE, _SINE)
    scratch[_COSINE, tip], scratch[_SINE, tip] = 1.0, 0.0
    forces.write_couples(system.lengths, momenta, scratch, _COSINE, _SINE)
    for i in range(tip + 1):
        scratch[_WHIRL, i] = 0.0
    _inwards(system, True)
    _outwards(system, 0.0, 0.0, out)
