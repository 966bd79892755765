"""The Lagrangian of three links, by computer algebra: the corrected equations follow, the printed ones do not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy as sp

from pendbench.physics import dense
from pendbench.scene.scene import Effects, Scene

N = 3
LINKS = range(N)
MASS = sp.symbols(f"m1:{N + 1}", positive=True)
LENGTH = sp.symbols(f"l1:{N + 1}", positive=True)
G = sp.Symbol("g", positive=True)
ANGLE = sp.symbols(f"theta1:{N + 1}")
RATE = sp.symbols(f"omega1:{N + 1}")
ACCELERATION = sp.symbols(f"alpha1:{N + 1}")
SIN = sp.symbols(f"s1:{N + 1}")
COS = sp.symbols(f"c1:{N + 1}")


def hanging(k):
    """M_k, from rod k (counted from 0) outwards."""
    return sum(MASS[k:])


def weight(i, j):
    """M_max(i,j) l_i l_j."""
    return hanging(max(i, j)) * LENGTH[i] * LENGTH[j]


def mass_entry(i, j):
    return weight(i, j) * sp.cos(ANGLE[i] - ANGLE[j])


def coupling_entry(i, j):
    return weight(i, j) * sp.sin(ANGLE[j] - ANGLE[i])


def gravity_torque(i):
    return hanging(i) * G * LENGTH[i] * sp.sin(ANGLE[i])


def coupling_entry_as_printed(i, j):
    """Equation (19) of the note, with its two branches."""
    return weight(i, j) * sp.sin(ANGLE[i] - ANGLE[j] if i >= j else ANGLE[j] - ANGLE[i])


def is_zero(expression):
    """Whether an expression vanishes identically: as a polynomial in sines and cosines, modulo sin^2 + cos^2 = 1."""
    parts = dict(zip([*map(sp.sin, ANGLE), *map(sp.cos, ANGLE)], [*SIN, *COS], strict=True))
    rest = sp.expand(sp.expand_trig(sp.expand(expression)).xreplace(parts))
    for s, c in zip(SIN, COS, strict=True):
        rest = sp.rem(rest, s**2 + c**2 - 1, s)
    return rest.expand() == 0


def rate(expression):
    """The rate of an expression in the angles."""
    return sum(sp.diff(expression, ANGLE[j]) * RATE[j] for j in LINKS)


@cache
def lagrangian():
    """T - U from the positions of the masses in the plane; nothing of the note is used."""
    x = [sum(LENGTH[j] * sp.sin(ANGLE[j]) for j in range(i + 1)) for i in LINKS]
    y = [-sum(LENGTH[j] * sp.cos(ANGLE[j]) for j in range(i + 1)) for i in LINKS]
    speed_squared = [rate(x[i]) ** 2 + rate(y[i]) ** 2 for i in LINKS]
    return sum(MASS[i] * speed_squared[i] / 2 - MASS[i] * G * y[i] for i in LINKS)


@cache
def minus_slope(i):
    """-dL/dtheta_i."""
    return -sp.diff(lagrangian(), ANGLE[i])


@cache
def momentum_rate(i):
    """d/dt dL/domega_i, with the chain rule written out."""
    momentum = sp.diff(lagrangian(), RATE[i])
    return rate(momentum) + sum(sp.diff(momentum, RATE[j]) * ACCELERATION[j] for j in LINKS)


def euler_lagrange(i):
    """The left side of the Euler-Lagrange equation of rod i."""
    return momentum_rate(i) + minus_slope(i)


def row(i, coupling):
    """Row i of C theta'' - S omega^2 + h."""
    accelerated = sum(mass_entry(i, j) * ACCELERATION[j] for j in LINKS)
    return accelerated - sum(coupling(i, j) * RATE[j] ** 2 for j in LINKS) + gravity_torque(i)


@pytest.mark.parametrize("i", LINKS)
def test_corrected_equations_are_the_lagrangian_s(i):
    assert is_zero(euler_lagrange(i) - row(i, coupling_entry))


def test_printed_19_is_wrong_in_every_row_but_the_first():
    assert is_zero(euler_lagrange(0) - row(0, coupling_entry_as_printed))
    for i in (1, 2):
        assert not is_zero(euler_lagrange(i) - row(i, coupling_entry_as_printed))


def test_printed_19_is_mended_by_its_sign_alone():
    for i in (1, 2):
        mended = row(i, lambda i, j: coupling_entry_as_printed(i, j) * (-1 if i >= j else 1))
        assert is_zero(euler_lagrange(i) - mended)


def slope_sum(d, others):
    """The corrected terms of (11) for the given other rods."""
    return sum(weight(d, i) * RATE[d] * RATE[i] * sp.sin(ANGLE[d] - ANGLE[i]) for i in others)


@pytest.mark.parametrize("d", LINKS)
def test_erratum_11_needs_the_sine_and_the_rates(d):
    inner, outer = range(d), range(d + 1, N)
    assert is_zero(minus_slope(d) - slope_sum(d, inner) - slope_sum(d, outer) - gravity_torque(d))
    printed = sum(weight(d, i) * sp.cos(ANGLE[i] - ANGLE[d]) for i in outer)
    with_rates = sum(weight(d, i) * RATE[d] * RATE[i] * sp.cos(ANGLE[i] - ANGLE[d]) for i in outer)
    for wrong in (printed, with_rates):
        mended = is_zero(minus_slope(d) - slope_sum(d, inner) - wrong - gravity_torque(d))
        assert mended == (len(outer) == 0)  # the tip has no second sum to be wrong


@pytest.mark.parametrize("d", LINKS)
def test_erratum_12_needs_the_acceleration(d):
    rest = row(d, coupling_entry) - weight(d, d) * ACCELERATION[d]
    assert is_zero(euler_lagrange(d) - rest - weight(d, d) * ACCELERATION[d])
    assert not is_zero(euler_lagrange(d) - rest - weight(d, d) * RATE[d])


def test_erratum_13_needs_the_acceleration_unsquared():
    rest = row(2, coupling_entry) - weight(2, 2) * ACCELERATION[2]
    assert is_zero(euler_lagrange(2) - rest - weight(2, 2) * ACCELERATION[2])
    assert not is_zero(euler_lagrange(2) - rest - weight(2, 2) * ACCELERATION[2] ** 2)


def test_erratum_20_needs_the_sine():
    assert is_zero(coupling_entry(2, 0) - weight(2, 0) * sp.sin(ANGLE[0] - ANGLE[2]))
    rest = row(2, lambda i, j: 0 if j == 0 else coupling_entry(i, j))
    assert is_zero(euler_lagrange(2) - rest + weight(2, 0) * sp.sin(ANGLE[0] - ANGLE[2]) * RATE[0] ** 2)
    assert not is_zero(euler_lagrange(2) - rest + weight(2, 0) * sp.cos(ANGLE[0] - ANGLE[2]) * RATE[0] ** 2)


def test_dense_form_is_the_lagrangian_s():
    """What the package computes, against what the derivation gives, in numbers."""
    rng = np.random.default_rng(1)
    masses, lengths, angles, rates = rng.uniform(0.5, 2.0, (4, N))
    equations = [euler_lagrange(i) for i in LINKS]
    derived_mass = sp.Matrix(N, N, lambda i, j: sp.diff(equations[i], ACCELERATION[j]))
    derived_coupling = sp.Matrix(N, N, lambda i, j: -sp.diff(equations[i], RATE[j], 2) / 2)
    derived_gravity = [G * sp.diff(equations[i], G) for i in LINKS]
    scene = Scene("test", "", 1.0, masses, lengths, angles, rates, Effects(gravity=9.81))
    symbols = (*MASS, *LENGTH, *ANGLE, *RATE, G)
    values = (*masses, *lengths, *angles, *rates, 9.81)
    for derived, found in (
        (derived_mass, dense.mass_matrix(scene, angles)),
        (derived_coupling, dense.coupling_matrix(scene, angles)),
        (derived_gravity, dense.weight_torques(scene, angles)),
    ):
        np.testing.assert_allclose(found, sp.lambdify(symbols, derived)(*values), rtol=0, atol=1e-13)
