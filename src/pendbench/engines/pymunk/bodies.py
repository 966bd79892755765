"""A chain of rods with mass in pymunk: bodies that turn, each a rod with its mass at the end, held by pivot joints.

The same step as that of the masses on pins (`adapter.py`), and the same half step between positions and velocities in
`tuned`. Angles are those of the bodies, which count turns by themselves.
"""

from __future__ import annotations

import numpy as np
import pymunk

from pendbench.base.arrays import FloatArray
from pendbench.base.faults import Fault
from pendbench.engines.joints import bodies
from pendbench.engines.protocol import State
from pendbench.engines.pymunk.tuning import Joints, Tuning
from pendbench.physics import acting
from pendbench.physics.geometry import positions, velocities
from pendbench.scene.scene import Scene


class BodiesRun:
    """One chain in pymunk, on one thread."""

    def __init__(self, scene: Scene, dt: float, iterations: int, tuned: Tuning | None) -> None:
        self._scene, self._dt, self._tuned, self._taken = scene, dt, tuned, 0
        self._joints = Joints(scene, dt, tuned)
        self._ahead = 0.5 * dt if tuned else 0.0
        masses, self._centres, inertias = bodies(scene)
        self._space = pymunk.Space()
        self._space.iterations = iterations
        self._space.gravity = self._pull(0.0)
        self._shaken = acting.is_shaken(scene)
        self._bodies = [pymunk.Body(*pair) for pair in np.stack([masses, inertias], axis=1).tolist()]
        self._hang()
        self._last: tuple[FloatArray, FloatArray] | None = None
        self._pushed = acting.is_pushed(scene)

    def _hang(self) -> None:
        scene, above, anchor = self._scene, self._space.static_body, (0.0, 0.0)
        inner = np.concatenate([np.zeros((1, 2)), positions(scene.lengths, scene.angles)[:-1]])
        moving = np.concatenate([np.zeros((1, 2)), velocities(scene.lengths, scene.angles, scene.rates)[:-1]])
        along = np.stack([np.sin(scene.angles), -np.cos(scene.angles)], axis=1)
        across = np.stack([np.cos(scene.angles), np.sin(scene.angles)], axis=1)
        velocity = moving + (self._centres * scene.rates)[:, None] * across
        place = inner + self._centres[:, None] * along - self._ahead * velocity
        for i, body in enumerate(self._bodies):
            body.position, body.velocity = tuple(place[i].tolist()), tuple(velocity[i].tolist())
            body.angle = float(scene.angles[i] - self._ahead * scene.rates[i])
            body.angular_velocity = float(scene.rates[i])
            joint = pymunk.PivotJoint(above, body, anchor, (0.0, float(self._centres[i])))
            joint.collide_bodies = False
            if self._tuned:
                joint.error_bias = self._tuned.error_bias
            self._space.add(body, joint)
            above, anchor = body, (0.0, float(self._centres[i] - scene.lengths[i]))

    def advance(self, steps: int) -> None:
        """Take `steps` steps."""
        for _ in range(steps):
            with np.errstate(all="ignore"):  # a run that blows up is seen in its state
                self._act()
            self._space.step(self._dt)
            self._taken += 1

    def _act(self) -> None:
        """Set what acts during the next step: at its middle in `tuned`, as it is now otherwise."""
        t = (self._taken + (0.5 if self._tuned else 0.0)) * self._dt
        if self._shaken:
            self._space.gravity = self._pull(t)
        if not self._pushed:
            return
        theta, omega = self._turning()
        if self._tuned:
            before = omega if self._last is None else self._last[1]
            self._last = theta, omega
            theta, omega = theta + self._dt * omega, omega + 0.5 * (omega - before)
        joints = acting.joint_torques(self._scene, t, theta, omega)
        drag = acting.drag_forces(self._scene, t, theta, omega)
        lever = self._scene.lengths - self._centres
        torques = joints - np.append(joints[1:], 0.0)
        torques += lever * (np.cos(theta) * drag[:, 0] + np.sin(theta) * drag[:, 1])
        for body, force, torque in zip(self._bodies, drag.tolist(), torques.tolist(), strict=True):
            body.force, body.torque = tuple(force), torque

    def _pull(self, t: float) -> tuple[float, float]:
        """What a mass weighs at t s in the pivot's frame, over that mass."""
        x, y = acting.pivot_acceleration(self._scene, t)
        return -float(x), -float(y)

    def _turning(self) -> tuple[FloatArray, FloatArray]:
        angles = np.array([body.angle for body in self._bodies])
        return angles, np.array([body.angular_velocity for body in self._bodies])

    def state(self) -> State:
        """Angles and rates of the bodies, and the widest open joint."""
        theta, omega = self._turning()
        with np.errstate(all="ignore"):
            return State(theta + self._ahead * omega, omega, self._gap(theta))

    def _gap(self, theta: FloatArray) -> float:
        """By how much the worst joint is open, over the length of its rod."""
        places = np.array([body.position for body in self._bodies])
        along = np.stack([np.sin(theta), -np.cos(theta)], axis=1)
        inner = places - self._centres[:, None] * along
        outer = places + (self._scene.lengths - self._centres)[:, None] * along
        apart = inner - np.concatenate([np.zeros((1, 2)), outer[:-1]])
        return float((np.hypot(*apart.T) / self._scene.lengths).max())

    def health(self) -> Fault | None:
        """Whether it is finite, its joints whole, and its iterations enough."""
        return self._joints.fault(self.state())
