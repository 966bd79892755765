"""What is proved of a step: how far the true solution can be from its polynomials. docs/proofs.md has the theorem.

All numbers are upper bounds, in balls; norms are the largest component, of the scaled state.
"""

from __future__ import annotations

from dataclasses import dataclass

from pendbench.truth.proof.numbers import Number, precision, variables
from pendbench.truth.proof.polynomials import Effort, Path, coefficients_of, jacobian_series, slope_series
from pendbench.truth.proof.system import Rates

#: Balls that hold bounds have so many bits, which are to spare.
BITS = 64
#: How far around the path, in every component and in complex numbers, the equations are looked at.
TUBE = 2.0**-10
#: The real tube in which what is said of growth holds. Solutions must be seen not to leave it.
NEAR = 2.0**-20
#: Coefficients beyond this power are taken for the tube's, where the path is evaluated over boxes.
_LOW = 24
_MOST_BOXES = 400
_PIECES = 4


@dataclass(frozen=True)
class Largest:
    """M, which |H f| does not exceed for |u| <= radius (complex) and all complex states within TUBE of the path.

    boxes: how many it took to show that.
    """

    radius: Number
    size: Number
    boxes: int


@dataclass(frozen=True)
class Bounds:
    """Of a step of length h, in u.

    centre: how far the solution that starts in the middle is from the path. variation: how far its derivative with
    respect to the start is from the path's variation, as a norm. bend: half the second derivative's, so that
    ``bend |delta|^2`` is what the linear answer to a change delta of the start leaves out. farthest: the largest delta
    for which that holds.
    """

    length: Number
    centre: Number
    variation: Number
    bend: Number
    farthest: Number


def largest_slope(system: Rates, path: Path, radius: float) -> Largest | None:
    """M over a disc, by covering its upper half with squares (the equations are real); None where that fails."""
    from flint import arb

    with precision(BITS, _LOW + 1):
        bound = arb(radius)
        low, tails = _low_part(path, bound)
        worst, boxes = arb(0), [(x, 0.25, 0.5) for x in (-0.75, -0.25, 0.25, 0.75)]
        boxes += [(x, 0.75, 0.5) for x in (-0.75, -0.25, 0.25, 0.75)]
        tried = 0
        while boxes:
            x, y, side = boxes.pop()
            if max(abs(x) - side / 2, 0.0) ** 2 + max(y - side / 2, 0.0) ** 2 > 1.0:
                continue  # outside the disc; all these numbers are exact
            tried += 1
            if tried > _MOST_BOXES:
                return None
            found = _over_box(system, path, low, tails, radius, (x, y, side))
            if found is None:
                quarter = side / 4
                boxes += [(x + a, y + b, side / 2) for a in (-quarter, quarter) for b in (-quarter, quarter)]
            else:
                worst = worst.max(found)
        return Largest(bound, worst.abs_upper(), tried)


def _low_part(path: Path, radius: Number) -> tuple[list[Number], list[Number]]:
    """The path's lower coefficients as complex polynomials, and bounds of what the others come to in the disc."""
    from flint import acb_poly, arb

    low = [acb_poly(its[:_LOW]) for its in path.state]
    tails = []
    for its in path.state:
        size = arb(0)
        for c in reversed(its[_LOW:]):
            size = (size * radius + abs(c)).abs_upper()
        tails.append((size * radius**_LOW).abs_upper())
    return low, tails


def _over_box(
    system: Rates,
    path: Path,
    low: list[Number],
    tails: list[Number],
    radius: float,
    box: tuple[float, float, float],
) -> Number | None:
    """|H f| over a square and the tube; None where the equations may be singular there.

    Angles between rods are polynomials of their own there: as differences of balls they would be wider.
    """
    from flint import acb, acb_poly, arb

    x, y, side = box
    middle = acb(arb(x) * radius, arb(y) * radius)
    half = arb(side) * radius / 2
    square = acb(arb(0, half), arb(0, half))
    shift = acb_poly([middle, acb(1)])

    def over(its: Number, left_out: Number) -> Number:
        ball = arb(0, left_out.abs_upper())
        return its(shift)(square) + acb(ball, ball)

    wide = [tail + TUBE for tail in tails]
    state = [over(its, its_wide) for its, its_wide in zip(low, wide, strict=True)]
    apart = [[over(low[i] - low[j], wide[i] + wide[j]) for j in range(i)] for i in range(system.n)]
    u = middle + square
    try:
        slope = system.slope(state, u * path.span + path.start, apart)
    except ZeroDivisionError:
        return None
    sizes = [its.abs_upper() * path.span for its in slope]
    if not all(its.is_finite() for its in sizes):
        return None
    worst = arb(0)
    for its in sizes:
        worst = worst.max(its)
    return worst.abs_upper() if worst < 1e12 else None


