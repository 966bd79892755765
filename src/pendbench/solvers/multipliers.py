"""Multipliers that keep rods whole: the forces in the rods of a chain over a step of RATTLE, in O(n) an iteration.

The new rods are linear in the multipliers, their squared lengths quadratic: Newton's method on a tridiagonal system,
that of `rattle`. Its unknowns change little from one step to the next, so the parabola through the last three begins
within an iteration or two.
"""

from __future__ import annotations

from typing import NamedTuple

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.solvers.closing import ROWS, Chain

MOST_ITERATIONS = 12
CLOSE = 1e-12  # how far a rod may be from its length, relative to it
_ROUGH = 1e-3  # from where on the matrix of one iteration will not do for the next
_SMALL, _LARGE = 1e-20, 1e20  # between these, determinants need not be reduced
_LINKS_BETWEEN = 8  # two looks at that: a link makes them twice as large at most, and smaller by its pivot


# The rows of a memory and of a room: see `Rows`. Every room of these has as many as one of `closing`.
KEPT = 8
X, Y, FORCE, FORCE_BEFORE, FORCE_OLDER, SPEED_X, SPEED_Y, TURNS = range(KEPT)
NEW_X, NEW_Y, INVERSE_SQUARE, INERTIA, OFF, BELOW, ABOVE, SHARE, SPARE_X, SPARE_Y, PRODUCT, DETERMINANT = range(ROWS)


class Rows(NamedTuple):
    """The rods, m, and their multipliers now and in the two steps before, N/m, (n + 2,) from place 1 on; their speeds,
    m/s, and how often each went over the top, counter-clockwise positive, (n,).

    In the room, (n,): the new rods, m; 1 / l^2; 1 / (c_i + c_(i+1)), kg; how far new rods are from their lengths, over
    l; and the matrix of the changes of that, over k (c_i + c_(i+1)) and eliminated: what neighbours add to a
    multiplier, what a right side is multiplied by, determinants; (n + 1,): the two off the diagonal, multiplied;
    (n + 2,): two to spare.
    """

    x: FloatArray
    y: FloatArray
    force: FloatArray
    force_before: FloatArray
    force_older: FloatArray
    speed_x: FloatArray
    speed_y: FloatArray
    turns: FloatArray
    new_x: FloatArray
    new_y: FloatArray
    inverse_square: FloatArray
    inertia: FloatArray
    off: FloatArray
    below: FloatArray
    above: FloatArray
    share: FloatArray
    determinant: FloatArray
    product: FloatArray
    spare_x: FloatArray
    spare_y: FloatArray


@inlined
def rows_of(memory: FloatArray, room: FloatArray, n: int) -> Rows:
    """The rows of n rods by their names."""
    m, s, wide = memory, room, n + 2
    return Rows(
        x=m[X, :wide],
        y=m[Y, :wide],
        force=m[FORCE, :wide],
        force_before=m[FORCE_BEFORE, :wide],
        force_older=m[FORCE_OLDER, :wide],
        speed_x=m[SPEED_X, :n],
        speed_y=m[SPEED_Y, :n],
        turns=m[TURNS, :n],
        new_x=s[NEW_X, :n],
        new_y=s[NEW_Y, :n],
        inverse_square=s[INVERSE_SQUARE, :n],
        inertia=s[INERTIA, :n],
        off=s[OFF, :n],
        below=s[BELOW, :n],
        above=s[ABOVE, :n],
        share=s[SHARE, :n],
        determinant=s[DETERMINANT, :n],
        product=s[PRODUCT, : n + 1],
        spare_x=s[SPARE_X, :wide],
        spare_y=s[SPARE_Y, :wide],
    )


@inlined
def prepare_rows(chain: Chain, rows: Rows) -> None:
    """Write what does not change from step to step."""
    for i in range(len(rows.off)):
        rows.inverse_square[i] = 1.0 / (chain.lengths[i] * chain.lengths[i])
        rows.inertia[i] = 1.0 / (chain.couplings[i] + chain.couplings[i + 1])


@inlined
def guess_forces(rows: Rows, last: FloatArray) -> None:
    """Begin from the last multipliers (n + 2,) alone: those before were found with other steps."""
    for i in range(len(last)):
        guess = last[i]
        rows.force[i], rows.force_before[i], rows.force_older[i] = guess, guess, guess


