"""Polynomials near the solution, and near how it answers to its start. Nothing is assumed of them: `bounds.py` proves.

Time is u in units of a span H near the radius of convergence: dx/du = H f(x, t_0 + H u). All coefficients are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pendbench.truth.proof.numbers import Number, precision, variables
from pendbench.truth.proof.system import Rates


@dataclass(frozen=True)
class Effort:
    """bits: of midpoints. order: of the solution's polynomial. small_bits, small_order: of its variation's."""

    bits: int
    order: int
    small_bits: int
    small_order: int


@dataclass(frozen=True)
class Path:
    """start: t_0, s, exact. span: H, s. state: (2 n) lists of coefficients. variation: a matrix for each power of u."""

    start: Number
    span: float
    state: list[list[Number]]
    variation: list[Any]


def near_solution(system: Rates, centre: Sequence[Number], start: Number, span: float, effort: Effort) -> Path:
    """A path from a centre (2 n exact numbers) at the time `start`, s.

    Newton's iteration on series: with x known to order m, and V the solution of V' = H Df(x) V, V(0) = 1, the residual
    r = x' - H f(x) is mended by -V int V^-1 r, to order 2 m, or to m + the order of V, which need not be high.
    """
    state = [[value] for value in centre]
    variation: list[Any] = []
    inverse: list[Any] = []
    order = 1
    while order < effort.order:
        grows = order < effort.small_order
        if grows:
            with precision(effort.small_bits, order):
                jacobian = jacobian_series(system, state, start, span, order)
                variation, inverse = _fundamental(jacobian, order)
        following = min(effort.order, order + len(variation))
        with precision(effort.small_bits if following <= effort.small_order else effort.bits, following):
            residual = _residual(system, state, start, span, following)
        with precision(effort.small_bits, following):
            mended = _mended(residual, variation, inverse, following)
        with precision(effort.bits, following):
            state = [_added(old, change) for old, change in zip(state, mended, strict=True)]
        order = following
    with precision(effort.small_bits, effort.small_order):
        jacobian = jacobian_series(system, state, start, span, effort.small_order)
        variation = _fundamental(jacobian, effort.small_order)[0]
    return Path(start, span, state, variation)


def series(coefficients: Sequence[Number], length: int) -> Number:
    """A series known to O(u^length), of which these are the coefficients and all others 0."""
    from flint import arb_series

    return arb_series(list(coefficients[:length]), prec=length)


def clock(start: Number, span: float, length: int) -> Number:
    """The time t_0 + H u as a series."""
    return series([start, start * 0 + span], length)


def slope_series(
    system: Rates, state: Sequence[Sequence[Number]], start: Number, span: float, length: int
) -> list[Number]:
    """H f(P(u), t_0 + H u) to O(u^length), enclosed."""
    x = [series(its, length) for its in state]
    return [its * span for its in system.slope(x, clock(start, span, length))]


def jacobian_series(
    system: Rates, state: Sequence[Sequence[Number]], start: Number, span: float, length: int
) -> list[Any]:
    """H Df(P(u), t_0 + H u) to O(u^length), enclosed: a matrix (2 n, 2 n) for each power of u."""
    from flint import arb_mat

    x = variables([series(its, length) for its in state])
    rows = [(its * span).slopes for its in system.slope(x, clock(start, span, length))]
    entries = [[coefficients_of(row[j], length) if j in row else [0] * length for j in range(len(x))] for row in rows]
    return [arb_mat([[entry[k] for entry in row] for row in entries]) for k in range(length)]


def coefficients_of(its: Number, length: int) -> list[Number]:
    """Of a series that is known so far, with the zeros at its end that it does not keep."""
    from flint import arb

    if isinstance(its, arb):
        return [its] + [arb(0)] * (length - 1)
    if its.prec < length:  # what is not known is not 0
        raise ArithmeticError(f"a series is known to order {its.prec}, and needed to {length}")
    found = list(its.coeffs())
    return found + [arb(0)] * (length - len(found))


def _residual(
    system: Rates, state: Sequence[Sequence[Number]], start: Number, span: float, length: int
) -> list[list[Number]]:
    """P' - H f(P), the first length - 1 coefficients."""
    slopes = slope_series(system, state, start, span, length - 1)
    found = []
    for its, slope in zip(state, slopes, strict=True):
        known = [k * c for k, c in enumerate(its)][1:]
        rest = coefficients_of(-slope, length - 1)
        found.append([*(a + b for a, b in zip(known, rest, strict=False)), *rest[len(known) :]])
    return found


def _fundamental(jacobian: list[Any], length: int) -> tuple[list[Any], list[Any]]:
    """V and W = V^-1 to O(u^length): V' = J V, W' = -W J, both 1 at u = 0. Exact coefficients near them."""
    from flint import arb, arb_mat

    size = jacobian[0].nrows()
    one = arb_mat([[int(i == j) for j in range(size)] for i in range(size)])
    forward, backward = [one], [one]
    for k in range(length - 1):
        there = sum((jacobian[i] * forward[k - i] for i in range(1, k + 1)), jacobian[0] * forward[k])
        back = sum((backward[k - i] * jacobian[i] for i in range(1, k + 1)), backward[k] * jacobian[0])
        forward.append((there * (arb(1) / (k + 1))).mid())
        backward.append((back * (arb(-1) / (k + 1))).mid())
    return forward, backward


def _mended(residual: list[list[Number]], variation: list[Any], inverse: list[Any], length: int) -> list[Number]:
    """-V int V^-1 r."""
    r = [series(its, length - 1) for its in residual]
    inner = [-its.integral() for its in _times(inverse, r)]
    return _times(variation, inner)


def _times(matrices: list[Any], vector: list[Number]) -> list[Number]:
    """A matrix of polynomials, by powers, times a vector of series."""
    size, length = len(vector), vector[0].prec
    tables = [matrix.tolist() for matrix in matrices]
    found = []
    for i in range(size):
        row = [series([table[i][j] for table in tables], length) for j in range(size)]
        found.append(sum((a * b for a, b in zip(row[1:], vector[1:], strict=True)), row[0] * vector[0]))
    return found


def _added(old: list[Number], change: Number) -> list[Number]:
    """The exact coefficients of a sum, whose first is not changed."""
    more = list(change.coeffs())
    padded = old + [old[0] * 0] * (len(more) - len(old))
    return [old[0], *((a + b).mid() for a, b in zip(padded[1:], more[1:], strict=False)), *padded[max(len(more), 1) :]]
