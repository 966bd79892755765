"""Tensions along a run against closed forms, and against Newton's second law for places that a run has come through."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendbench as pb
from pendbench.physics import dense
from support.effect_sets import GRAVITY

#: Between the samples of a second derivative, s. Measured: 9e-9 of the largest, 16 times as much at twice the span.
H = 5e-4
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12.0 * H**2)
FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * H)
TIMES = np.array([0.3, 0.9, 1.4])
PIVOT = {"axis": "x", "amplitude": 0.05, "angular_frequency": 7.0, "phase": 0.9}
AIR = {"linear": [0.1, 0.3, 0.2], "quadratic": [0.2, 0.1, 0.3]}
JOINTS = {"joint_damping": 0.1, "joint_stiffness": 2.0, "joint_rest": 0.5, "joint_torque": 0.3}


def three(**given):
    start = {"angles": [0.5, 1.2, -0.3], "rates": [1.0, -0.5, 2.0]}
    return pb.Scene.chain(length=[0.5, 0.3, 0.4], **start, gravity=GRAVITY, driven_pivot=PIVOT, **given)


def followed(scene):
    """A run by scipy; accelerations and velocities of pivot and links' ends in the ground's frame, at its middles."""
    times = (TIMES[:, None] + H * np.arange(-2, 3)).ravel()

    def slope(t, y):
        return np.concatenate([y[3:], dense.accelerations(scene, y[:3], y[3:], t)])

    start = np.concatenate([scene.angles, scene.rates])
    found = solve_ivp(slope, (0.0, times[-1]), start, method="DOP853", t_eval=times, rtol=1e-13, atol=1e-13).y.T
    run = pb.Trajectory(times, found[:, :3], found[:, 3:], np.zeros(len(times)), scene=scene)
    pivot = np.stack([0.05 * np.sin(7.0 * times + 0.9), 0.0 * times], axis=-1)[:, None]
    moved = np.concatenate([pivot, pivot + run.positions], axis=1).reshape(len(TIMES), 5, 4, 2)
    return run, *(np.einsum("j,kjid->kid", weights, moved) for weights in (SECOND, FIRST))


def middle(values):
    return values.reshape(len(TIMES), 5, *values.shape[1:])[:, 2]


def directions(run):
    theta = middle(run.theta)
    return np.stack([np.sin(theta), -np.cos(theta)], axis=-1)


def drag(velocity):
    """The air's force on each mass."""
    linear, quadratic = (np.array(AIR[name])[:, None] for name in ("linear", "quadratic"))
    speed = velocity[:, 1:]
    return -(linear + quadratic * np.linalg.norm(speed, axis=-1, keepdims=True)) * speed


def test_each_mass_is_moved_by_its_rods_its_weight_and_the_air():
    scene = three(mass=[1.0, 0.5, 0.8], air_drag=AIR)
    run, acceleration, velocity = followed(scene)
    pull = middle(run.tensions)[..., None] * directions(run)
    forces = np.concatenate([pull[:, 1:], np.zeros((len(TIMES), 1, 2))], axis=1) - pull + drag(velocity)
    forces -= scene.masses[:, None] * np.array([0.0, GRAVITY])
    expected = scene.masses[:, None] * acceleration[:, 1:]
    np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize(
    "weights",
    [{"mass": [1.0, 0.5, 0.8], "rod_mass": [0.4, 0.0, 0.6]}, {"mass": 0.0, "rod_mass": [0.4, 0.3, 0.6]}],
    ids=["rods", "rods alone"],
)
def test_all_that_hangs_on_a_joint_is_moved_by_its_pull(weights):
    """Along the link; what the joint pushes across it is not asked for."""
    scene = three(**weights, **JOINTS, air_drag=AIR)
    run, acceleration, velocity = followed(scene)
    rods, fall = np.array(weights["rod_mass"])[:, None], np.array([0.0, GRAVITY])
    centres = 0.5 * (acceleration[:, 1:] + acceleration[:, :-1])
    needed = scene.masses[:, None] * (acceleration[:, 1:] + fall) + rods * (centres + fall) - drag(velocity)
    expected = -np.sum(directions(run) * np.cumsum(needed[:, ::-1], axis=1)[:, ::-1], axis=-1)
    np.testing.assert_allclose(middle(run.tensions), expected, rtol=0, atol=1e-7 * np.abs(expected).max())


def test_rigid_links_pull_as_points_on_rods_of_the_same_weight_do():
    """A rod of mass r and length l with a point m at its end is a link with the same centre and inertia."""
    point, rod, length = 0.7, 0.4, 0.5
    mass, centre = point + rod, length * (point + rod / 2) / (point + rod)
    inertia = length**2 * (point + rod / 3) - mass * centre**2
    rods = pb.Scene.chain(n=2, length=length, mass=point, angles=1.0, rates=2.0, gravity=GRAVITY, rod_mass=rod)
    whole = {"mass": [mass] * 2, "centre": [centre] * 2, "inertia": [inertia] * 2}
    links = pb.Scene("links", "", 1.0, None, rods.lengths, rods.angles, rods.rates, {"gravity": GRAVITY}, whole)
    found, expected = (pb.simulate(scene, times=[0.0, 0.5]).tensions for scene in (links, rods))
    np.testing.assert_allclose(found, expected, rtol=1e-11)


def test_a_rod_alone_pulls_at_its_pivot_as_the_textbook_says():
    """M (g cos(theta) + l omega^2 / 2), wherever it swings."""
    scene = pb.Scene.chain(n=1, length=0.6, mass=0.0, angles=1.0, rates=3.0, gravity=GRAVITY, rod_mass=2.0)
    run = pb.simulate(scene, times=np.linspace(0.0, 1.0, 11))
    expected = 2.0 * (GRAVITY * np.cos(run.theta) + 0.3 * run.omega**2)
    np.testing.assert_allclose(run.tensions, expected, rtol=1e-13)


def test_a_run_without_samples_has_no_tensions():
    for scene in (three(mass=1.0), three(mass=1.0, rod_mass=0.3)):
        empty = np.empty((0, 3))
        run = pb.Trajectory(np.empty(0), empty, empty, np.empty(0), "refused", "it cannot", scene=scene)
        assert run.tensions.shape == (0, 3)
