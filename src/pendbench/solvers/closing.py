"""Rods that close: where the rods of a chain point after an implicit step, and what pulls in them, in O(n).

Every implicit method here asks the same of a step. Its formula says what rod i would be if no rod pulled: q_i. The pull
in a rod, f_i = T_i p_i, moves the masses at its ends, so what is left has to be a rod of its own length:

    l_i u(theta_i) = q_i - (c_i + c_(i+1)) f_i + c_(i+1) f_(i+1) + c_i f_(i-1)         c_(i+1) = 1/m_i, c_1 = 0

u(theta) = (sin theta, -cos theta), and p_i = u at the angle that lies a share w of the way from the old to the new one.
The unknowns are an angle and a pull for each rod: rods are whole at every iterate, turns are followed by themselves,
and Newton's method has blocks of 2 x 2 where coordinates and tensions would make them 3 x 3. Eliminating rod by rod
leaves for the change of the pull df_i

    (S_i + l_i / (w T_i) t_i p'_i^T) df_i = r_i + c_(i+1) df_(i+1)

where t and p' are u and p turned by a quarter; the inverse of the matrix, multiplied out, has no pole at T = 0:

    (w T adj(S) + l p u^T) / (w T det S + l u^T S p)                                            equations.md, (E59)

The chain is eliminated from both ends towards its middle: while one end waits for a result, the other is computed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined, part
from pendbench.solvers.trigonometry import write_directions

#: Of Newton's method, and of a descent.
MOST_ITERATIONS, _MOST_DESCENTS = 12, 200
#: A change of angle, rad, that no iteration recovers from; and one so small that, where it no longer falls, digits end.
_LOST, _ROUNDING = 30.0, 1e-7
TURN = 2.0 * np.pi

# Of a descent, the largest change of an angle, rad: what ends it, what is little, and what is far.
_NEAR, _SMALL, _FAR = 1e-2, 0.5, 2.0

# The rows of `Room.rows`: see there.
ROWS = 12
WANTED_X, WANTED_Y, ANGLE, PULL, ROD_Y, ROD_X, ALONG_Y, ALONG_X, FORCE_X, FORCE_Y, SPARE, GUESS = range(ROWS)

# What is kept of a rod: the inverse matrix (2, 2), the right side, and the two factors that turn it into an angle.
_KEPT = 8


class Chain(NamedTuple):
    """couplings (n + 1,): 0, then the masses' inverses, 1/kg; lengths (n,) and their sum, m; gravity m/s^2."""

    couplings: FloatArray
    lengths: FloatArray
    length: float
    gravity: float


def chain_of(masses: FloatArray, lengths: FloatArray, gravity: float) -> Chain:
    """A chain of masses (n,) kg on rods (n,) m."""
    length = float(np.cumsum(lengths)[-1])  # added from one end to the other, as a loop does
    return Chain(np.concatenate([[0.0], 1.0 / masses]), lengths.copy(), length, float(gravity))


class Room(NamedTuple):
    """Where a step is computed. One thread, one chain.

    rows (ROWS, n + 2): WANTED, what a rod would be without pulls, m; ANGLE, rad, and PULL, kg m: the guess, then the
    answer; ROD and ALONG, unit vectors of the rods and of their pulls; FORCE, kg m, of rod i at place i + 1, with 0 at
    both ends; SPARE, and GUESS of the angles. kept (n, 8).
    """

    rows: FloatArray
    kept: FloatArray


def room_for(n: int) -> Room:
    """Room for n rods."""
    return Room(np.zeros((ROWS, n + 2)), np.empty((n, _KEPT)))


@inlined
def write_rods(angles: FloatArray, rows: FloatArray, row: int, first: int = 0) -> None:
    """Write the unit vectors of angles (n,) into two rows, from place `first` on: first y, -cos, then x, sin."""
    write_directions(angles, rows[row, first:], rows[row + 1, first:])
    for i in range(first, first + len(angles)):
        rows[row, i] = -rows[row, i]


