"""Pinocchio as an engine: its articulated-body algorithm (ABA) for joint angles, advanced by steps in Python.

Pinocchio computes accelerations and has no integrator of its own: the steps here are what its users write.

A point mass needs no inertia about itself: seen from its joint it has m l^2, which is all that ABA divides by.

Measured with Pinocchio 4.1.0 against `pendbench.physics.recursion`: the worst of 20 to 80 random shapes, over the
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

from pendbench.arrays import FloatArray
from pendbench.engines.protocol import Fault, Mapped, Method, Simulation, State
from pendbench.physics import acting
from pendbench.scene import Scene

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
    "air_drag": Mapped(_TORQUES),
    "rod_mass": Mapped("mass, lever and inertia of the bodies"),
    "driven_pivot": Mapped("gravity of the pivot's frame, set at every stage of a step"),
    "drive_torque": Mapped(_TORQUES),
}

# Pinocchio's data holds tensors of second derivatives, 32 n^3 bytes, whether or not they are asked for. Measured:
# 37 MB at 100 links, 264 MB at 200, 858 MB at 300. Each process of a study holds one at a time.
_MOST_LINKS: Final = 200


def joint_values(absolute: FloatArray) -> FloatArray:
    """Angles or rates (n,) between each rod and the one before it, from those of the rods."""
    return np.diff(absolute, prepend=0.0)


def chain_model(scene: Scene) -> Any:
    """The chain in Pinocchio: x points down, and each rod lies along the x axis of its joint's frame."""
    model = pin.Model()
    model.gravity = _weight(scene, 0.0)
    joint, end, rods = 0, np.zeros(3), acting.rods(scene)
    for i in range(scene.n):
        joint = model.addJoint(joint, pin.JointModelRZ(), pin.SE3(np.eye(3), end), f"joint {i}")
        end = np.array([scene.lengths[i], 0.0, 0.0])
        # appendBodyToJoint would add it to nothing; that sum takes masses below 2e-16 kg for 2e-16 kg, in the lever.
        model.inertias[joint] = _inertia(float(scene.masses[i]), float(rods[i]), end)
    return model


def _inertia(mass: float, rod: float, end: FloatArray) -> Any:
    """A point at `end` (3,) m and a uniform rod from the joint to there, whose own inertia lies across it."""
    both = mass + rod
    middle = rod / 12.0 + mass * rod / (4.0 * both)
    return pin.Inertia(both, end * ((mass + 0.5 * rod) / both), np.diag([0.0, 1.0, 1.0]) * middle * (end @ end))


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
        """What pushes a rod pushes all joints before it."""
        on_rods = acting.generalized_forces(self._scene, t, np.cumsum(q), np.cumsum(v))
        return np.asarray(np.cumsum(on_rods[::-1])[::-1])

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
            return State(np.cumsum(self._q), np.cumsum(self._v))

    def health(self) -> Fault | None:
        if not np.all(np.isfinite(self.state()[:2])):  # sums: not finite where a joint's is not
            return Fault("not finite", "an angle or a rate is not finite")
        return None


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
        if dt is None:
            raise ValueError(f"method {method!r} needs a step")
        return _Run(scene, method, dt)
