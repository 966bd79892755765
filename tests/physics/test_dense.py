"""The dense equations of motion against results that were found without them."""

from __future__ import annotations

import gc
import weakref

import mpmath
import numpy as np
import pytest
from scipy.linalg import LinAlgError

from pendbench.physics import dense
from pendbench.scene.scene import Effects, Scene
from support.misprint import accelerations_as_printed, coupling_matrix_as_printed

GRAVITY = 9.81
ROUNDING = 1e-13  # relative to the largest acceleration; a dense solve with like masses and n <= 6 stays below it


def chain(masses, lengths, gravity=GRAVITY):
    n = len(masses)
    return Scene("test", "", 1.0, masses, lengths, np.zeros(n), np.zeros(n), Effects(gravity=gravity))


def random_chain(rng, n, gravity=GRAVITY):
    return chain(rng.uniform(0.5, 2.0, n), rng.uniform(0.5, 2.0, n), gravity)


def random_state(rng, n):
    return rng.uniform(-4.0, 4.0, n), rng.uniform(-5.0, 5.0, n)


def assert_same(found, expected, tolerance=ROUNDING):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())


def double_pendulum(scene, theta, omega):
    """The double pendulum as textbooks print it, solved for theta'' by hand."""
    (m1, m2), (l1, l2), (a1, a2), (w1, w2), g = scene.masses, scene.lengths, theta, omega, GRAVITY
    sin, cos = np.sin(a1 - a2), np.cos(a1 - a2)
    below = 2 * m1 + m2 - m2 * np.cos(2 * a1 - 2 * a2)
    first = -g * (2 * m1 + m2) * np.sin(a1) - m2 * g * np.sin(a1 - 2 * a2)
    first -= 2 * sin * m2 * (w2**2 * l2 + w1**2 * l1 * cos)
    second = 2 * sin * (w1**2 * l1 * (m1 + m2) + g * (m1 + m2) * np.cos(a1) + w2**2 * l2 * m2 * cos)
    return np.array([first / (l1 * below), second / (l2 * below)])


def fifty_digits(scene, theta, omega):
    """C theta'' = S omega^2 - h, written out element by element and solved with 50 digits."""
    number, n = mpmath.mpf, scene.n
    m, l, a, w = ([number(float(v)) for v in part] for part in (scene.masses, scene.lengths, theta, omega))  # noqa: E741
    with mpmath.workdps(50):
        left, right = mpmath.matrix(n, n), mpmath.matrix(n, 1)
        for i in range(n):
            right[i] = -sum(m[i:]) * number(GRAVITY) * l[i] * mpmath.sin(a[i])
            for j in range(n):
                weight = sum(m[max(i, j) :]) * l[i] * l[j]
                left[i, j] = weight * mpmath.cos(a[i] - a[j])
                right[i] += weight * mpmath.sin(a[j] - a[i]) * w[j] ** 2
        return np.array([float(x) for x in mpmath.lu_solve(left, right)])


def test_hanging_masses_are_sums_from_the_tip():
    np.testing.assert_array_equal(dense.hanging_masses(np.array([1.0, 2.0, 4.0])), [7.0, 6.0, 4.0])


def test_one_link_is_the_pendulum_of_the_textbook():
    scene = chain([3.0], [0.7])
    found = dense.accelerations(scene, np.array([0.4]), np.array([5.0]))
    np.testing.assert_allclose(found, [-GRAVITY / 0.7 * np.sin(0.4)], rtol=4 * np.finfo(float).eps)


@pytest.mark.parametrize("seed", range(5))
def test_two_links_are_the_double_pendulum_of_the_textbook(seed):
    rng = np.random.default_rng(seed)
    scene, state = random_chain(rng, 2), random_state(rng, 2)
    assert_same(dense.accelerations(scene, *state), double_pendulum(scene, *state))


@pytest.mark.parametrize("n", [1, 3, 6])
def test_fifty_digits_agree(n):
    rng = np.random.default_rng(n)
    scene, state = random_chain(rng, n), random_state(rng, n)
    assert_same(dense.accelerations(scene, *state), fifty_digits(scene, *state))


def test_matrices_have_the_symmetry_of_the_lagrangian():
    rng = np.random.default_rng(1)
    scene, (theta, _) = random_chain(rng, 5), random_state(rng, 5)
    mass, coupling = dense.mass_matrix(scene, theta), dense.coupling_matrix(scene, theta)
    np.testing.assert_array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass).min() > 0.0
    np.testing.assert_array_equal(coupling, -coupling.T)


def test_misprinted_coupling_is_symmetric_where_it_must_not_be():
    rng = np.random.default_rng(1)
    scene, (theta, omega) = random_chain(rng, 5), random_state(rng, 5)
    printed, right = coupling_matrix_as_printed(scene, theta), dense.coupling_matrix(scene, theta)
    np.testing.assert_array_equal(printed, printed.T)
    np.testing.assert_array_equal(printed[0], right[0])
    assert np.all(np.abs((printed - right)[1:] @ omega**2) > 1e-3)


