"""A chain of bodies in Rapier, and what acts on it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import rapier3d as rapier

from pendbench.engines.joint_run import gravity_at
from pendbench.engines.joints import bodies
from pendbench.engines.protocol import State
from pendbench.physics import acting
from pendbench.physics.geometry import positions, velocities
from pendbench.scene.scene import Scene

LEAST: Final = 1e-4  # of m l^2: the inertia of what is a point, where it has to have one


class World:
    """A world with a chain of bodies, at their start, and what acts on them."""

    def __init__(self, scene: Scene, dt: float, substeps: int, reduced: bool) -> None:
        self.scene, self.dt, self.taken = scene, dt, 0
        self.world = rapier.PhysicsWorld(gravity=(*gravity_at(scene, 0.0), 0.0))
        self.world.integration_parameters.dt = dt
        self.world.integration_parameters.normalized_max_linear_velocity = 1e9  # m/s, in place of 400
        self.world.integration_parameters.num_solver_iterations = substeps
        self._joints = self.world.multibody_joints if reduced else self.world.impulse_joints
        self.heaviest = float(bodies(scene).masses.max())
        self.handles = self._hang(0.0 if reduced else LEAST)
        self._shaken, self._pushed = acting.is_shaken(scene), acting.is_pushed(scene)

    def _hang(self, least: float) -> list[Any]:
        scene = self.scene
        masses, centres, inertias = bodies(scene)
        inertias = np.maximum(inertias, least * masses * scene.lengths**2) / self.heaviest
        inner = np.concatenate([np.zeros((1, 2)), positions(scene.lengths, scene.angles)[:-1]])
        moving = np.concatenate([np.zeros((1, 2)), velocities(scene.lengths, scene.angles, scene.rates)[:-1]])
        across = centres * scene.rates * np.stack([np.cos(scene.angles), np.sin(scene.angles)])
        moving = moving + across.T  # Rapier's velocities are those of centres
        handles = [self.world.add_body(rapier.RigidBodyBuilder(rapier.RigidBodyType.FIXED))]
        offsets = np.append(0.0, scene.lengths[:-1])
        for i, offset in enumerate(offsets.tolist()):
            body = rapier.RigidBodyBuilder(rapier.RigidBodyType.DYNAMIC).can_sleep(False)
            body = body.translation((*inner[i].tolist(), 0.0)).rotation((0.0, 0.0, float(scene.angles[i])))
            body = body.linvel((*moving[i].tolist(), 0.0)).angvel((0.0, 0.0, float(scene.rates[i])))
            its = (0.0, -float(centres[i]), 0.0), float(masses[i]) / self.heaviest, (float(inertias[i]),) * 3
            handles.append(self.world.add_body(body.additional_mass_properties(rapier.MassProperties(*its))))
            joint = rapier.RevoluteJointBuilder((0.0, 0.0, 1.0)).local_anchor1((0.0, -offset, 0.0))
            self._joints.insert(handles[-2], handles[-1], joint.contacts_enabled(False).build())
        return handles[1:]

    def step(self, state: Callable[[], State]) -> None:
        """A step; `state` is asked for one where something acts."""
        t = self.taken * self.dt
        if self._shaken:
            self.world.gravity = (*gravity_at(self.scene, t), 0.0)
        if self._pushed:
            with np.errstate(all="ignore"):
                torques = acting.generalized_forces(self.scene, t, *state()[:2]) / self.heaviest
            for handle, torque in zip(self.handles, torques.tolist(), strict=True):
                body = self.world.rigid_bodies[handle]
                body.reset_torques()
                body.add_torque((0.0, 0.0, torque))
        self.world.step()
        self.taken += 1