@inlined
def pulled_along(share: float) -> int:
    """The first of the two rows that say where rods pull."""
    return ROD_Y if share == 1.0 else ALONG_Y


@inlined
def write_pulls(rows: FloatArray, angles: FloatArray, share: float, first: int, last: int) -> None:
    """From the angles before (n,) and the iterate: rods `first` to `last` - 1, where their pulls point, the pulls."""
    along = pulled_along(share)
    write_rods(rows[ANGLE, first:last], rows, ROD_Y, first)
    if share < 1.0:
        for i in range(first, last):
            rows[SPARE, i] = angles[i] + share * (rows[ANGLE, i] - angles[i])
        write_rods(rows[SPARE, first:last], rows, ALONG_Y, first)
    for i in range(first, last):
        rows[FORCE_X, i + 1] = rows[PULL, i] * rows[along + 1, i]
        rows[FORCE_Y, i + 1] = rows[PULL, i] * rows[along, i]


Carried = tuple[float, float, float, float, float, float]


@inlined
def eliminate(chain: Chain, room: Room, along: int, share: float, i: int, out: float, carried: Carried) -> Carried:
    """Eliminate rod i towards a neighbour behind the coupling `out`; carried: S's part of the rods before, and r's."""
    couplings, rows, kept = chain.couplings, room.rows, room.kept
    a, length, t = couplings[i] + couplings[i + 1], chain.lengths[i], share * rows[PULL, i]
    x, y, rod_x, rod_y = rows[along + 1, i], rows[along, i], rows[ROD_X, i], rows[ROD_Y, i]
    s_xx, s_xy, s_yx, s_yy, r_x, r_y = carried
    r_x += rows[WANTED_X, i] - length * rod_x - a * rows[FORCE_X, i + 1]
    r_y += rows[WANTED_Y, i] - length * rod_y - a * rows[FORCE_Y, i + 1]
    r_x += couplings[i + 1] * rows[FORCE_X, i + 2] + couplings[i] * rows[FORCE_X, i]
    r_y += couplings[i + 1] * rows[FORCE_Y, i + 2] + couplings[i] * rows[FORCE_Y, i]
    s_xx, s_xy, s_yx, s_yy = a - s_xx, -s_xy, -s_yx, a - s_yy
    # A division waits for the rod before, so all that can be done beside it is done before its result is used.
    xx, xy, yx, yy = length * x * rod_x, length * x * rod_y, length * y * rod_x, length * y * rod_y
    inverse = 1.0 / (t * (s_xx * s_yy - s_xy * s_yx) + ((s_xx * xx + s_xy * yx) + (s_yx * xy + s_yy * yy)))
    c_xx, c_xy, c_yx, c_yy = t * s_yy + xx, xy - t * s_xy, yx - t * s_yx, t * s_xx + yy
    k_x, k_y = s_xx * x + s_xy * y, s_yx * x + s_yy * y
    kept[i, 6], kept[i, 7] = k_x * inverse, k_y * inverse
    square = out * out
    carried_xx, carried_xy = (square * c_xx) * inverse, (square * c_xy) * inverse
    carried_yx, carried_yy = (square * c_yx) * inverse, (square * c_yy) * inverse
    c_xx, c_xy, c_yx, c_yy = c_xx * inverse, c_xy * inverse, c_yx * inverse, c_yy * inverse
    kept[i, 0], kept[i, 1], kept[i, 2], kept[i, 3], kept[i, 4], kept[i, 5] = c_xx, c_xy, c_yx, c_yy, r_x, r_y
    g_x, g_y = out * (c_xx * r_x + c_xy * r_y), out * (c_yx * r_x + c_yy * r_y)
    return carried_xx, carried_xy, carried_yx, carried_yy, g_x, g_y