@inlined
def extrapolate_forces(rows: Rows) -> None:
    """The next multipliers, by the parabola through the last three."""
    force, before, older = rows.force, rows.force_before, rows.force_older
    for i in range(len(force)):
        extrapolated = 3.0 * (force[i] - before[i]) + older[i]
        older[i], before[i], force[i] = before[i], force[i], extrapolated


@inlined
def pulls(couplings: FloatArray, force: FloatArray, i: int, kick: float) -> tuple[float, float, float]:
    """By how much a kick, s^2 or s, along rod i's own direction, the next one's and the last one's changes rod i.

    Of the first is added, the others are taken away; s^2 changes the rod, s its speed.
    """
    inner, outer = kick * couplings[i], kick * couplings[i + 1]
    return (inner + outer) * force[i + 1], outer * force[i + 2], inner * force[i]


@inlined
def write_new_rods(chain: Chain, rows: Rows, h: float, kick: float, close: float, rough: float) -> tuple[int, int]:
    """The rods after a step of h s, with k of `kick`, s^2; how many are not `close`, and how many are `rough`.

    Counted, since a loop that looks for the largest does not run in vector registers.
    """
    couplings, x, y, force, off = chain.couplings, rows.x, rows.y, rows.force, rows.off
    open_rods, rough_rods = 0, 0
    for i in range(len(off)):
        own, out, back = pulls(couplings, force, i, kick)
        new_x = x[i + 1] + h * rows.speed_x[i] + own * x[i + 1] - out * x[i + 2] - back * x[i]
        new_y = y[i + 1] + h * rows.speed_y[i] + own * y[i + 1] - out * y[i + 2] - back * y[i]
        rows.new_x[i], rows.new_y[i] = new_x, new_y
        off[i] = 0.5 - 0.5 * rows.inverse_square[i] * (new_x * new_x + new_y * new_y)
        open_rods += not abs(off[i]) <= close
        rough_rods += not abs(off[i]) <= rough
    return open_rods, rough_rods


@inlined
def _write_matrix(chain: Chain, rows: Rows) -> None:
    """How multipliers change the squares of the new rods, over 2 l^2 k (c_i + c_(i+1)), so that units do not matter.

    Own ones, those below and those above.
    """
    couplings, x, y = chain.couplings, rows.x, rows.y
    for i in range(len(rows.off)):
        inner, outer = couplings[i] * rows.inertia[i], couplings[i + 1] * rows.inertia[i]
        new_x, new_y = rows.inverse_square[i] * rows.new_x[i], rows.inverse_square[i] * rows.new_y[i]
        rows.determinant[i] = new_x * x[i + 1] + new_y * y[i + 1]
        rows.below[i] = inner * (new_x * x[i] + new_y * y[i])
        rows.above[i] = outer * (new_x * x[i + 2] + new_y * y[i + 2])


@inlined
def _reduced(determinant: float, before: float) -> tuple[float, float]:
    """A determinant and the one before, over the first where it has become large or small."""
    return (determinant, before) if _SMALL < abs(determinant) < _LARGE else (1.0, before / determinant)


_Corners = tuple[float, float, float, float]


@inlined
def _eliminate_pair(rows: Rows, i: int, j: int, corners: _Corners) -> _Corners:
    """Eliminate rods i and j; the determinants of the corners before them, and of those one smaller, become theirs."""
    inner, inner_before, outer, outer_before = corners
    rows.share[i], rows.share[j] = inner, outer
    inner, inner_before = rows.determinant[i] * inner - rows.product[i] * inner_before, inner
    outer, outer_before = rows.determinant[j] * outer - rows.product[j + 1] * outer_before, outer
    rows.determinant[i], rows.determinant[j] = inner, outer
    return inner, inner_before, outer, outer_before


@inlined
def _eliminate_to_middle(rows: Rows, extra: int, pairs: int) -> _Corners:
    """Eliminate so many rods at each end, but for `extra` that the inner side has more; the corners' determinants.

    Blocks of one length, which the compiler unrolls, take three quarters of the time of a loop that may end anywhere.
    """
    n, whole = len(rows.below), pairs // _LINKS_BETWEEN * _LINKS_BETWEEN
    corners = (1.0, 0.0, 1.0, 0.0)
    for i in range(extra):
        rows.share[i], corners = 1.0, (rows.determinant[i], 1.0, 1.0, 0.0)
    for start in range(0, whole, _LINKS_BETWEEN):
        for k in range(_LINKS_BETWEEN):
            corners = _eliminate_pair(rows, extra + start + k, n - 1 - start - k, corners)
        inner, inner_before, outer, outer_before = corners
        inner, inner_before = _reduced(inner, inner_before)
        outer, outer_before = _reduced(outer, outer_before)
        corners = (inner, inner_before, outer, outer_before)
    for k in range(whole, pairs):
        corners = _eliminate_pair(rows, extra + k, n - 1 - k, corners)
    return corners


