"""Speeds that keep the rods of a chain whole, from any: the change that pulls along the rods make, in O(n).

equations.md, (E64).
"""

from __future__ import annotations

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.solvers.closing import FORCE_X, FORCE_Y, PULL, ROD_X, ROD_Y, SPARE, Chain


@inlined
def solve_rods(chain: Chain, rows: FloatArray, n: int) -> None:
    """Forces along the rods (ROD of `rows`) that change their speeds along them by SPARE, in place.

    The change of rod i is a_i f_i - c_(i+1) f_(i+1) - c_i f_(i-1), with f along the rods.
    """
    couplings, middle = chain.couplings, n // 2
    for i in range(1, n):
        beside = rows[ROD_X, i] * rows[ROD_X, i - 1] + rows[ROD_Y, i] * rows[ROD_Y, i - 1]
        rows[FORCE_X, i], rows[FORCE_Y, i] = -couplings[i] * beside, couplings[i] + couplings[i + 1]
    rows[FORCE_X, 0], rows[FORCE_X, n], rows[FORCE_Y, 0] = 0.0, 0.0, couplings[1]
    before, after, pull, pull_after = 0.0, 0.0, 0.0, 0.0
    for k in range(middle):  # from both ends: while one waits for a division, the other goes on
        ratio = rows[FORCE_X, k] * before
        before, pull = 1.0 / (rows[FORCE_Y, k] - ratio * rows[FORCE_X, k]), rows[SPARE, k] - ratio * pull
        rows[PULL, k], rows[SPARE, k] = before, pull
        i = n - 1 - k
        if i > middle:
            ratio = rows[FORCE_X, i + 1] * after
            after = 1.0 / (rows[FORCE_Y, i] - ratio * rows[FORCE_X, i + 1])
            pull_after = rows[SPARE, i] - ratio * pull_after
            rows[PULL, i], rows[SPARE, i] = after, pull_after
    inner, outer = rows[FORCE_X, middle], rows[FORCE_X, middle + 1]
    pull = rows[SPARE, middle] - inner * before * pull - outer * after * pull_after
    pull /= rows[FORCE_Y, middle] - inner * inner * before - outer * outer * after
    rows[SPARE, middle], pull_after = pull, pull
    for k in range(middle):
        i = middle - 1 - k
        pull = (rows[SPARE, i] - rows[FORCE_X, i + 1] * pull) * rows[PULL, i]
        rows[SPARE, i] = pull
        i = middle + 1 + k
        if i < n:
            pull_after = (rows[SPARE, i] - rows[FORCE_X, i] * pull_after) * rows[PULL, i]
            rows[SPARE, i] = pull_after
    for i in range(n):
        rows[FORCE_X, i + 1] = rows[SPARE, i] * rows[ROD_X, i]
        rows[FORCE_Y, i + 1] = rows[SPARE, i] * rows[ROD_Y, i]
    for i in (0, n + 1):
        rows[FORCE_X, i], rows[FORCE_Y, i] = 0.0, 0.0


@inlined
def across(chain: Chain, rows: FloatArray, i: int, x: float, y: float) -> float:
    """How fast rod i turns with (x, y) less what FORCE does to it, over a length."""
    c_in, c_out = chain.couplings[i], chain.couplings[i + 1]
    x -= (c_in + c_out) * rows[FORCE_X, i + 1] - c_in * rows[FORCE_X, i] - c_out * rows[FORCE_X, i + 2]
    y -= (c_in + c_out) * rows[FORCE_Y, i + 1] - c_in * rows[FORCE_Y, i] - c_out * rows[FORCE_Y, i + 2]
    across: float = rows[ROD_X, i] * y - rows[ROD_Y, i] * x
    return across / float(chain.lengths[i])
