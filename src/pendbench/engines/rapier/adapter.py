"""The engine, its methods and its runs."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import Final

import numpy as np

from pendbench.base.faults import Fault
from pendbench.engines.joints import absolute_values, joint_values
from pendbench.engines.points import Turns
from pendbench.engines.protocol import Mapped, Method, Setting, Simulation, State, needed_step, not_finite
from pendbench.engines.rapier.world import World
from pendbench.physics import acting
from pendbench.scene.scene import Scene

_SUBSTEPS: Final = {"substeps": Setting(4, 1, 1000, integer=True, note="num_solver_iterations; Rapier's own is 4")}


_TORQUES: Final = "torques on the bodies, computed in Python before each step"
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the world"),
    "joint_damping": Mapped(_TORQUES),
    "joint_stiffness": Mapped(_TORQUES),
    "joint_rest": Mapped(_TORQUES),
    "joint_torque": Mapped(_TORQUES),
    "air_drag": Mapped(_TORQUES),
    "rod_mass": Mapped("mass, centre and inertia of the bodies"),
    "driven_pivot": Mapped("gravity of the pivot's frame, set before each step"),
    "drive_torque": Mapped(_TORQUES),
    "armature": Mapped("armature of the multibody; impulse joints have none"),
    "links": Mapped("mass, centre and inertia of the bodies"),
}


def _method(plateau: float, note: str, effects: frozenset[str] | None = None) -> Method:
    return Method(1, settings=_SUBSTEPS, note=note, substeps=True, effects=effects, plateau=plateau, single=True)


_METHODS: Final = {
    "multibody": _method(1e-4, "multibody joints, their damping off"),
    "impulse": _method(1e-3, "impulse joints, points with a little inertia", frozenset(_EFFECTS) - {"armature"}),
}
_TORN: Final = 0.5


class _Multibody:
    """Joint angles."""

    def __init__(self, scene: Scene, dt: float, substeps: int) -> None:
        self._world, self._n = World(scene, dt, substeps, reduced=True), scene.n
        inside = self._world.world
        link = inside.multibody_joints.rigid_body_link(self._world.handles[0])
        self._body = inside.multibody_joints.get_multibody(link.multibody)
        of_base = [0.0] * (self._body.ndofs - scene.n)
        self._body.set_damping([0.0] * self._body.ndofs)
        self._body.set_armature(of_base + (acting.rotor_inertias(scene) / self._world.heaviest).tolist())
        self._body.apply_displacements(of_base + joint_values(scene.angles).tolist())
        self._body.set_generalized_velocity(of_base + joint_values(scene.rates).tolist())
        self._body.forward_kinematics(inside.rigid_bodies)
        self._body.update_rigid_bodies(inside.rigid_bodies, True)

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._world.step(self.state)

    def state(self) -> State:
        """The last of the coordinates: those before are the base's, which has none after the first step."""
        both = self._body.generalized_position()[-self._n :], self._body.generalized_velocity()[-self._n :]
        with np.errstate(all="ignore"):
            q, v = (absolute_values(np.array(values, np.float64)) for values in both)
        return State(q, v)

    def health(self) -> Fault | None:
        return not_finite(self.state())


class _Impulse:
    """Bodies, each with a place and a direction."""

    def __init__(self, scene: Scene, dt: float, substeps: int) -> None:
        self._world, self._scene, self._turns = World(scene, dt, substeps, reduced=False), scene, Turns(scene)

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._world.step(self.state)

    def state(self) -> State:
        return self._turns.follow(self._measure(), self._world.taken * self._world.dt)

    def _measure(self) -> State:
        bodies = [self._world.world.rigid_bodies[handle] for handle in self._world.handles]
        turned = np.array([(body.rotation.k, body.rotation.w) for body in bodies], np.float64)
        omega = np.array([body.angvel.z for body in bodies], np.float64)
        with np.errstate(all="ignore"):
            theta = 2.0 * np.arctan2(turned[:, 0], turned[:, 1])
            places = np.array([(body.translation.x, body.translation.y) for body in bodies], np.float64)
            along = self._scene.lengths[:, np.newaxis] * np.stack([np.sin(theta), -np.cos(theta)], axis=1)
            ends = np.concatenate([np.zeros((1, 2)), (places + along)[:-1]])
            gap = float((np.hypot(*(places - ends).T) / self._scene.lengths).max())
        return State(theta, omega, gap)

    def health(self) -> Fault | None:
        found = self._measure()
        if found.gap > _TORN:
            return Fault("torn", f"a joint is open by {found.gap:.3g} of its rod's length")
        return not_finite(found)


class RapierEngine:
    """Rapier in three dimensions."""

    name = "rapier"
    libraries = ("rapier3d",)
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of the package, which is Rapier's own."""
        return version("rapier3d")

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        """Nothing but effects."""
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
        """A run at time 0."""
        dt = needed_step(method, dt)
        run = _Multibody if method == "multibody" else _Impulse
        return run(scene, dt, int(self.methods[method].with_defaults(settings)["substeps"]))
