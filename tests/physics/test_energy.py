"""Energy, angular momentum and tensions, and what the equations of motion must do to them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendbench.physics import dense, energy
from pendbench.scene.scene import Effects, Scene
from support.misprint import accelerations_as_printed

GRAVITY = 9.81
EPS = np.finfo(float).eps
TOLERANCE = 1e-11  # of the integrator, for each step


def chain(angles, rates, gravity=GRAVITY):
    masses, lengths = [1.0, 0.5, 2.0][: len(angles)], [1.0, 0.7, 0.4][: len(angles)]
    return Scene("test", "", 3.0, masses, lengths, angles, rates, Effects(gravity=gravity))


def lively(gravity=GRAVITY):
    return chain([2.0, 1.0, -0.5], [0.0, 1.0, -2.0], gravity)


def solve(scene, accelerations=dense.accelerations, duration=3.0):
    """theta and omega, (61, n) each, at equal times."""  # noqa: D403
    n = scene.n
    solved = solve_ivp(
        lambda _, y: np.concatenate([y[n:], accelerations(scene, y[:n], y[n:])]),
        (0.0, duration),
        np.concatenate([scene.angles, scene.rates]),
        method="DOP853",
        t_eval=np.linspace(0.0, duration, 61),
        rtol=TOLERANCE,
        atol=TOLERANCE,
    )
    assert solved.success
    return solved.y[:n].T, solved.y[n:].T


def drift(scene, theta, omega):
    found = energy.energy(scene, theta, omega)
    return np.abs(found - found[0]).max() / energy.energy_scale(scene)


def random_states(rng, k=6):
    return rng.uniform(-4.0, 4.0, (k, 3)), rng.uniform(-5.0, 5.0, (k, 3))


# What the functions return


def test_energy_by_hand():
    scene = chain([0.0, np.pi / 2], [2.0, 3.0])
    # Masses 1 and 0.5 kg at (0, -1) and (0.7, -1), with velocities (2, 0) and (2, 2.1).
    expected = 0.5 * 4.0 + 0.25 * (4.0 + 2.1**2) - GRAVITY * 1.5
    np.testing.assert_allclose(energy.energy(scene, scene.angles, scene.rates), expected, rtol=8 * EPS)


def test_angular_momentum_by_hand():
    scene = chain([0.0, np.pi / 2], [2.0, 3.0])
    expected = 1.0 * (1.0 * 2.0) + 0.5 * (0.7 * 2.1 + 1.0 * 2.0)
    np.testing.assert_allclose(energy.angular_momentum(scene, scene.angles, scene.rates), expected, rtol=8 * EPS)


def test_energy_and_momentum_agree_with_the_matrices():
    scene = lively()
    theta, omega = random_states(np.random.default_rng(1))
    for angles, rates in zip(theta, omega, strict=True):
        momenta = dense.mass_matrix(scene, angles) @ rates
        kinetic = energy.kinetic_energy(scene, angles, rates)
        np.testing.assert_allclose(kinetic, 0.5 * rates @ momenta, rtol=1e-13)
        np.testing.assert_allclose(energy.angular_momentum(scene, angles, rates), momenta.sum(), rtol=0, atol=1e-12)


def test_weight_torques_are_the_slopes_of_the_potential():
    scene, step = lively(), 1e-5
    theta = np.array([0.7, -2.0, 1.1])
    for i, torque in enumerate(dense.weight_torques(scene, theta)):
        nudge = step * np.eye(3)[i]
        slope = energy.potential_energy(scene, theta + nudge) - energy.potential_energy(scene, theta - nudge)
        np.testing.assert_allclose(slope / (2 * step), torque, rtol=0, atol=1e-8)


def test_one_state_is_the_same_as_many():
    scene = lively()
    theta, omega = random_states(np.random.default_rng(2))
    for function in (energy.energy, energy.angular_momentum):
        many = function(scene, theta, omega)
        assert many.shape == (6,)
        np.testing.assert_array_equal(many, [function(scene, *state) for state in zip(theta, omega, strict=True)])


def test_scale_is_the_range_of_the_potential():
    scene = chain([0.1, 0.2, 0.3], [0.0, 0.0, 0.0])
    top, bottom = (energy.potential_energy(scene, np.full(3, angle)) for angle in (np.pi, 0.0))
    np.testing.assert_allclose(energy.energy_scale(scene), top - bottom, rtol=8 * EPS)


def test_scale_is_the_kinetic_energy_where_that_is_larger():
    scene = chain([0.1, 0.2, 0.3], [50.0, -50.0, 50.0])
    kinetic = energy.kinetic_energy(scene, scene.angles, scene.rates)
    assert energy.energy_scale(scene) == kinetic > energy.energy_scale(chain(scene.angles, np.zeros(3)))


def test_scale_without_gravity():
    assert energy.energy_scale(chain([0.1, 0.2, 0.3], [0.0, 0.0, 0.0], gravity=None)) == 0.0
    moving = lively(gravity=None)
    assert energy.energy_scale(moving) == energy.kinetic_energy(moving, moving.angles, moving.rates)


def test_scale_has_the_springs_energy_by_hand():
    """Ten N m/rad at both joints, open by 0.5 and by -0.3 rad: 10/2 (0.25 + 0.09) J."""
    scene = Scene("test", "", 1.0, [1.0, 1.0], [1.0, 1.0], [0.5, 0.2], [0.0, 0.0], Effects(joint_stiffness=10.0))
    assert energy.energy_scale(scene) == pytest.approx(1.7)


def test_scale_has_what_torques_do_in_a_turn_by_hand():
    """3 N m and -1 N m; which potential they have at the start says nothing."""
    effects = Effects(joint_torque=[3.0, -1.0], joint_stiffness=10.0)
    scene = Scene("test", "", 1.0, [1.0, 1.0], [1.0, 1.0], [0.5, 0.2], [0.0, 0.0], effects)
    assert energy.energy_scale(scene) == pytest.approx(4.0 * 2.0 * np.pi)
    assert energy.energy_scale(scene.with_start([2.5, 0.2], [0.0, 0.0])) == pytest.approx(5.0 * (2.5**2 + 2.3**2))


def test_scale_has_the_rods_masses_by_hand():
    """A mass of 1 kg on a rod of 0.7 m and 2 kg, whose centre rises by half as much: 2 g (0.7 + 2 x 0.35) J."""
    scene = Scene("test", "", 1.0, [1.0], [0.7], [0.5], [0.0], Effects(gravity=GRAVITY, rod_mass=2.0))
    assert energy.energy_scale(scene) == pytest.approx(2.0 * GRAVITY * 1.4)


def test_absent_gravity_leaves_the_kinetic_energy():
    scene, states = lively(gravity=None), random_states(np.random.default_rng(3))
    np.testing.assert_array_equal(energy.energy(scene, *states), energy.kinetic_energy(scene, *states))


# Rates of change: power and torque balance


def rate_along_the_motion(function, scene, theta, omega, accelerations=dense.accelerations):
    """How fast a function of the state changes, by a central difference along the parabola that the motion touches.

    What it leaves out is step^2 / 6 times a third derivative. With rates up to 30 rad/s that is 30^3 of the energy
    scale, so 1e-6 of it is allowed.
    """
    step, found = 1e-5, accelerations(scene, theta, omega)
    ahead, behind = (function(scene, theta + s * omega + s**2 / 2 * found, omega + s * found) for s in (step, -step))
    return (ahead - behind) / (2 * step)


@pytest.mark.parametrize("gravity", [GRAVITY, None])
def test_energy_has_no_rate_in_any_state(gravity):
    scene, (theta, omega) = lively(gravity), random_states(np.random.default_rng(4))
    powers = [rate_along_the_motion(energy.energy, scene, *state) for state in zip(theta, omega, strict=True)]
    np.testing.assert_allclose(powers, 0.0, atol=1e-6 * energy.energy_scale(scene))


def test_misprint_makes_energy_out_of_nothing():
    scene, states = lively(), list(zip(*random_states(np.random.default_rng(4)), strict=True))
    powers = [rate_along_the_motion(energy.energy, scene, *state, accelerations_as_printed) for state in states]
    # The power of the torques whose sign is wrong, twice over: those below the diagonal of S.
    expected = [-2 * omega @ np.tril(dense.coupling_matrix(scene, theta)) @ omega**2 for theta, omega in states]
    assert np.abs(expected).max() > energy.energy_scale(scene)
    np.testing.assert_allclose(powers, expected, rtol=0, atol=1e-6 * energy.energy_scale(scene))


def test_gravity_alone_changes_the_angular_momentum():
    scene, (theta, omega) = lively(), random_states(np.random.default_rng(5))
    for state in zip(theta, omega, strict=True):
        rate = rate_along_the_motion(energy.angular_momentum, scene, *state)
        torque = -dense.weight_torques(scene, state[0]).sum()
        np.testing.assert_allclose(rate, torque, rtol=0, atol=1e-6 * energy.energy_scale(scene))


# Motion


@pytest.mark.parametrize("gravity", [GRAVITY, None])
def test_energy_is_conserved(gravity):
    scene = lively(gravity)
    theta, omega = solve(scene)
    assert np.ptp(theta, axis=0).min() > 0.5  # it does move
    assert drift(scene, theta, omega) < 100 * TOLERANCE


def test_misprint_conserves_no_energy():
    gentle = chain([0.4, 0.3, -0.2], [0.0, 0.0, 0.0])
    theta, omega = solve(gentle, accelerations_as_printed)
    assert np.abs(theta).max() < 1.0  # it looks like a pendulum
    assert drift(gentle, theta, omega) > 1e-3
    assert drift(gentle, *solve(gentle)) < 100 * TOLERANCE


def test_angular_momentum_is_conserved_without_gravity():
    scene = lively(gravity=None)
    theta, omega = solve(scene)
    found = energy.angular_momentum(scene, theta, omega)
    assert np.ptp(omega, axis=0).min() > 0.1  # the parts exchange it
    np.testing.assert_allclose(found, found[0], rtol=0, atol=100 * TOLERANCE)
    falling = energy.angular_momentum(lively(), *solve(lively()))
    assert np.ptp(falling) > 1.0


def test_time_reversal_returns_to_the_start():
    scene = lively()
    theta, omega = solve(scene, duration=1.0)
    theta, omega = solve(scene.with_start(theta[-1], -omega[-1]), duration=1.0)
    np.testing.assert_allclose(theta[-1], scene.angles, rtol=0, atol=1e-8)
    np.testing.assert_allclose(omega[-1], -scene.rates, rtol=0, atol=1e-8)


def test_mirror_image_moves_as_the_mirror_image():
    scene = lively()
    theta, omega = solve(scene, duration=1.0)
    mirrored, mirrored_rates = solve(scene.with_start(-scene.angles, -scene.rates), duration=1.0)
    np.testing.assert_array_equal(mirrored, -theta)
    np.testing.assert_array_equal(mirrored_rates, -omega)


def test_longer_chain_moves_the_same_more_slowly():
    short = lively()
    long = Scene("", "", 1.0, short.masses, 4 * short.lengths, short.angles, short.rates / 2, short.effects)
    theta, omega = solve(short, duration=1.0)
    scaled, scaled_rates = solve(long, duration=2.0)
    np.testing.assert_allclose(scaled, theta, rtol=0, atol=1e-8)
    np.testing.assert_allclose(2 * scaled_rates, omega, rtol=0, atol=1e-8)


def test_masses_in_another_unit_move_the_same():
    light = lively()
    heavy = Scene("", "", 1.0, 1000 * light.masses, light.lengths, light.angles, light.rates, light.effects)
    theta, _ = solve(light, duration=1.0)
    same, _ = solve(heavy, duration=1.0)
    np.testing.assert_allclose(same, theta, rtol=0, atol=1e-8)


# Tensions


def test_hanging_rods_carry_what_hangs_from_them():
    scene = chain([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    expected = GRAVITY * np.array([3.5, 2.5, 2.0])
    np.testing.assert_allclose(energy.tensions(scene, scene.angles, scene.rates), expected, rtol=8 * EPS)


def test_standing_rods_are_pushed():
    scene = chain([np.pi, np.pi, np.pi], [0.0, 0.0, 0.0])
    expected = -GRAVITY * np.array([3.5, 2.5, 2.0])
    np.testing.assert_allclose(energy.tensions(scene, scene.angles, scene.rates), expected, rtol=1e-12)


def test_single_pendulum_pulls_as_the_textbook_says():
    scene = chain([0.8], [3.0])
    np.testing.assert_allclose(
        energy.tensions(scene, scene.angles, scene.rates), [1.0 * 3.0**2 + GRAVITY * np.cos(0.8)], rtol=8 * EPS
    )


def test_straight_chain_turning_without_gravity_is_pulled_by_centrifugal_force():
    scene = chain([0.3, 0.3, 0.3], [4.0, 4.0, 4.0], gravity=None)
    reach = np.array([1.0, 1.7, 2.1])
    expected = np.cumsum((scene.masses * reach)[::-1])[::-1] * 16.0
    np.testing.assert_allclose(energy.tensions(scene, scene.angles, scene.rates), expected, rtol=1e-13)


@pytest.mark.parametrize("gravity", [GRAVITY, None])
def test_rods_pass_force_along_themselves_only(gravity):
    scene = lively(gravity)
    for theta, omega in zip(*random_states(np.random.default_rng(6)), strict=True):
        forces = energy.rod_forces(scene, theta, omega)
        across = np.cos(theta) * forces[:, 0] + np.sin(theta) * forces[:, 1]
        assert np.abs(across).max() < 1e-12 * np.abs(forces).max()
