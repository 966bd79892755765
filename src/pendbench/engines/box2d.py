"""Box2D 3 as an engine, from the package `pyb2d3`: points that do not turn, held by distance joints.

Box2D takes small steps: `world.step(dt, substeps)`, four of them by default, with one pass over the joints in each. A
joint is a damped spring of 60 Hz, and softer where substeps are coarse; the package has no setting for that. So a rod
under its mass's weight is longer by g / (2 pi 60 Hz)^2, which is 7e-5 m, and no step makes it shorter: that is the
plateau of `default`. A distance joint can be given a spring of its own, of any frequency, and that is solved
implicitly: at half the rate of substeps it gives way by a thousandth of that, and ever less with finer steps. `stiff`
does so: its springs are stiffer than the rigid joints.

All numbers are of single precision. Sleep would stop a slow chain, and is switched off; so is continuous collision,
which has nothing to do here. There is no damping unless one is set. Speeds are
cut at 400 m/s by default: that is switched off as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any, Final

import numpy as np
import pyb2d3 as b2

from pendbench.base.arrays import FloatArray, all_finite
from pendbench.base.faults import Fault
from pendbench.engines.points import Turns, pushes, start_of, state_of
from pendbench.engines.protocol import Mapped, Method, Setting, Simulation, State, needed_step
from pendbench.physics import acting
from pendbench.scene.scene import Scene

_SUBSTEPS: Final = {"substeps": Setting(4, 1, 10_000, integer=True, note="of each step; Box2D's own number is 4")}


def _method(plateau: float, note: str) -> Method:
    return Method(1, settings=_SUBSTEPS, substeps=True, single=True, plateau=plateau, note=note)


_METHODS: Final = {
    "default": _method(1.5e-3, "rigid joints, which are springs of 60 Hz"),
    "stiff": _method(2e-4, "joints with springs of half the rate of substeps, critically damped"),
}
_APPLIED: Final = "forces on the masses, computed in Python before each step"
_POINTS: Final = Mapped("the adapter hangs points on distance joints", refused=True)
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the world"),
    "joint_damping": Mapped(_APPLIED),
    "joint_stiffness": Mapped(_APPLIED),
    "joint_rest": Mapped(_APPLIED),
    "joint_torque": Mapped(_APPLIED),
    "air_drag": Mapped(f"{_APPLIED}; its own damping is another law"),
    "rod_mass": _POINTS,
    "driven_pivot": Mapped("gravity of the pivot's frame, set before each step"),
    "drive_torque": Mapped(_APPLIED),
    "armature": _POINTS,
    "links": _POINTS,
}
_FASTEST: Final = 1e9  # m/s, in place of 400
_TORN: Final = 0.5
_LEAST: Final = 5e-3  # m; Box2D's rods are no shorter: b2_linearSlop


class _Run:
    """One chain in Box2D."""

    def __init__(self, scene: Scene, method: str, dt: float, substeps: int) -> None:
        self._scene, self._dt, self._substeps, self._taken = scene, dt, substeps, 0
        self._world = b2.World(maximum_linear_speed=_FASTEST)
        self._world.sleeping_enabled = self._world.continuous_enabled = False
        spring = {"enable_spring": True, "hertz": 0.5 * substeps / dt, "damping_ratio": 1.0}
        self._joint = spring if method == "stiff" else {}
        self._pull(0.0)
        self._pushed, self._shaken = acting.is_pushed(scene), acting.is_shaken(scene)
        self._bodies = self._hang()
        self._turns = Turns(scene)

    def _hang(self) -> list[Any]:
        scene, masses = self._scene, self._scene.masses / self._scene.masses.min()
        places, speeds = start_of(scene)
        bodies = [self._world.create_static_body(position=(0.0, 0.0))]
        for i in range(scene.n):
            place, speed = tuple(places[i].tolist()), tuple(speeds[i].tolist())
            body = self._world.create_dynamic_body(position=place, linear_velocity=speed, fixed_rotation=True)
            body.mass_data = _point(float(masses[i]))
            length = float(scene.lengths[i])
            self._world.create_distance_joint(body_a=bodies[-1], body_b=body, length=length, **self._joint)
            bodies.append(body)
        return bodies[1:]

    def _pull(self, t: float) -> None:
        x, y = acting.pivot_acceleration(self._scene, t).tolist()
        self._world.gravity = (-x, -y)

    def _act(self, t: float) -> None:
        if self._shaken:
            self._pull(t)
        if self._pushed:
            theta, omega, _ = self.state()
            forces = pushes(self._scene, t, theta, omega) / self._scene.masses.min()
            for body, force in zip(self._bodies, forces.tolist(), strict=True):
                body.apply_force_to_center(tuple(force))

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            if self._pushed or self._shaken:
                self._act(self._taken * self._dt)
            self._world.step(self._dt, self._substeps)
            self._taken += 1

    def _measure(self) -> State:
        return state_of(self._scene.lengths, self._all("position"), self._all("linear_velocity"))

    def _all(self, what: str) -> FloatArray:
        return np.array([tuple(getattr(body, what)) for body in self._bodies], np.float64)

    def state(self) -> State:
        return self._turns.follow(self._measure(), self._taken * self._dt)

    def health(self) -> Fault | None:
        found = self._measure()
        if not all_finite(*found[:2]):
            return Fault("not finite", "a position or a velocity is not finite")
        if found.gap > _TORN:
            return Fault("torn", f"a rod is off its length by {found.gap:.3g} of it")
        return None


def _point(mass: float) -> Any:
    data = b2.MassData()
    data.mass, data.rotational_inertia, data.center = mass, 0.0, (0.0, 0.0)
    return data


class Box2dEngine:
    """Box2D, with point masses on distance joints."""

    name = "box2d"
    libraries = ("pyb2d3",)
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of pyb2d3, which has Box2D compiled in."""
        return version("pyb2d3")

    def refuses(self, scene: Scene) -> str | None:
        """Rods that Box2D would make longer."""
        shortest = float(scene.lengths.min())
        return f"a rod of {shortest:g} m; Box2D has none below {_LEAST:g} m" if shortest < _LEAST else None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
        """A run at time 0."""
        dt = needed_step(method, dt)
        return _Run(scene, method, dt, int(self.methods[method].with_defaults(settings)["substeps"]))
