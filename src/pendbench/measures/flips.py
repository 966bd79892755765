"""Maps of flip times, as pure functions of arrays: their pixels, their edge, and where two of them differ.

A flip time is the time, s, at which a rod first goes over the top: inf where none does, nan where that is not known.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray

Flags = npt.NDArray[np.bool_]

_HALVINGS: Final = 40  # of an interval between two samples: to its rounding


class Agreement(NamedTuple):
    """How flip times agree with those of a map at the same pixels.

    pixels: how many are compared; failed: how many could not be, for want of a time. at_edge: those at the map's edge.
    changed: those whose times differ by more than is allowed; changed_away: those of them away from the edge.
    largest_away: the largest difference away from the edge, s.
    """

    pixels: int
    failed: int
    at_edge: int
    changed: int
    changed_away: int
    largest_away: float


def grid_angles(count: int) -> FloatArray:
    """The centres of `count` pixels from -pi to pi, rad: each has its mirror image to the last bit."""
    return np.asarray((2.0 * np.arange(count) + 1.0 - count) * (math.pi / count))


def pixel_angles(count: int, pixels: npt.NDArray[np.int64]) -> FloatArray:
    """The two release angles (k, 2) rad of pixels (k,), which are numbered row by row: theta_1 chooses the row."""
    grid = grid_angles(count)
    return np.stack([grid[pixels // count], grid[pixels % count]], axis=1)


def coarse_pixels(count: int, coarse: int) -> npt.NDArray[np.int64]:
    """The numbers of coarse x coarse pixels, evenly spaced over the count x count of a map."""
    places = ((2 * np.arange(coarse) + 1) * count) // (2 * coarse)
    return np.asarray((places[:, None] * count + places).ravel())


def difference(one: FloatArray, other: FloatArray) -> FloatArray:
    """By how much flip times differ, s: inf where one chain flips and the other does not, nan where one is unknown."""
    with np.errstate(invalid="ignore"):
        return np.where(one == other, 0.0, np.abs(one - other))


def edge_of(flips: FloatArray, allowed: float) -> Flags:
    """The edge of a map (k, k): pixels whose time differs by more than `allowed` s from one of their eight neighbours'.

    The square's border has no neighbours beyond it: a chain that starts there goes over the top on one side and not on
    the other.
    """
    edge = np.zeros(flips.shape, np.bool_)
    for down, right in itertools.product((-1, 0, 1), repeat=2):
        here, there = _overlap(down, right)
        edge[here] |= difference(flips[here], flips[there]) > allowed
    return edge


def _overlap(down: int, right: int) -> tuple[Any, Any]:
    """Where a map lies upon itself moved by so many pixels: the part that stays, and the part that comes there."""
    cut = {-1: (slice(1, None), slice(None, -1)), 0: (slice(None), slice(None)), 1: (slice(None, -1), slice(1, None))}
    return (cut[down][0], cut[right][0]), (cut[down][1], cut[right][1])


def agreement(flips: FloatArray, expected: FloatArray, edge: Flags, allowed: float) -> Agreement:
    """How flip times (k,) agree with the expected ones, of which `edge` says whether they are at the map's edge."""
    apart = difference(flips, expected)
    known = ~np.isnan(apart)
    changed = known & (apart > allowed)
    away = known & ~edge
    return Agreement(
        pixels=int(known.sum()),
        failed=int((~known).sum()),
        at_edge=int((known & edge).sum()),
        changed=int(changed.sum()),
        changed_away=int((changed & away).sum()),
        largest_away=float(apart[away].max()) if away.any() else math.nan,
    )


def mirrored(flips: FloatArray) -> FloatArray:
    """The map of the mirrored chains, (a, b) in the place of (-a, -b)."""
    return flips[::-1, ::-1]


def first_flip(t: FloatArray, theta: FloatArray, omega: FloatArray) -> float:
    """When an angle first passes +-pi, s, from samples theta, omega (k, n) at t (k,); inf where none does.

    The time is that of the cubic through the angles and rates of the samples before and after.
    """
    over = np.abs(theta) >= math.pi
    rows = np.flatnonzero(over.any(axis=1))
    if not rows.size:
        return math.inf
    after = int(rows[0])
    if after == 0:
        return float(t[0])
    links = np.flatnonzero(over[after])
    pair = slice(after - 1, after + 1)
    return min(_crossing(t[pair], theta[pair, link], omega[pair, link]) for link in links)


def _crossing(t: FloatArray, angle: FloatArray, rate: FloatArray) -> float:
    """When the cubic through two samples passes pi, s, the second of them being beyond: by halving."""
    step, side = t[1] - t[0], math.copysign(1.0, angle[1])
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        beyond = side * _cubic(angle, step * rate, middle) >= math.pi
        low, high = (low, middle) if beyond else (middle, high)
    return float(t[0] + step * high)


def _cubic(value: FloatArray, slope: FloatArray, s: float) -> float:
    """Hermite's cubic at s, from 0 to 1, through two values with their slopes."""
    r = 1.0 - s
    return float(
        r * r * (1.0 + 2.0 * s) * value[0]
        + s * s * (3.0 - 2.0 * s) * value[1]
        + r * r * s * slope[0]
        - s * s * r * slope[1]
    )
