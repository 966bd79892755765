"""The inner terms of products of series, lane by lane, against sums written out."""

from __future__ import annotations

import numpy as np
import pytest

from pendbench.base.compiled import compiled
from pendbench.solvers.convolution import convolution, factors

ORDERS, COUNT = 20, 3
_SUMS = {lanes: convolution(lanes) for lanes in (4, 12)}


@pytest.mark.parametrize("lanes", _SUMS)
def test_each_order_is_the_sum_of_its_inner_terms(lanes):
    kernel = _SUMS[lanes]

    @compiled
    def inner(left, right, i, k, sums, even, odd):
        kernel(left, right, i, k, sums, even, odd)

    rng = np.random.default_rng(lanes)
    left, right = factors(COUNT, ORDERS, lanes), factors(COUNT, ORDERS, lanes)
    sums = np.full((2 * COUNT, lanes), np.nan)  # what an earlier series left
    for k in range(1, ORDERS):
        for known in (left, right):  # an order is not known before its turn, and its own outer terms never
            known[:, k - 1], known[:, k:] = rng.standard_normal((COUNT, lanes)), np.nan
        for i in range(COUNT):
            inner(left, right, i, k, sums, i, COUNT + i)
            expected = sum((left[i, j] * right[i, k - j] for j in range(1, k)), np.zeros(lanes))
            found = sums[COUNT + i if k % 2 else i]
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * ORDERS)


def test_no_vector_straddles_two_lines_of_the_cache():
    for count in range(1, 6):
        assert factors(count, 7, 12).ctypes.data % 64 == 0