@pytest.mark.parametrize("n", [2, 3])
def test_misprint_fails_what_the_corrected_equations_pass(n):
    rng = np.random.default_rng(n)
    scene, state = random_chain(rng, n), random_state(rng, n)
    expected = fifty_digits(scene, *state)
    with pytest.raises(AssertionError):
        assert_same(accelerations_as_printed(scene, *state), expected, tolerance=1e-2)


def test_hanging_at_rest_stays():
    scene = chain([1.0, 2.0, 3.0], [1.0, 1.0, 1.0])
    np.testing.assert_array_equal(dense.accelerations(scene, np.zeros(3), np.zeros(3)), np.zeros(3))


def test_straight_chain_turning_without_gravity_keeps_turning():
    scene = chain([1.0, 2.0, 3.0], [1.0, 0.5, 2.0], gravity=None)
    found = dense.accelerations(scene, np.full(3, 0.7), np.full(3, 4.0))
    np.testing.assert_array_equal(found, np.zeros(3))


def test_absent_gravity_is_gravity_zero():
    rng = np.random.default_rng(2)
    scene, state = random_chain(rng, 4), random_state(rng, 4)
    absent, zero = (chain(scene.masses, scene.lengths, gravity) for gravity in (None, 0.0))
    np.testing.assert_array_equal(dense.accelerations(absent, *state), dense.accelerations(zero, *state))
    assert np.abs(dense.accelerations(scene, *state) - dense.accelerations(absent, *state)).max() > 0.1


def test_mirror_image_accelerates_the_other_way():
    rng = np.random.default_rng(3)
    scene, (theta, omega) = random_chain(rng, 5), random_state(rng, 5)
    np.testing.assert_array_equal(dense.accelerations(scene, -theta, -omega), -dense.accelerations(scene, theta, omega))


def test_motion_backwards_accelerates_the_same_way():
    rng = np.random.default_rng(4)
    scene, (theta, omega) = random_chain(rng, 5), random_state(rng, 5)
    np.testing.assert_array_equal(dense.accelerations(scene, theta, -omega), dense.accelerations(scene, theta, omega))


def test_masses_in_another_unit_change_nothing():
    rng = np.random.default_rng(5)
    scene, state = random_chain(rng, 5), random_state(rng, 5)
    heavier = chain(16.0 * scene.masses, scene.lengths)  # a power of two: to the bit, but for the solver's square roots
    assert_same(dense.accelerations(heavier, *state), dense.accelerations(scene, *state))


def test_four_times_the_length_is_half_the_speed():
    rng = np.random.default_rng(6)
    scene, (theta, omega) = random_chain(rng, 5), random_state(rng, 5)
    longer = chain(scene.masses, 4.0 * scene.lengths)
    assert_same(dense.accelerations(longer, theta, omega / 2.0), dense.accelerations(scene, theta, omega) / 4.0)


def test_turning_the_whole_chain_matters_only_to_gravity():
    rng = np.random.default_rng(7)
    free, (theta, omega) = random_chain(rng, 5, gravity=None), random_state(rng, 5)
    assert_same(dense.accelerations(free, theta + 1.0, omega), dense.accelerations(free, theta, omega))


def test_dense_solve_loses_digits_where_the_documentation_says_so():
    """equations.md, "Why not solve the dense system": a heavy tip on a nearly straight chain."""
    scene = chain([1.0, 1e8], [1.0, 1.0])
    state = np.array([1.0, 1.0 + 1e-4]), np.array([1.0, -2.0])
    expected = fifty_digits(scene, *state)
    error = np.abs(dense.accelerations(scene, *state) - expected).max() / np.abs(expected).max()
    assert 1e-10 < error < 1e-6


def test_mass_matrix_ruined_by_rounding_is_an_error():
    scene = chain([1e-20, 1.0], [1.0, 1.0])
    with pytest.raises(LinAlgError):
        dense.accelerations(scene, np.array([0.5, 0.5]), np.zeros(2))


FORMS = (dense.mass_matrix, dense.coupling_matrix, dense.weight_torques)


@pytest.mark.parametrize("form", FORMS)
def test_what_is_kept_of_a_scene_is_its_own(form):
    """Asked in turn, and with what came back written over, each scene gives what another of its kind gives afresh."""
    theta = np.array([0.3, -1.1, 2.0])
    one = chain([1.0, 2.0, 3.0], [1.0, 0.5, 0.7]).with_(rod_mass=0.2, armature=0.1)
    other = one.with_(masses=[3.0, 2.0, 1.0], armature=0.4)
    expected = [form(scene.with_(), theta) for scene in (one, other)]
    assert not np.array_equal(*expected)
    for _ in range(2):
        for scene, right in zip((one, other), expected, strict=True):
            found = form(scene, theta)
            np.testing.assert_array_equal(found, right)
            found *= 2.0


def test_what_is_kept_of_a_scene_ends_with_it():
    scene = chain([1.0, 2.0], [1.0, 0.5])
    dense.accelerations(scene, np.ones(2), np.ones(2))
    gone = weakref.ref(scene)
    del scene
    gc.collect()
    assert gone() is None