def prove_step(system: Rates, path: Path, largest: Largest, length: Number, effort: Effort) -> Bounds | None:
    """The bounds of a step of this length (u, exact), or None where they cannot be had."""
    from flint import arb

    with precision(effort.bits, effort.order):
        defect = _defect(system, path, length, effort.order)
    with precision(effort.small_bits, effort.small_order):
        twist, size = _variation_defect(system, path, length)
    with precision(BITS):
        ratio = length / largest.radius
        if not ratio < 1:
            return None
        part = 1 / (1 - ratio)
        defect = defect + largest.size * ratio ** (effort.order - 1) * part
        twist = twist + largest.size / TUBE * _variation_size(path, largest.radius) * ratio**effort.small_order * part
        grown = _growth(system, path, length)
        curved = 16 * largest.size / arb(TUBE) ** 2
        centre = (length * defect * grown).abs_upper()
        variation = (length * grown * (curved * centre * size + twist)).abs_upper()
        bend = (length * curved * grown**3 / 2).abs_upper()
        farthest = ((arb(NEAR) - centre) / grown).lower()
        if not (variation.is_finite() and bend.is_finite() and farthest > 0):
            return None
        return Bounds(length, centre, variation, bend, farthest)


def _defect(system: Rates, path: Path, length: Number, order: int) -> Number:
    """|P' - H f(P)| on [0, length], of the coefficients that are enclosed: those below u^(order - 1)."""
    from flint import arb

    worst = arb(0)
    for its, slope in zip(path.state, slope_series(system, path.state, path.start, path.span, order - 1), strict=True):
        found = coefficients_of(slope, order - 1)
        size = arb(0)
        for k in reversed(range(order - 1)):
            known = (k + 1) * its[k + 1] if k + 1 < len(its) else arb(0)
            size = (size * length + (known - found[k]).abs_upper()).abs_upper()
        worst = worst.max(size)
    return worst


def _variation_defect(system: Rates, path: Path, length: Number) -> tuple[Number, Number]:
    """|V' - H Df(P) V| on [0, length] of the coefficients that are enclosed, and |V| there."""
    from flint import arb

    order = len(path.variation)
    jacobian = jacobian_series(system, path.state, path.start, path.span, order)
    twist = arb(0)
    for k in reversed(range(order)):
        its = -sum((jacobian[i] * path.variation[k - i] for i in range(1, k + 1)), jacobian[0] * path.variation[k])
        if k + 1 < order:
            its = its + path.variation[k + 1] * arb(k + 1)
        twist = (twist * length + norm(its)).abs_upper()
    return twist, _variation_size(path, length)


def _variation_size(path: Path, radius: Number) -> Number:
    """|V(u)| for |u| <= radius."""
    from flint import arb

    size = arb(0)
    for its in reversed(path.variation):
        size = (size * radius + norm(its)).abs_upper()
    return size


def _growth(system: Rates, path: Path, length: Number) -> Number:
    """How much a small change can grow by in [0, length], as long as it stays within NEAR of the path.

    In each piece |x_i'| <= sum_j N_ij |x_j|, where N has the largest sizes that entries of H Df take in the piece. So
    the changes, component by component, stay below the solutions of z' = N z, which are exp(N u) z_0.
    """
    from flint import arb_mat

    _, tails = _low_part(path, length)
    size = 2 * system.n
    grown = arb_mat([[int(i == j) for j in range(size)] for i in range(size)])
    for k in range(_PIECES):
        grown = (_piece(system, path, tails, length, k) * (length / _PIECES)).exp() * grown
    return norm(grown)


def _piece(system: Rates, path: Path, tails: list[Number], length: Number, k: int) -> Number:
    """The largest sizes of the entries of H Df in a piece of [0, length] and the real tube, a matrix."""
    from flint import arb, arb_mat

    u = length * (2 * k + 1) / (2 * _PIECES) + arb(0, (length / (2 * _PIECES)).abs_upper())
    state = []
    for its, tail in zip(path.state, tails, strict=True):
        value = arb(0)
        for c in reversed(its[:_LOW]):
            value = value * u + c
        state.append(value + arb(0, (tail + NEAR).abs_upper()))
    rows = [its.slopes for its in system.slope(variables(state), u * path.span + path.start)]
    zero = arb(0)
    return arb_mat([[(row.get(j, zero) * path.span).abs_upper() for j in range(len(rows))] for row in rows])


def norm(matrix: Number) -> Number:
    """The norm of a matrix of balls that belongs to the largest component: the largest sum of a row."""
    from flint import arb

    worst = arb(0)
    for row in matrix.tolist():
        worst = worst.max(sum((its.abs_upper() for its in row), arb(0)))
    return worst.abs_upper()
