"""pymunk as an engine: point masses that can only move, held by pin joints; the angles are read off the positions.

A pymunk step moves positions with the velocities it has, and then finds the next velocities from forces and joints at
the new positions. Started half a step back along its velocities, and with its positions read half a step ahead, that
is the leapfrog method, of order 2. `tuned` does so; `default` reads what a pymunk user reads, and is of order 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
import pymunk
from pymunk import batch

from pendbench.base.faults import Fault
from pendbench.engines.points import Turns, state_of
from pendbench.engines.protocol import Mapped, Method, Setting, Simulation, State, needed_step
from pendbench.engines.pymunk.bodies import BodiesRun
from pendbench.engines.pymunk.forces import Forces
from pendbench.engines.pymunk.tuning import AFFORDED, MOST_ITERATIONS, Joints, Tuning, tuning
from pendbench.physics import acting
from pendbench.scene.scene import Scene


def _setting(default: float | None, note: str) -> Mapping[str, Setting]:
    return {"iterations": Setting(default, 1, MOST_ITERATIONS, integer=True, note=note)}


_METHODS: Final = {
    "default": Method(order=1, settings=_setting(10, "pymunk's own"), note="pymunk as it comes"),
    "tuned": Method(
        order=2,
        settings=_setting(None, f"as the masses want, to {AFFORDED}; equal links 10 + n^2 / 3"),
        note="joint errors corrected as fast as the iterations allow, and positions and rates of one time",
    ),
}
_APPLIED: Final = "forces on the masses, computed in Python before each step"
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the space"),
    "joint_damping": Mapped(f"{_APPLIED}: its masses do not turn, so its rotary springs have nothing to hold"),
    "joint_stiffness": Mapped(f"{_APPLIED}, for the same reason"),
    "joint_rest": Mapped(_APPLIED),
    "joint_torque": Mapped(_APPLIED),
    "air_drag": Mapped(f"{_APPLIED}; its own damping of the space is another law"),
    "rod_mass": Mapped("bodies that turn, on pivot joints instead of pins"),
    "driven_pivot": Mapped("gravity of the pivot's frame, set before each step"),
    "drive_torque": Mapped(_APPLIED),
    "armature": Mapped("its joints have no inertia of their own", refused=True),
    "links": Mapped("bodies that turn, on pivot joints; their inertias must not be 0"),
}
_FIELDS: Final = batch.BodyFields.POSITION | batch.BodyFields.VELOCITY


class _Run:
    """One chain in pymunk, on one thread: more would neither be faster nor give the same bits every time."""

    def __init__(self, scene: Scene, dt: float, iterations: int, tuned: Tuning | None) -> None:
        self._n, self._lengths, self._dt = scene.n, scene.lengths, dt
        self._ahead = 0.5 * dt if tuned else 0.0
        self._joints = Joints(scene, dt, tuned)
        self._space = pymunk.Space()
        self._space.iterations = iterations
        x, y = acting.pivot_acceleration(scene, 0.0).tolist()
        self._space.gravity = (-x, -y)
        self._forces = None if acting.is_plain(scene) else Forces(scene, self._space, dt, tuned is not None)
        self._hang(scene, tuned)
        self._buffer = batch.Buffer()
        self._taken = 0
        self._turns = Turns(scene)

    def _hang(self, scene: Scene, tuned: Tuning | None) -> None:
        directions = np.stack([np.sin(scene.angles), -np.cos(scene.angles)], axis=1)
        across = np.stack([np.cos(scene.angles), np.sin(scene.angles)], axis=1)
        velocities = np.cumsum((scene.lengths * scene.rates)[:, None] * across, axis=0)
        positions = np.cumsum(scene.lengths[:, None] * directions, axis=0) - self._ahead * velocities
        above = self._space.static_body
        for i in range(scene.n):
            body = pymunk.Body(float(scene.masses[i]), math.inf)
            body.position = tuple(positions[i].tolist())
            body.velocity = tuple(velocities[i].tolist())
            joint = pymunk.PinJoint(above, body)
            joint.distance = float(scene.lengths[i])
            joint.collide_bodies = False
            if tuned:
                joint.error_bias = tuned.error_bias
            self._space.add(body, joint)
            above = body

    def advance(self, steps: int) -> None:
        step, dt = self._space.step, self._dt
        for taken in range(self._taken, self._taken + steps):  # pymunk has no call for many: this is what its users pay
            if self._forces is not None:
                self._forces.apply(taken * dt)
            step(dt)
        self._taken += steps

    def state(self) -> State:
        return self._turns.follow(self._measure(), self._taken * self._dt)

    def health(self) -> Fault | None:
        """Whether it is finite, its joints whole, and its iterations enough."""
        return self._joints.fault(self._measure())

    def _measure(self) -> State:
        """The state now, with angles in (-pi, pi]."""
        self._buffer.clear()
        batch.get_space_bodies(self._space, _FIELDS, self._buffer)
        # In the order in which they were added; the static body, where it has a row, comes last.
        bodies = np.frombuffer(self._buffer.float_buf()).reshape(-1, 4)[: self._n]
        with np.errstate(all="ignore"):
            places = bodies[:, :2] + self._ahead * bodies[:, 2:]
        return state_of(self._lengths, places, bodies[:, 2:])


class PymunkEngine:
    """pymunk, with point masses on pin joints."""

    name = "pymunk"
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of pymunk itself."""
        return str(pymunk.version)

    def refuses(self, scene: Scene) -> str | None:
        """Massless rods among heavy ones, links that are points: a body that turns needs an inertia."""
        if scene.links is not None and not scene.links.inertia.all():
            return "links with an inertia of 0"
        rods = acting.links(scene).mass
        return "rods of which some have no mass" if rods.any() and not rods.all() else None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
        """A run at time 0, with as many `iterations` as are given, or as the method chooses."""
        dt = needed_step(method, dt)
        chosen = self.methods[method].with_defaults(settings)
        rods = acting.links(scene).mass
        run = BodiesRun if acting.has_links(scene) else _Run
        if method == "default":
            return run(scene, dt, int(chosen["iterations"]), None)
        tuned = tuning(scene.masses + rods, dt, chosen.get("iterations"))
        return run(scene, dt, tuned.iterations, tuned)
