"""Joint coordinates and bodies, against the energy and the power of the chain itself."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pendbench.engines.joints import absolute_values, bodies, joint_forces, joint_values
from pendbench.physics.energy import kinetic_energy
from pendbench.physics.geometry import velocities
from pendbench.scene.scene import Effects
from support.scenes import random_chain


def test_joints_and_rods_say_the_same():
    np.testing.assert_allclose(joint_values(np.array([0.3, 0.5, -1.0])), [0.3, 0.2, -1.5])
    np.testing.assert_allclose(absolute_values(np.array([0.3, 0.2, -1.5])), [0.3, 0.5, -1.0])


def test_torques_in_joints_do_the_work_of_those_on_rods():
    rng = np.random.default_rng(1)
    torques, rates = rng.normal(size=5), rng.normal(size=5)
    assert joint_forces(torques) @ joint_values(rates) == pytest.approx(torques @ rates, rel=1e-13)


@pytest.mark.parametrize("rod_mass", [None, [0.3, 2.0, 1e-6]])
def test_bodies_have_the_chains_kinetic_energy(rod_mass):
    scene = dataclasses.replace(random_chain(3, seed=5), effects=Effects(rod_mass=rod_mass))
    masses, centres, inertias = bodies(scene)
    across = np.stack([np.cos(scene.angles), np.sin(scene.angles)], axis=1)
    joints = np.concatenate([np.zeros((1, 2)), velocities(scene.lengths, scene.angles, scene.rates)[:-1]])
    speeds = joints + (centres * scene.rates)[:, np.newaxis] * across
    found = 0.5 * np.sum(masses * np.sum(speeds**2, axis=1)) + 0.5 * np.sum(inertias * scene.rates**2)
    assert found == pytest.approx(float(kinetic_energy(scene, scene.angles, scene.rates)), rel=1e-13)
