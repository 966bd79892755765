"""pymunk as an engine: point masses that can only move, held by pin joints; the angles are read off the positions.

A pymunk step moves positions with the velocities it has, and then finds the next velocities from forces and joints at
the new positions. Started half a step back along its velocities, and with its positions read half a step ahead, that
is the leapfrog method, of order 2. `tuned` does so; `default` reads what a pymunk user reads, and is of order 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
import pymunk
from pymunk import batch

from pendbench.arrays import FloatArray
from pendbench.engines.protocol import Fault, Mapped, Method, Setting, Simulation, State
from pendbench.engines.pymunk_bodies import TORN, BodiesRun
from pendbench.engines.pymunk_forces import Forces
from pendbench.physics import acting
from pendbench.scene import Scene

_MOST_ITERATIONS: Final = 100_000


def _setting(default: float | None, note: str) -> Mapping[str, Setting]:
    return {"iterations": Setting(default, 1, _MOST_ITERATIONS, integer=True, note=note)}


_METHODS: Final = {
    "default": Method(order=1, settings=_setting(10, "pymunk's own"), note="pymunk as it comes"),
    "tuned": Method(
        order=2,
        settings=_setting(None, "10 + n^2 / 3, enough for chains of equal links"),
        note="joint errors corrected within a step, and positions and rates of one time",
    ),
}
_APPLIED: Final = "forces on the masses, computed in Python before each step"
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the space"),
    "joint_damping": Mapped(f"{_APPLIED}: its masses do not turn, so its rotary springs have nothing to hold"),
    "joint_stiffness": Mapped(f"{_APPLIED}, for the same reason"),
    "air_drag": Mapped(f"{_APPLIED}; its own damping of the space is another law"),
    "rod_mass": Mapped("bodies that turn, on pivot joints instead of pins"),
    "driven_pivot": Mapped("gravity of the pivot's frame, set before each step"),
    "drive_torque": Mapped(_APPLIED),
}
_FIELDS: Final = batch.BodyFields.POSITION | batch.BodyFields.VELOCITY


def enough_iterations(n: int) -> int:
    """Iterations beyond which the error of `tuned` no longer falls, for n equal links.

    Measured with pymunk 7.3.1: chains of 1 m, released from horizontal and moving in an arc, steps of 1 and 0.1 ms,
    0.3 to 1.5 s. The error was within 1 % of its limit from 3 iterations (n = 2), 13 (5), 44 (10), 133 (20), 656 (50)
    and 2623 (100) on; with a quarter of that the run falls apart. (Where the chain had whipped and the error was
    percents, 1 % took up to three times as many.) A heavy tip wants more.
    """
    return min(10 + math.ceil(n**2 / 3), _MOST_ITERATIONS)


class _Rods(NamedTuple):
    """angles (n,) rad in (-pi, pi], rates (n,) rad/s, and the largest relative error in length."""

    angles: FloatArray
    rates: FloatArray
    gap: float


class _Run:
    """One chain in pymunk, on one thread: more would neither be faster nor give the same bits every time."""

    def __init__(self, scene: Scene, dt: float, iterations: int, tuned: bool) -> None:
        self._n, self._lengths, self._dt = scene.n, scene.lengths, dt
        self._ahead = 0.5 * dt if tuned else 0.0
        self._space = pymunk.Space()
        self._space.iterations = iterations
        x, y = acting.pivot_acceleration(scene, 0.0).tolist()
        self._space.gravity = (-x, -y)
        self._forces = None if acting.is_plain(scene) else Forces(scene, self._space, dt, tuned)
        self._hang(scene, tuned)
        self._buffer = batch.Buffer()
        self._taken = 0
        self._read_at, self._read = 0.0, State(scene.angles, scene.rates)

    def _hang(self, scene: Scene, tuned: bool) -> None:
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
                joint.error_bias = 0.0  # the share of an error that may be left after a second
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
        """Angles are followed by whole turns from the last state read, with the mean of the rates then and now.

        That is right while this predicts each angle to better than half a turn, so for samples much closer than a
        turn's acceleration takes. Sampled more coarsely, an angle is known up to whole turns, which no position and
        no energy depends on.
        """
        rods, time = self._measure(), self._taken * self._dt
        with np.errstate(all="ignore"):
            expected = self._read.theta + 0.5 * (time - self._read_at) * (self._read.omega + rods.rates)
            theta = rods.angles + 2.0 * np.pi * np.rint((expected - rods.angles) / (2.0 * np.pi))
        self._read_at, self._read = time, State(theta, rods.rates, rods.gap)
        return State(theta.copy(), rods.rates.copy(), rods.gap)

    def health(self) -> Fault | None:
        rods = self._measure()
        if not (np.all(np.isfinite(rods.angles)) and np.all(np.isfinite(rods.rates))):
            return Fault("not finite", "a position or a velocity is not finite")
        if rods.gap > TORN:
            return Fault("torn", f"a rod is off its length by {rods.gap:.3g} of it")
        return None

    def _measure(self) -> _Rods:
        self._buffer.clear()
        batch.get_space_bodies(self._space, _FIELDS, self._buffer)
        # In the order in which they were added; the static body, where it has a row, comes last.
        bodies = np.frombuffer(self._buffer.float_buf()).reshape(-1, 4)[: self._n]
        with np.errstate(all="ignore"):
            positions, velocities = bodies[:, :2] + self._ahead * bodies[:, 2:], bodies[:, 2:]
            x, y = np.diff(positions, axis=0, prepend=0.0).T
            u, v = np.diff(velocities, axis=0, prepend=0.0).T
            found = np.hypot(x, y)
            rates = (x / found * v - y / found * u) / found
            gap = np.abs(found / self._lengths - 1.0).max()
            return _Rods(np.arctan2(x, -y), rates, float(gap))


class PymunkEngine:
    """pymunk, with point masses on pin joints."""

    name = "pymunk"
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of pymunk itself."""
        return str(pymunk.version)

    def refuses(self, scene: Scene) -> str | None:
        """Massless rods among heavy ones: a body that turns needs an inertia."""
        rods = acting.rods(scene)
        return "rods of which some have no mass" if rods.any() and not rods.all() else None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
        """A run at time 0, with as many `iterations` as are given, or as the method chooses."""
        if dt is None:
            raise ValueError(f"method {method!r} needs a step")
        chosen = self.methods[method].with_defaults(settings)
        iterations = int(chosen.get("iterations", enough_iterations(scene.n)))
        run = BodiesRun if acting.rods(scene).any() else _Run
        return run(scene, dt, iterations, tuned=method == "tuned")