@inlined
def _eliminate(rows: Rows, kick: float) -> None:
    """Eliminate the matrix from both ends to the middle: while one waits for a product, the other goes on.

    By determinants of its corners, so that divisions come at the end, where none waits for another.
    """
    below, above, share, determinant, product = rows.below, rows.above, rows.share, rows.determinant, rows.product
    n = len(below)
    for i in range(1, n):
        product[i] = below[i] * above[i - 1]
    product[0], product[n] = 0.0, 0.0
    middle, extra = n // 2, 1 - n % 2  # of an even number the inner side has one more
    inner, inner_before, outer, outer_before = _eliminate_to_middle(rows, extra, middle - extra)
    share[middle] = inner * outer
    pulled, pulled_back = product[middle] * inner_before, product[middle + 1] * outer_before
    determinant[middle] = determinant[middle] * inner * outer - pulled * outer - pulled_back * inner
    over_kick = 1.0 / kick
    for i in range(n):
        change = share[i] / determinant[i]
        below[i] *= change
        above[i] *= change
        share[i] = change * rows.inertia[i] * over_kick


@inlined
def eliminate(chain: Chain, rows: Rows, kick: float) -> None:
    """Write the matrix of the new rods, with k of `kick`, s^2, and eliminate it."""
    _write_matrix(chain, rows)
    _eliminate(rows, kick)


@inlined
def correct(rows: Rows) -> None:
    """Change the multipliers so that, to first order, the new rods get their lengths."""
    force, off, below, above = rows.force, rows.off, rows.below, rows.above
    n = len(off)
    middle, extra = n // 2, 1 - n % 2
    for i in range(n):
        off[i] *= rows.share[i]
    inner, outer = off[0] if extra == 1 else 0.0, 0.0
    for k in range(middle - extra):
        i, j = extra + k, n - 1 - k
        inner, outer = off[i] + below[i] * inner, off[j] + above[j] * outer
        off[i], off[j] = inner, outer
    inner = off[middle] + below[middle] * inner + above[middle] * outer
    off[middle], outer = inner, inner
    for k in range(middle - extra):
        i, j = middle - 1 - k, middle + 1 + k
        inner, outer = off[i] + above[i] * inner, off[j] + below[j] * outer
        off[i], off[j] = inner, outer
    for i in range(extra):
        off[i] += above[i] * inner
    for i in range(n):
        force[i + 1] += off[i]


@inlined
def closes(chain: Chain, rows: Rows, h: float, kick: float, least: int = 0) -> bool:
    """Whether multipliers are found that close a step of h s, in so many iterations at least; leaves the new rods.

    Where no rod is far off, the matrix changes little from one iteration to the next and is not eliminated again.
    """
    again = True
    for iteration in range(MOST_ITERATIONS):
        open_rods, rough = write_new_rods(chain, rows, h, kick, CLOSE, _ROUGH)
        if open_rods == 0 and iteration >= least:
            return True
        if again:
            eliminate(chain, rows, kick)
            again = rough > 0
        correct(rows)
    return False


@inlined
def turns_within(rows: Rows, most: float) -> bool:
    """Whether no rod turns by more than `most`, rad, to the new ones; of its turn, the chord is asked."""
    beyond = 0
    for i in range(len(rows.off)):
        x, y = rows.new_x[i] - rows.x[i + 1], rows.new_y[i] - rows.y[i + 1]
        beyond += not rows.inverse_square[i] * (x * x + y * y) <= most * most
    return beyond == 0


@inlined
def pulls_within(couplings: FloatArray, forces: FloatArray, most: float) -> bool:
    """Whether W^2 of multipliers -T / l, N/m, is at most `most`, 1/s^2; not where one is nan. W is `frame`'s bound.

    couplings (n + 1,) as in `Chain`; forces (n + 2,), from place 1 on.
    """
    beyond = 0
    for i in range(len(couplings) - 1):
        beyond += not 2.0 * (abs(forces[i + 1]) + abs(forces[i + 2])) * couplings[i + 1] <= most
    return beyond == 0
