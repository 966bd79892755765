"""Pinocchio as an engine: its articulated-body algorithm (ABA) for joint angles, advanced by steps in Python.

Pinocchio computes accelerations and has no integrator of its own: the steps here are what its users write.

A point mass needs no inertia about itself: seen from its joint it has m l^2, which is all that ABA divides by.

Measured with Pinocchio 4.1.0 against `physics.kernels.recursion`: the worst of 20 to 80 random shapes, over the
largest component. Unlike links with ratios below 4: 2e-14. A tip of 1e-4 or 1e-8 of the other masses, 2 to 100 links:
2e-15, nothing is lost. A tip of 1e4 or 1e8 of them: 7e-16 for two links, but from three on 4e-12 and 5e-8, as many
digits as the ratio has, since ABA subtracts inertias that are then nearly equal. Lengths over six decades: 9e-7.
Masses that rise by sixteen decades towards the tip: no digit is left. In `Convention.WORLD` a call took 10 % less, and
most of these errors are 2 to 50 times as large; LOCAL is Pinocchio's default, and is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pinocchio as pin

from pendbench.base.arrays import FloatArray
from pendbench.base.faults import Fault
from pendbench.engines.joints import absolute_values, bodies, joint_forces, joint_values
from pendbench.engines.protocol import Mapped, Method, Simulation, State, needed_step, not_finite
from pendbench.physics import acting
from pendbench.scene.scene import Scene

_NOTE: Final = "in Python around pinocchio.aba: Pinocchio has no integrator of its own"
_METHODS: Final = {
    "rk4": Method(order=4, note=f"the classical Runge-Kutta method, {_NOTE}"),
    "euler": Method(order=1, note=f"semi-implicit Euler, {_NOTE}"),
}
_TORQUES: Final = "torques in the joints, computed in Python at every stage of a step"
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the model"),
    "joint_damping": Mapped(_TORQUES),
    "joint_stiffness": Mapped(_TORQUES),
    "joint_rest": Mapped(_TORQUES),
    "joint_torque": Mapped(_TORQUES),
    "air_drag": Mapped(_TORQUES),
    "rod_mass": Mapped("mass, lever and inertia of the bodies"),
    "driven_pivot": Mapped("gravity of the pivot's frame, set at every stage of a step"),
    "drive_torque": Mapped(_TORQUES),
    "armature": Mapped("armature of the model"),
    "links": Mapped("mass, lever and inertia of the bodies"),
}

# Pinocchio's data holds tensors of second derivatives, 32 n^3 bytes, whether or not they are asked for. Measured:
# 37 MB at 100 links, 264 MB at 200, 858 MB at 300. Each process of a study holds one at a time.
_MOST_LINKS: Final = 200


def chain_model(scene: Scene) -> Any:
    """The chain in Pinocchio: x points down, and each rod lies along the x axis of its joint's frame."""
    model = pin.Model()
    model.gravity = _weight(scene, 0.0)
    joint, end = 0, np.zeros(3)
    for length, mass, centre, inertia in np.stack([scene.lengths, *bodies(scene)], axis=1).tolist():
        joint = model.addJoint(joint, pin.JointModelRZ(), pin.SE3(np.eye(3), end), f"joint {joint}")
        end = np.array([length, 0.0, 0.0])
        # appendBodyToJoint would add it to nothing; that sum takes masses below 2e-16 kg for 2e-16 kg, in the lever.
        model.inertias[joint] = pin.Inertia(mass, np.array([centre, 0.0, 0.0]), np.diag([0.0, inertia, inertia]))
    model.armature = acting.rotor_inertias(scene)
    return model


def _weight(scene: Scene, t: float) -> Any:
    """What a mass weighs at t s in the pivot's frame, over that mass: x points down here, and y to the right."""
    x, y = acting.pivot_acceleration(scene, t)
    return pin.Motion(np.array([y, -x, 0.0]), np.zeros(3))


class _Run:
    """One chain in Pinocchio, in joint angles q and their rates v."""

    def __init__(self, scene: Scene, method: str, dt: float) -> None:
        self._model = chain_model(scene)
        self._data = self._model.createData()
        self._scene, self._no_torques, self._taken = scene, np.zeros(scene.n), 0
        self._shaken = acting.is_shaken(scene)
        self._pushed = acting.is_pushed(scene)
        self._q, self._v, self._dt = joint_values(scene.angles), joint_values(scene.rates), dt
        self._method = method

    def advance(self, steps: int) -> None:
        with np.errstate(all="ignore"):
            step = {"rk4": self._rk4, "euler": self._euler}[self._method]  # kept, it would keep the run alive
            for _ in range(steps):
                step(self._taken * self._dt)
                self._taken += 1

    def _accelerations(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        if self._shaken:
            self._model.gravity = _weight(self._scene, t)
        torques = self._torques(t, q, v) if self._pushed else self._no_torques
        found: FloatArray = pin.aba(self._model, self._data, q, v, torques)
        return found

    def _torques(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        return joint_forces(acting.generalized_forces(self._scene, t, absolute_values(q), absolute_values(v)))

    def _euler(self, t: float) -> None:
        self._v = self._v + self._dt * self._accelerations(t, self._q, self._v)
        self._q = self._q + self._dt * self._v

    def _rk4(self, t: float) -> None:
        q, v, h = self._q, self._v, self._dt
        first = self._accelerations(t, q, v)
        v2 = v + 0.5 * h * first
        second = self._accelerations(t + 0.5 * h, q + 0.5 * h * v, v2)
        v3 = v + 0.5 * h * second
        third = self._accelerations(t + 0.5 * h, q + 0.5 * h * v2, v3)
        v4 = v + h * third
        fourth = self._accelerations(t + h, q + h * v3, v4)
        self._q = q + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
        self._v = v + h / 6.0 * (first + 2.0 * (second + third) + fourth)

    def state(self) -> State:
        with np.errstate(all="ignore"):
            return State(absolute_values(self._q), absolute_values(self._v))

    def health(self) -> Fault | None:
        return not_finite(self.state())


class PinocchioEngine:
    """Pinocchio, from the package `pin`."""

    name = "pinocchio"
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of Pinocchio itself."""
        return str(pin.__version__)

    def refuses(self, scene: Scene) -> str | None:
        """Chains that take too much memory."""
        if scene.n > _MOST_LINKS:
            return f"{scene.n} links; Pinocchio takes 32 n^3 bytes, too much memory for more than {_MOST_LINKS}"
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:  # noqa: ARG002
        """A run at time 0; no method has settings."""
        dt = needed_step(method, dt)
        return _Run(scene, method, dt)