@inlined
def substitute(room: Room, along: int, i: int, r_x: float, r_y: float, worst: float) -> tuple[float, float, float]:
    """Change rod i, whose right side is (r_x, r_y) now; its own pull's change, and the worst turn."""
    rows, kept = room.rows, room.kept
    x, y = kept[i, 0] * r_x + kept[i, 1] * r_y, kept[i, 2] * r_x + kept[i, 3] * r_y
    turn = kept[i, 6] * r_y - kept[i, 7] * r_x
    rows[ANGLE, i] += turn
    rows[PULL, i] += rows[along + 1, i] * x + rows[along, i] * y
    size = abs(turn)
    return x, y, (size if size > worst or np.isnan(size) else worst)  # nan is kept


@inlined
def meet(chain: Chain, room: Room, share: float, i: int, inner: Carried, outer: Carried) -> tuple[float, float, float]:
    """Change rod i, at which both ends meet: how its pull changes, and its turn."""
    s_xx, s_xy, s_yx, s_yy = inner[0] + outer[0], inner[1] + outer[1], inner[2] + outer[2], inner[3] + outer[3]
    both, along = (s_xx, s_xy, s_yx, s_yy, inner[4] + outer[4], inner[5] + outer[5]), pulled_along(share)
    eliminate(chain, room, along, share, i, 0.0, both)
    return substitute(room, along, i, room.kept[i, 4], room.kept[i, 5], 0.0)


@part
def _iterate(chain: Chain, room: Room, angles: FloatArray, share: float) -> float:
    """One of Newton's steps; returns the largest change of an angle, rad."""
    couplings, kept, n = chain.couplings, room.kept, len(angles)
    middle, along = n // 2, pulled_along(share)
    write_pulls(room.rows, angles, share, 0, n)
    left = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    right = left
    for k in range(middle):
        left = eliminate(chain, room, along, share, k, couplings[k + 1], left)
        if k < n - 1 - middle:
            right = eliminate(chain, room, along, share, n - 1 - k, couplings[n - 1 - k], right)
    x, y, worst = meet(chain, room, share, middle, left, right)
    right_x, right_y = x, y
    for k in range(middle):
        i, out = middle - 1 - k, couplings[middle - k]
        x, y, worst = substitute(room, along, i, kept[i, 4] + out * x, kept[i, 5] + out * y, worst)
        if k < n - 1 - middle:
            i, out = middle + 1 + k, couplings[middle + 1 + k]
            r_x, r_y = kept[i, 4] + out * right_x, kept[i, 5] + out * right_y
            right_x, right_y, worst = substitute(room, along, i, r_x, r_y, worst)
    return worst


@inlined
def keep_guess(room: Room, angles: FloatArray, first: int, last: int) -> float:
    """Keep the guesses of rods `first` to `last` - 1; the largest turn that they have, rad."""
    rows, turn = room.rows, 0.0
    for i in range(first, last):
        rows[GUESS, i] = rows[ANGLE, i]
        turn = max(turn, abs(rows[ANGLE, i] - angles[i]))
    return turn


@inlined
def settle(room: Room, share: float, first: int, last: int) -> None:
    """Turn back the rods that went round more often than their guess, and leave them in `room`."""
    rows = room.rows
    for i in range(first, last):
        turns = np.rint((rows[ANGLE, i] - rows[GUESS, i]) / TURN)
        rows[ANGLE, i] -= TURN * turns
        if share < 1.0 and turns % 2.0 != 0.0:  # half a turn back, the mean of old and new points the other way
            rows[PULL, i] = -rows[PULL, i]
    write_rods(rows[ANGLE, first:last], rows, ROD_Y, first)


def closed(worst: float, before: float, enough: float) -> bool:
    """Whether Newton's method ends: what it changes, rad, is little, or no longer falls since digits end."""
    return worst <= enough or before <= worst < _ROUNDING


def lost(worst: float, before: float, count: int) -> bool:
    """Whether it will not: after so many iterations before this one."""
    return not worst < _LOST or (count > 2 and worst > before)


_closed, _lost = inlined(closed), inlined(lost)


