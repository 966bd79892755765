"""The accelerations of a chain of links with a mass along them, in O(n) (docs/equations.md, (E45) to (E48), (E54)).

What hangs on a joint is more than a tension here: a matrix (2, 2) of inertia, in the frame of the link that ends there.
"""

from __future__ import annotations

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.physics.kernels import forces, laws
from pendbench.physics.kernels.scratch import COSINE, FORCE_ACROSS, FORCE_ALONG, OWN, PASSED, SINE, TURNED, WHIRL
from pendbench.physics.kernels.system import LinkSystem
from pendbench.solvers.trigonometry import direction, write_bends

# All inertias are multiples of a common factor, whose inverse is not needed until they are used: no link has to wait
# for the division of the link before it. The factor is taken out where it has become large or small.
_LARGE = 1e20


@inlined
def _inwards(system: LinkSystem, forced: bool) -> None:
    """Eliminate the chain from the tip to the pivot.

    Leaves, for each rod, `turned`, `passed` and `own`: its outer end accelerates across it by own - turned a_along -
    passed a_across, where a is the acceleration of its inner end.
    """
    points, weights, scratch = system.points, system.weights, system.scratch
    factor, along, both, across, area = 1.0, 0.0, 0.0, 0.0, 0.0
    pull_along, pull_across = 0.0, 0.0
    for i in range(len(points) - 1, -1, -1):
        c, s, m = scratch[COSINE, i], scratch[SINE, i], points[i]
        weight, at_centre, at_end, lean = weights[i], system.about_centres[i], system.about_ends[i], system.leans[i]
        cc, cs, ss = c * c, c * s, s * s
        loaded = m * factor
        # The inertia of mass i and of all that hangs on it, and its determinant, (E46).
        outer_area = m * (loaded + (along + across)) + area
        outer_along = (loaded + cc * along) + (ss * across - 2.0 * (cs * both))
        outer_across = (loaded + ss * along) + (cc * across + 2.0 * (cs * both))
        outer_both = cs * (along - across) + (cc - ss) * both
        # The same seen from the link's inner end, (E54).
        following = system.about_joints[i] * factor + outer_across
        turning = weight * at_centre * factor + at_end * outer_across
        area = weight * (turning + at_centre * outer_along) + at_end * outer_area
        along = weight * following + system.about_joints[i] * outer_along + outer_area
        both = lean * outer_both
        across = turning
        inverse = 1.0 / following
        turned = outer_both * inverse
        passed = -lean * factor * inverse
        # And what pulls, (E54).
        whirl = scratch[WHIRL, i]
        pulled = c * pull_along - s * pull_across
        pushed = s * pull_along + c * pull_across
        if forced:
            pulled = pulled + scratch[FORCE_ALONG, i]
            pushed = pushed + scratch[FORCE_ACROSS, i]
        own = factor * inverse * pushed + turned * whirl
        scratch[TURNED, i], scratch[PASSED, i], scratch[OWN, i] = turned, passed, own
        pull_along = (pulled - turned * pushed) + whirl * (along * inverse - system.inner[i])
        pull_across = lean * own
        factor = following
        if factor > _LARGE or factor < 1.0 / _LARGE:
            share = 1.0 / factor
            factor, area = 1.0, area * share
            along, both, across = along * share, both * share, across * share


@inlined
def _outwards(system: LinkSystem, along: float, across: float, out: FloatArray) -> None:
    """Carry the pivot's acceleration, along and across the first rod, to the tip; write theta'' (n,) into `out`."""
    lengths, scratch = system.lengths, system.scratch
    for i in range(len(lengths)):
        outer = scratch[OWN, i] - scratch[TURNED, i] * along - scratch[PASSED, i] * across
        out[i] = (outer - across) / lengths[i]
        along = along - scratch[WHIRL, i]
        c, s = scratch[COSINE, i], scratch[SINE, i]
        along, across = c * along + s * outer, c * outer - s * along


@inlined
def begin(chain: LinkSystem, t: float, theta: FloatArray, omega: FloatArray) -> bool:
    """Leave in the scratch what both ways need: bends, forces and `whirl`. Whether any force acts on the masses."""
    lengths, scratch, tip = chain.lengths, chain.scratch, len(chain.lengths) - 1
    forced = len(chain.joints) + len(chain.drags) > 0
    write_bends(theta, scratch, COSINE, SINE)
    scratch[COSINE, tip], scratch[SINE, tip] = 1.0, 0.0
    if forced:
        forces.write_forces(chain, t, theta, omega, COSINE, SINE)
    for i in range(tip + 1):
        scratch[WHIRL, i] = lengths[i] * omega[i] ** 2
    return forced


@inlined
def begin_at_rest(chain: LinkSystem, theta: FloatArray, torques: FloatArray) -> None:
    """The same for a chain at rest under torques (n,) N m on its links, without weight."""
    scratch, tip = chain.scratch, len(chain.lengths) - 1
    write_bends(theta, scratch, COSINE, SINE)
    scratch[COSINE, tip], scratch[SINE, tip] = 1.0, 0.0
    forces.write_couples(chain.lengths, torques, scratch, COSINE, SINE)
    for i in range(tip + 1):
        scratch[WHIRL, i] = 0.0


@inlined
def at_pivot(chain: LinkSystem, t: float, first: float) -> tuple[float, float]:
    """The pivot's acceleration against free fall, along and across a first link at angle `first` (rad)."""
    c, s = direction(first)
    x, y = 0.0, chain.gravity
    if len(chain.pivots) > 0:
        x, y = laws.pivot_acceleration(chain.pivots, t)
        y = y + chain.gravity
    return s * x - c * y, c * x + s * y


@inlined
def write_accelerations(system: LinkSystem, t: float, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write theta'' (n,) rad/s^2 at time t s, theta (n,) rad, omega (n,) rad/s into `out`."""
    _inwards(system, begin(system, t, theta, omega))
    along, across = at_pivot(system, t, theta[0])
    _outwards(system, along, across, out)


@inlined
def write_rates(system: LinkSystem, theta: FloatArray, momenta: FloatArray, out: FloatArray) -> None:
    """Write omega = C(theta)^-1 p (n,) rad/s into `out`: what torques p do to a chain at rest, without weight."""
    begin_at_rest(system, theta, momenta)
    _inwards(system, True)
    _outwards(system, 0.0, 0.0, out)
