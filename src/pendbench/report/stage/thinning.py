"""What is drawn is thinned, never what is computed: how many points of a chain and how many moments go into a page."""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray

Indices = npt.NDArray[np.int64]

#: What the chains of a page may take, bytes: base64 makes it a third more, and a page is to stay below 3 MB.
_BYTES: Final = 1_700_000
_A_POINT, _A_TIME = 4, 8  # bytes: two numbers of 16 bits, one of 64
_MOST_POINTS: Final = 160
_MOST_MOMENTS: Final = 1201
_FEWEST_MOMENTS: Final = 2
_MOST_POINTS_OF_CURVE: Final = 1400


def points_drawn(n: int) -> Indices:
    """Which of the pivot (0) and the masses (1 to n) are drawn, both ends among them."""
    return _spread(n + 1, _MOST_POINTS)


def moments_drawn(k: int, points: int, bodies: int) -> Indices:
    """Which of k samples of a run are drawn, where the page shows so many bodies of so many points."""
    room = _BYTES // ((_A_POINT * points + _A_TIME) * max(1, bodies))
    return _spread(k, max(_FEWEST_MOMENTS, min(room, _MOST_MOMENTS)))


def _spread(count: int, most: int) -> Indices:
    """At most `most` of `count` places, evenly, the first and the last among them."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).round().astype(np.int64))


def curve_drawn(values: FloatArray, most: int = _MOST_POINTS_OF_CURVE) -> Indices:
    """Which of the values (k,) of a curve are drawn: all, or the smallest and the largest of each of many bins."""
    k = len(values)
    if k <= most:
        return np.arange(k)
    edges = np.linspace(0, k, max(1, most // 2) + 1).astype(np.int64)
    kept = [low + np.array([np.argmin(part), np.argmax(part)]) for low, part in _parts(values, edges)]
    return np.unique(np.concatenate([[0, k - 1], *kept]))


def _parts(values: FloatArray, edges: Indices) -> list[tuple[int, FloatArray]]:
    known = np.nan_to_num(values, nan=0.0, posinf=np.finfo(np.float64).max)
    return [(int(low), known[low:high]) for low, high in itertools.pairwise(edges)]