@compiled
def close(chain: Chain, room: Room, angles: FloatArray, share: float, tolerance: float) -> bool:
    """Find the angles and pulls that close the chain, from the guess in `room`; False where they are not found.

    angles (n,) rad: those before the step. share: w above. Ends with a change of the angles of at most `tolerance`
    (rad), and of the square of the largest turn that the guess has: what is left is of the order of the change's
    square, and a formula of order 2 leaves that turn's cube. A rod that went round more often than its guess is turned
    back: a direction says nothing of full turns, the motion does. Leaves the rods in `room`.
    """
    n, before = len(angles), np.inf
    turn = keep_guess(room, angles, 0, n)
    for count in range(MOST_ITERATIONS):
        worst = _iterate(chain, room, angles, share)
        if _closed(worst, before, min(tolerance, turn * turn)):
            settle(room, share, 0, n)
            return True
        if _lost(worst, before, count):
            return False
        before = worst
    return False


@part
def _misfit(chain: Chain, rows: FloatArray, n: int) -> float:
    """How far the masses are from where they would be without pulls: half the sum of m d^2, kg m^2; d in FORCE."""
    write_rods(rows[ANGLE, :n], rows, ROD_Y)
    x, y, total = 0.0, 0.0, 0.0
    for i in range(n):
        x += chain.lengths[i] * rows[ROD_X, i] - rows[WANTED_X, i]
        y += chain.lengths[i] * rows[ROD_Y, i] - rows[WANTED_Y, i]
        rows[FORCE_X, i + 1], rows[FORCE_Y, i + 1] = x, y
        total += (x * x + y * y) / chain.couplings[i + 1]
    return 0.5 * total


@inlined
def _write_tensions(chain: Chain, rows: FloatArray, n: int) -> float:
    """The pulls that the misfit asks for along the rods, where they are tensions: these make the descent convex.

    Returns the largest pull that it asks for in any direction, kg m.
    """
    x, y, most = 0.0, 0.0, 0.0
    for i in range(n - 1, -1, -1):
        x -= rows[FORCE_X, i + 1] / chain.couplings[i + 1]
        y -= rows[FORCE_Y, i + 1] / chain.couplings[i + 1]
        rows[PULL, i] = max(0.0, x * rows[ROD_X, i] + y * rows[ROD_Y, i])
        most = max(most, x * x + y * y)
    return float(np.sqrt(most))


@compiled
def descend(chain: Chain, room: Room, angles: FloatArray) -> None:
    """From any guess in `room`, for w = 1, go to where the chain closes, near enough for `close`. angles (n,) rad.

    What closes is where the masses are nearest to where they would be without pulls (`_misfit`), and that is somewhere.
    Newton's step is shortened by a pull that is added to all rods, the larger the worse it went (Levenberg and
    Marquardt; Nocedal and Wright, Numerical Optimization, 10.3): it falls while rods turn little and rises while they
    turn far.
    """
    rows, n = room.rows, len(angles)
    for i in range(n):
        rows[GUESS, i] = rows[ANGLE, i]
    misfit = _misfit(chain, rows, n)
    # No more than any pull: far from where masses would be, the misfit grows with the square of how far, pulls do not,
    # and so much added would keep the first step as small as the last.
    added = min(misfit / chain.length, _write_tensions(chain, rows, n))
    for _ in range(_MOST_DESCENTS):
        _write_tensions(chain, rows, n)
        for i in range(n):
            rows[SPARE, i] = rows[ANGLE, i]
            rows[PULL, i] += added
        worst, before = _iterate(chain, room, angles, 1.0), misfit
        misfit = _misfit(chain, rows, n)
        if not misfit <= before:
            for i in range(n):
                rows[ANGLE, i] = rows[SPARE, i]
            misfit, added = _misfit(chain, rows, n), 9.0 * added
        elif worst < _NEAR:
            break
        elif not _SMALL < worst < _FAR:
            added *= 3.0 if worst > _SMALL else 0.1
    for i in range(n):
        rows[ANGLE, i] -= TURN * np.rint((rows[ANGLE, i] - rows[GUESS, i]) / TURN)
