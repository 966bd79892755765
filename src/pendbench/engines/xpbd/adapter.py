"""Position-based dynamics as an engine: the rows that games would have, in doubles and in one compiled loop.

`small_steps` goes once through the rods in each step, from the pivot outwards, as a game with many small steps does:
the chain is right only when steps are small, and it always loses energy. `iterated` goes through them until the rods
hold, and `second_order` takes its velocities by BDF2 besides: the same loop, with an order to show for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from pendbench import __version__
from pendbench.base.arrays import FloatArray
from pendbench.base.faults import Fault
from pendbench.engines.points import pushes, start_of, state_of
from pendbench.engines.protocol import Mapped, Method, Setting, Simulation, State, needed_step, not_finite
from pendbench.physics import acting
from pendbench.physics.geometry import TURN
from pendbench.scene.scene import Scene

_CLOSE: Final = 2e-15  # of its length, times the number of links: how far a rod may be off where it is iterated
_NOT_CONVERGED: Final = 1e-9
_TORN: Final = 0.5


#: Whether of order 2, how often the rods are gone through at most, and how close they have to get.
_SCHEMES: Final = {
    "small_steps": (False, 1, 0.0),
    "iterated": (False, 10_000, _CLOSE),
    "second_order": (True, 10_000, _CLOSE),
}


def _method(name: str, order: int, note: str) -> Method:
    most = Setting(_SCHEMES[name][1], 1, 1_000_000, integer=True, note="how often the rods are gone through")
    return Method(order, settings={"iterations": most}, note=note)


_METHODS: Final = {
    "small_steps": _method("small_steps", 1, "each rod put right once in a step, from the pivot outwards"),
    "iterated": _method("iterated", 1, "the rods put right until they hold"),
    "second_order": _method("second_order", 2, "the same, with velocities by BDF2"),
}
_APPLIED: Final = "forces on the masses, computed in Python before each step"
_POINTS: Final = Mapped("its bodies are points", refused=True)
_EFFECTS: Final = {
    "gravity": Mapped("acceleration of the masses"),
    "joint_damping": Mapped(_APPLIED),
    "joint_stiffness": Mapped(_APPLIED),
    "joint_rest": Mapped(_APPLIED),
    "joint_torque": Mapped(_APPLIED),
    "air_drag": Mapped(_APPLIED),
    "rod_mass": _POINTS,
    "driven_pivot": Mapped("gravity of the pivot's frame, set before each step"),
    "drive_torque": Mapped(_APPLIED),
    "armature": _POINTS,
    "links": _POINTS,
}


class _Run:
    """One chain of points."""

    def __init__(self, scene: Scene, method: str, iterations: int, dt: float) -> None:
        from pendbench.engines.xpbd import loop  # compiles or loads the kernel

        self._scene, self._dt, self._taken, self._worst = scene, dt, 0, 0.0
        second, _, close = _SCHEMES[method]
        self._advance, self._scheme = loop.advance, loop.Scheme(second, iterations, close * scene.n)
        self._points = loop.points_of(scene.masses, scene.lengths, *start_of(scene))
        self._points.turns[:] = np.rint((scene.angles - self._measure().theta) / TURN)
        self._before: FloatArray | None = None
        self._pushed = acting.is_pushed(scene)
        self._changing = self._pushed or acting.is_shaken(scene)

    def advance(self, steps: int) -> None:
        for count in [1] * steps if self._changing else [steps]:
            pushes = self._pushes_at(self._taken * self._dt)
            self._worst = self._advance(self._points, pushes, self._scheme, self._dt, self._taken, count)
            self._taken += count

    def _pushes_at(self, t: float) -> FloatArray:
        """The accelerations (n, 2) m/s^2 of the masses but for the rods': at the step's end, where it is of order 2."""
        t += self._scheme.second * self._dt
        found = np.tile(-acting.pivot_acceleration(self._scene, t), (self._scene.n, 1))
        if self._pushed:
            theta, omega, _ = self.state()
            if self._scheme.second:
                before, self._before = self._before, omega
                theta = theta + self._dt * omega
                omega = omega if before is None else 2.0 * omega - before
            found += pushes(self._scene, t, theta, omega) / self._scene.masses[:, np.newaxis]
        return found

    def _measure(self) -> State:
        return state_of(self._scene.lengths, self._points.places, self._points.speeds)

    def state(self) -> State:
        found = self._measure()
        return found._replace(theta=found.theta + TURN * self._points.turns)

    def health(self) -> Fault | None:
        state = self._measure()
        if fault := not_finite(state):
            return fault
        if state.gap > _TORN:
            return Fault("torn", f"a rod is off its length by {state.gap:.3g} of it")
        if self._scheme.close and self._worst > _NOT_CONVERGED:
            return Fault("not converged", f"{self._scheme.most} iterations leave {self._worst:.3g} of a rod")
        return None


class XpbdEngine:
    """Position-based dynamics, written here."""

    name = "xpbd"
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The project's own."""
        return __version__

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        """Nothing but effects."""
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
        """A run at time 0."""
        dt = needed_step(method, dt)
        most = int(self.methods[method].with_defaults(settings)["iterations"])
        return _Run(scene, method, most, dt)
