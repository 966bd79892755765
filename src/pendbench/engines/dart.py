"""DART as an engine, from the package `dartpy`: a skeleton, in joint angles, by semi-implicit Euler.

`World.step` computes accelerations by Featherstone's algorithm, then rates, then angles. Deactivation of slow skeletons
is on by default, so a chain that turns about stops at a turning point; it is switched off. Joints have no damping
unless one is set. DART puts zero in the place of an acceleration that is not finite, so a run that blows up may look
like one that stands still: rates beyond all reason are reported as not finite.

A body may have no inertia about its centre, so a point mass is a body with its mass at the rod's end.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any, Final

import dartpy
import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.joint_run import JointRun, gravity_at
from pendbench.engines.joints import bodies, joint_values
from pendbench.engines.protocol import Mapped, Method, Setting, Simulation, needed_step
from pendbench.engines.silence import silenced
from pendbench.scene.scene import Scene

_METHODS: Final = {
    "euler": Method(
        1,
        settings={"default_flags": Setting(0, 0, 1, integer=True, note="1: deactivation stays on")},
        note="Featherstone's algorithm and semi-implicit Euler, deactivation off",
    )
}
_TORQUES: Final = "torques in the joints, computed in Python before each step"
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
    "armature": Mapped("its joints have no inertia of their own", refused=True),
    "links": Mapped("mass, centre and inertia of the bodies"),
}
_BEYOND_REASON: Final = 1e15  # rad/s


class _Chain:
    """A world with one skeleton."""

    def __init__(self, scene: Scene, dt: float, default: bool) -> None:
        with silenced():  # it warns of points, which have no moment of inertia, and simulates them as it should
            self._skeleton = _skeleton(scene)
        self._world = dartpy.simulation.World()
        options = dartpy.simulation.DeactivationOptions()
        options.mEnabled = default
        self._world.setDeactivationOptions(options)
        self._world.setTimeStep(dt)
        self.pull(*gravity_at(scene, 0.0))
        self._skeleton.setPositions(joint_values(scene.angles))
        self._skeleton.setVelocities(joint_values(scene.rates))
        self._world.addSkeleton(self._skeleton)

    def step(self, steps: int) -> None:
        with silenced():  # it warns of each acceleration that is not finite
            for _ in range(steps):
                self._world.step()

    def read(self) -> tuple[FloatArray, FloatArray]:
        q, v = np.array(self._skeleton.getPositions()), np.array(self._skeleton.getVelocities())
        return q, np.where(np.abs(v) < _BEYOND_REASON, v, np.nan)

    def pull(self, x: float, y: float) -> None:
        self._world.setGravity(np.array([x, y, 0.0]))

    def push(self, torques: FloatArray) -> None:
        self._skeleton.setForces(torques)


def _skeleton(scene: Scene) -> Any:
    """The chain: each rod lies along -y of its body's frame, whose origin is its joint."""
    chain, above = dartpy.dynamics.Skeleton("chain"), None
    offsets = np.append(0.0, scene.lengths[:-1])
    for offset, mass, centre, inertia in np.stack([offsets, *bodies(scene)], axis=1).tolist():
        joint, body = chain.createRevoluteJointAndBodyNodePair(*([] if above is None else [above]))
        joint.setAxis(np.array([0.0, 0.0, 1.0]))
        place = dartpy.math.Isometry3()
        place.set_translation(np.array([0.0, -offset, 0.0]))
        joint.setTransformFromParentBodyNode(place)
        body.setInertia(dartpy.dynamics.Inertia(mass, np.array([0.0, -centre, 0.0]), inertia * np.eye(3)))
        above = body
    return chain


class DartEngine:
    """DART, in double precision."""

    name = "dart"
    libraries = ("dartpy",)
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of the package, which is DART's own."""
        return version("dartpy")

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        """Nothing but effects."""
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
        """A run at time 0."""
        dt = needed_step(method, dt)
        default = bool(self.methods[method].with_defaults(settings)["default_flags"])
        return JointRun(scene, dt, _Chain(scene, dt, default))
