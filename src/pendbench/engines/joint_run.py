"""Runs of engines in joint angles that are told what acts before each step: written once for their adapters."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.faults import Fault
from pendbench.engines.joints import absolute_values, joint_forces
from pendbench.engines.protocol import State, not_finite
from pendbench.physics import acting
from pendbench.scene.scene import Scene


class JointChain(Protocol):
    """A chain in an engine, at the start of its scene, under the gravity of time 0."""

    def step(self, steps: int) -> None:
        """Take so many steps, with the gravity and the torques that are set."""

    def read(self) -> tuple[FloatArray, FloatArray]:
        """The angles (n,) rad of the joints and their rates (n,) rad/s, as new arrays."""

    def pull(self, x: float, y: float) -> None:
        """Set gravity, m/s^2."""

    def push(self, torques: FloatArray) -> None:
        """Set the torques (n,) N m in the joints, for one step."""


def torques_in_joints(scene: Scene, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
    """What joints and air do, (n,) N m in the joints, at joint angles q (n,) rad and rates v (n,) rad/s."""
    return joint_forces(acting.generalized_forces(scene, t, absolute_values(q), absolute_values(v)))


def gravity_at(scene: Scene, t: float) -> tuple[float, float]:
    """What a mass weighs at t s in the pivot's frame, over that mass: m/s^2."""
    x, y = acting.pivot_acceleration(scene, t).tolist()
    return -x, -y


def weights_in_joints(scene: Scene, t: float, q: FloatArray) -> FloatArray:
    """What gravity of the pivot's frame does, (n,) N m in the joints. equations.md (E9), (E37)."""
    theta, (x, y) = absolute_values(q), gravity_at(scene, t)
    hanging = np.cumsum(acting.lumped_masses(scene)[::-1])[::-1]
    return joint_forces(hanging * scene.lengths * (y * np.sin(theta) + x * np.cos(theta)))


class JointRun:
    """One run with a fixed step."""

    def __init__(self, scene: Scene, dt: float, chain: JointChain) -> None:
        self._scene, self._dt, self._chain, self._taken = scene, dt, chain, 0
        self._shaken, self._pushed = acting.is_shaken(scene), acting.is_pushed(scene)

    def advance(self, steps: int) -> None:
        if not (self._shaken or self._pushed):
            self._chain.step(steps)
            self._taken += steps
            return
        for _ in range(steps):
            self._act(self._taken * self._dt)
            self._chain.step(1)
            self._taken += 1

    def _act(self, t: float) -> None:
        if self._shaken:
            self._chain.pull(*gravity_at(self._scene, t))
        if self._pushed:
            with np.errstate(all="ignore"):
                self._chain.push(torques_in_joints(self._scene, t, *self._chain.read()))

    def state(self) -> State:
        with np.errstate(all="ignore"):
            q, v = self._chain.read()
            return State(absolute_values(q), absolute_values(v))

    def health(self) -> Fault | None:
        return not_finite(self.state())
