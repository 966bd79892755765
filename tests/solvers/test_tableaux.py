"""The coefficients of the Runge-Kutta methods, against the conditions that give a method its order."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import DOP853 as SCIPY_S

from pendbench.solvers.dop853 import DOP853
from pendbench.solvers.rk4 import RK4

METHODS = {"rk4": RK4, "dop853": DOP853}
ROUNDING = 1e-14  # the largest coefficients of DOP853 are near 50, and are given to 16 digits

# A rooted tree is the tuple of the trees on its root. Each is one condition on the coefficients of a method:
# sum_i b_i weight_i(tree) = 1 / density(tree). Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.2


@cache
def trees(size):
    """All rooted trees with that many nodes: those with one less, and a leaf on any of their nodes."""
    if size == 1:
        return {()}
    return {larger for tree in trees(size - 1) for larger in with_a_leaf(tree)}


def with_a_leaf(tree):
    yield tuple(sorted((*tree, ())))
    for i, branch in enumerate(tree):
        for larger in with_a_leaf(branch):
            yield tuple(sorted((*tree[:i], larger, *tree[i + 1 :])))


def nodes(tree):
    return 1 + sum(map(nodes, tree))


def density(tree):
    return nodes(tree) * math.prod(map(density, tree))


def weight(a, tree):
    return math.prod((a @ weight(a, branch) for branch in tree), start=np.ones(len(a)))


def defects(method, b, size, exact=True):
    """By how much the conditions of all trees of that size are missed."""
    return np.array([b @ weight(method.a, tree) - (1.0 / density(tree) if exact else 0.0) for tree in trees(size)])


def test_trees_are_all_there():
    assert [len(trees(size)) for size in range(1, 10)] == [1, 1, 2, 4, 9, 20, 48, 115, 286]  # Cayley's numbers


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_explicit_and_consistent(method):
    stages = len(method.b)
    assert method.a.shape == (stages, stages)
    assert not np.triu(method.a).any()
    np.testing.assert_allclose(method.a.sum(axis=1), method.c, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(method.b.sum(), 1.0, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_order_is_the_one_claimed_and_no_more(method):
    for size in range(1, method.order + 1):
        np.testing.assert_allclose(defects(method, method.b, size), 0.0, atol=ROUNDING)
    assert np.abs(defects(method, method.b, method.order + 1)).max() > 1e-7


@pytest.mark.parametrize(("weights", "order"), [("error5", 5), ("error3", 3)])
def test_error_estimates_vanish_to_their_order_and_no_further(weights, order):
    error = getattr(DOP853, weights)
    assert error.shape == DOP853.b.shape
    for size in range(1, order + 1):
        np.testing.assert_allclose(defects(DOP853, error, size, exact=False), 0.0, atol=ROUNDING)
    assert np.abs(defects(DOP853, error, order + 1, exact=False)).max() > 1e-5


def test_the_coefficients_are_scipy_s_to_the_last_bit():
    stages = len(DOP853.b)
    for ours, theirs in (
        (DOP853.a, SCIPY_S.A[:stages, :stages]),
        (DOP853.b, SCIPY_S.B),
        (DOP853.c, SCIPY_S.C[:stages]),
        (DOP853.error5, SCIPY_S.E5[:stages]),  # whose last weight, 0, is of the derivative after the step
        (DOP853.error3, SCIPY_S.E3[:stages]),
    ):
        np.testing.assert_array_equal(ours, theirs)
