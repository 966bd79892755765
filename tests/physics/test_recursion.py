"""The O(n) recursion against the dense form, against 50 digits, and against Newton."""

from __future__ import annotations

import numpy as np
import pytest

from pendbench.base.errors import InputError
from pendbench.physics import dense, energy
from pendbench.physics.kernels import recursion
from pendbench.physics.kernels.recursion import accelerations, system_of, tensions
from pendbench.scene.scene import Effects, Scene
from support.hard_chains import GRAVITY, HARD, exact_accelerations, hard_chains, relative_error
from support.scenes import chain, random_chain

EPS = np.finfo(float).eps


def at_start(function, scene):
    return function(scene, scene.angles, scene.rates)


def assert_same(found, expected, tolerance):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())


@pytest.mark.parametrize("gravity", [GRAVITY, None])
@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 9, 10, 11, 30])
def test_dense_form_agrees(n, gravity):
    for seed in range(5):
        scene = random_chain(n, seed, spread=4.0, gravity=gravity)
        # What the dense solve loses grows with n: 1e-13 was measured at n = 30.
        assert_same(at_start(accelerations, scene), at_start(dense.accelerations, scene), 1e-12)


@pytest.mark.parametrize("kind", HARD)
def test_fifty_digits_agree(kind):
    errors = [relative_error(at_start(accelerations, s), exact_accelerations(s)) for s in hard_chains(kind, range(20))]
    # Measured over 1200 states: masses 7e-15; lengths 2e-14, which a last digit of theirs more or less changes too.
    assert max(errors) < (1e-13 if kind.startswith("lengths") else 2e-14)
    assert np.median(errors) < 2 * EPS


def test_dense_form_has_lost_what_the_recursion_keeps():
    """Otherwise the table of hard chains would not be hard."""
    for scene in hard_chains("tip 1e8, nearly straight", range(3)):
        exact = exact_accelerations(scene)
        assert relative_error(at_start(dense.accelerations, scene), exact) > 1e-12


def test_long_chains_keep_their_digits():
    scene = random_chain(60, seed=1, spread=4.0)
    assert relative_error(at_start(accelerations, scene), exact_accelerations(scene)) < 1e-14


def test_bend_between_large_angles_keeps_its_digits():
    """After many turns the angles' difference is rounded, which a light mass beside heavy ones would show."""
    angles = np.array([0.3, -1e6 + 0.1, 1e6 - 0.7])
    scene = chain(3, angle=angles, rate=[1.0, -2.0, 0.5], mass=[1e8, 1.0, 1e8])
    assert relative_error(at_start(accelerations, scene), exact_accelerations(scene)) < 1e-14


def test_one_link_is_the_pendulum_of_the_textbook():
    scene = chain(1, angle=0.4, rate=5.0, length=0.7, mass=3.0)
    np.testing.assert_allclose(at_start(accelerations, scene), [-GRAVITY / 0.7 * np.sin(0.4)], rtol=4 * EPS)
    np.testing.assert_allclose(at_start(tensions, scene), [3.0 * (GRAVITY * np.cos(0.4) + 0.7 * 25.0)], rtol=4 * EPS)


def test_absent_gravity_is_gravity_zero():
    absent, zero = (random_chain(6, seed=3, gravity=gravity) for gravity in (None, 0.0))
    np.testing.assert_array_equal(at_start(accelerations, absent), at_start(accelerations, zero))
    assert np.abs(at_start(accelerations, random_chain(6, seed=3)) - at_start(accelerations, zero)).max() > 0.1


def test_straight_chain_turning_without_gravity_keeps_turning():
    scene = chain(4, angle=0.7, rate=4.0, length=[1.0, 0.5, 2.0, 1.0], gravity=None)
    np.testing.assert_array_equal(at_start(accelerations, scene), np.zeros(4))
    pulls = 16.0 * np.cumsum(np.cumsum(scene.lengths)[::-1])[::-1]  # each mass on its circle, and those beyond it
    np.testing.assert_allclose(at_start(tensions, scene), pulls, rtol=8 * EPS)


def test_hanging_chain_stays_and_each_rod_carries_what_hangs_from_it():
    scene = chain(3, angle=0.0, mass=[1.0, 2.0, 4.0])
    np.testing.assert_array_equal(at_start(accelerations, scene), np.zeros(3))
    np.testing.assert_allclose(at_start(tensions, scene), GRAVITY * np.array([7.0, 6.0, 4.0]), rtol=4 * EPS)


def test_mirror_image_accelerates_the_other_way():
    scene = random_chain(8, seed=4)
    mirrored = scene.with_start(-scene.angles, -scene.rates)
    np.testing.assert_array_equal(at_start(accelerations, mirrored), -at_start(accelerations, scene))
    np.testing.assert_array_equal(at_start(tensions, mirrored), at_start(tensions, scene))


def test_masses_in_another_unit_change_no_bit_of_the_motion():
    scene = random_chain(8, seed=5)
    heavier = chain(
        8, angle=scene.angles, rate=scene.rates, length=scene.lengths, mass=2.0**40 * scene.masses, gravity=GRAVITY
    )
    np.testing.assert_array_equal(at_start(accelerations, heavier), at_start(accelerations, scene))
    np.testing.assert_array_equal(at_start(tensions, heavier), 2.0**40 * at_start(tensions, scene))


@pytest.mark.parametrize("n", [1, 2, 7])
def test_tensions_agree_with_the_dense_form(n):
    for seed in range(5):
        scene = random_chain(n, seed, spread=4.0)
        assert_same(at_start(tensions, scene), at_start(energy.tensions, scene), 1e-12)


@pytest.mark.parametrize("gravity", [GRAVITY, None])
def test_newton_holds_for_every_mass(gravity):
    """Mass times acceleration is the pull of two rods and the weight: no matrix, no recursion."""
    scene = random_chain(9, seed=6, spread=4.0, gravity=gravity)
    angular, pull = at_start(accelerations, scene), np.append(at_start(tensions, scene), 0.0)
    along = np.stack([np.sin(scene.angles), -np.cos(scene.angles)], axis=-1)
    across = np.stack([np.cos(scene.angles), np.sin(scene.angles)], axis=-1)
    rods = scene.lengths[:, None] * (angular[:, None] * across - scene.rates[:, None] ** 2 * along)
    left = scene.masses[:, None] * np.cumsum(rods, axis=0)
    forces = pull[1:, None] * np.append(along[1:], [[0.0, 0.0]], axis=0) - pull[:-1, None] * along
    weight = scene.masses[:, None] * np.array([0.0, -(gravity or 0.0)])
    assert_same(left, forces + weight, 1e-13)


def test_rod_can_be_compressed():
    """Both at rest above the pivot: the rods hold the masses up."""
    scene = chain(2, angle=np.pi)
    np.testing.assert_allclose(at_start(tensions, scene), [-2.0 * GRAVITY, -GRAVITY], rtol=4 * EPS)


def test_inputs_of_any_layout_are_taken_and_left_alone():
    scene = random_chain(5, seed=7)
    expected = at_start(accelerations, scene)
    pairs = np.stack([scene.angles, scene.rates], axis=1)
    pairs.setflags(write=False)
    backwards = scene.angles[::-1].copy()[::-1]
    as_is = pairs.copy()
    compiled_for = len(recursion._accelerations.signatures)
    np.testing.assert_array_equal(accelerations(scene, pairs[:, 0], pairs[:, 1]), expected)
    np.testing.assert_array_equal(accelerations(scene, backwards, scene.rates), expected)
    np.testing.assert_array_equal(accelerations(scene, list(scene.angles), tuple(scene.rates)), expected)
    np.testing.assert_array_equal(pairs, as_is)
    assert len(recursion._accelerations.signatures) == compiled_for


def test_result_is_a_new_array():
    scene = random_chain(3, seed=8)
    for function in (accelerations, tensions):
        first = at_start(function, scene)
        kept = first.copy()
        function(scene, scene.rates, scene.angles)
        np.testing.assert_array_equal(first, kept)


@pytest.mark.parametrize("function", [accelerations, tensions])
@pytest.mark.parametrize("shape", [(), (0,), (2,), (4,), (1, 3), (3, 1)])
def test_wrong_shape_is_refused(function, shape):
    scene, wrong, right = random_chain(3, seed=9), np.zeros(shape), np.zeros(3)
    with pytest.raises(InputError, match=r"^theta has shape .*; allowed: \(3,\)"):
        function(scene, wrong, right)
    with pytest.raises(InputError, match=r"^omega has shape .*; allowed: \(3,\)"):
        function(scene, right, wrong)


def test_numbers_that_are_not_finite_pass_through():
    scene = random_chain(3, seed=10)
    assert np.isnan(accelerations(scene, np.full(3, np.nan), np.zeros(3))).any()


def test_system_holds_copies():
    scene = random_chain(3, seed=11)
    system = system_of(scene)
    system.masses[0] = 5.0
    assert scene.masses[0] != 5.0


def test_widest_range_that_a_scene_allows():
    """Masses and lengths over a hundred decades overflow nowhere on the way."""
    scene = Scene(
        "wide",
        "",
        1.0,
        masses=[1e-50, 1e50, 1e-50, 1.0, 1e50],
        lengths=[1e50, 1e-50, 1.0, 1e-50, 1e50],
        angles=[0.3, 1.0, -2.0, 0.5, 3.0],
        rates=[1e9, -1e9, 1e9, 1.0, 1e9],
        effects=Effects(gravity=1e9),
    )
    assert np.isfinite(at_start(accelerations, scene)).all()
    assert np.isfinite(at_start(tensions, scene)).all()


def test_masses_that_leap_by_a_hundred_decades_keep_their_digits():
    """Each leap multiplies the numbers of the elimination by 1e100: four are looked after before they overflow."""
    rng = np.random.default_rng(12)
    leaping = np.where(np.arange(20) % 2, 1e50, 1e-50)
    scene = chain(20, mass=leaping, angle=rng.uniform(-3.0, 3.0, 20), rate=rng.uniform(-5.0, 5.0, 20))
    assert relative_error(at_start(accelerations, scene), exact_accelerations(scene)) < 1e-13


@pytest.mark.parametrize("bend", [0.0, 0.7, np.pi / 2])
def test_chains_of_thousands_of_links_keep_their_rods(bend):
    """Bent at right angles, each link doubles the numbers of the elimination, and a double holds 2^1024.

    What is left over of (E19) for rods of fixed length is measured against the largest of its terms.
    """
    n = 5000
    rng = np.random.default_rng(13)
    scene = chain(
        n, angle=np.cumsum(bend * rng.choice([-1.0, 1.0], n)), rate=rng.uniform(-1, 1, n), gravity=None, mass=2.0
    )
    pull = at_start(tensions, scene) / 2.0
    cosine = np.cos(np.diff(scene.angles))
    terms = [2.0 * pull, -np.append(0.0, cosine * pull[:-1]), -np.append(cosine * pull[1:], 0.0)]
    terms[0][0] = pull[0]
    left_over = sum(terms) - scene.lengths * scene.rates**2
    assert np.abs(left_over).max() < 1e-13 * np.abs(pull).max()
    assert np.abs(pull).max() > 0.1 * np.abs(scene.lengths * scene.rates**2).max()
