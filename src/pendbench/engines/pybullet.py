"""PyBullet as an engine: a multibody, in joint angles, by Featherstone's algorithm and semi-implicit Euler.

What is on by default and was switched off: a velocity motor in every joint, which holds it; damping of 0.04 of every
link's motion; a limit of 100 rad/s on the rate of a joint; sleep. With these off it has the equations of motion to
rounding: the package is compiled in double precision.

A link may have no inertia about its centre. The integrator adds gyroscopic terms by default; a chain in the plane has
none. Nothing collides, since links have no shapes.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.joint_run import JointRun, gravity_at
from pendbench.engines.joints import bodies, joint_values
from pendbench.engines.protocol import Mapped, Method, Setting, Simulation, needed_step
from pendbench.engines.silence import silenced
from pendbench.scene.scene import Scene

with silenced():  # it says when it was built
    import pybullet as bullet

_METHODS: Final = {
    "multibody": Method(
        1,
        settings={
            "substeps": Setting(1, 1, 1000, integer=True, note="of each step; Bullet's own number is 1"),
            "default_flags": Setting(0, 0, 2, integer=True, note="1: damping and limits stay on; 2: and motors"),
        },
        note="Featherstone's algorithm and semi-implicit Euler, motors and damping off",
    )
}
_TORQUES: Final = "torques in the joints, computed in Python before each step"
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the world"),
    "joint_damping": Mapped(f"{_TORQUES}; its own is another law"),
    "joint_stiffness": Mapped(_TORQUES),
    "joint_rest": Mapped(_TORQUES),
    "joint_torque": Mapped(_TORQUES),
    "air_drag": Mapped(_TORQUES),
    "rod_mass": Mapped("mass, centre and inertia of the links"),
    "driven_pivot": Mapped("gravity of the pivot's frame, set before each step"),
    "drive_torque": Mapped(_TORQUES),
    "armature": Mapped("its joints have no inertia of their own", refused=True),
    "links": Mapped("mass, centre and inertia of the links"),
}
_MOST_LINKS: Final = 127  # MAX_DEGREE_OF_FREEDOM of its interface is 128
#: What is switched off, unless it is to stay as it comes.
_OFF: Final[Mapping[str, Any]] = {
    "linearDamping": 0.0,
    "angularDamping": 0.0,
    "jointDamping": 0.0,
    "maxJointVelocity": 1e12,  # rad/s
    "activationState": bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
}
_ALL: Final = 2  # of `default_flags`: nothing is switched off
_BASES: Final = ("linearDamping", "angularDamping")


class _Chain:
    """A world with one chain in it, each in a physics server of its own."""

    def __init__(self, scene: Scene, dt: float, substeps: int, default: int) -> None:
        self._client, self._joints = bullet.connect(bullet.DIRECT), range(scene.n)
        # A motor is so strong whatever the chain weighs, so it has to hang on the true masses.
        self._scale = 1.0 if default == _ALL else float(bodies(scene).masses.max())
        self._body = self._made(scene, {} if default else _OFF)
        if default != _ALL:
            self._set_motors(bullet.VELOCITY_CONTROL, [0.0] * scene.n)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=dt, numSubSteps=0 if substeps == 1 else substeps, physicsClientId=self._client
        )
        self.pull(*gravity_at(scene, 0.0))
        for joint, angle, rate in zip(
            self._joints, joint_values(scene.angles).tolist(), joint_values(scene.rates).tolist(), strict=True
        ):
            bullet.resetJointState(self._body, joint, angle, rate, physicsClientId=self._client)

    def __del__(self) -> None:
        if hasattr(self, "_client") and bullet.isConnected(self._client):
            bullet.disconnect(self._client)

    def _made(self, scene: Scene, off: Mapping[str, Any]) -> int:
        masses, centres, inertias = bodies(scene)
        n, unturned = scene.n, [0.0, 0.0, 0.0, 1.0]
        ends = [[0.0, 0.0, 0.0], *([0.0, -length, 0.0] for length in scene.lengths[:-1].tolist())]
        body = bullet.createMultiBody(
            baseMass=0.0,
            linkMasses=(masses / self._scale).tolist(),
            linkCollisionShapeIndices=[-1] * n,
            linkVisualShapeIndices=[-1] * n,
            linkPositions=ends,
            linkOrientations=[unturned] * n,
            linkInertialFramePositions=[[0.0, -centre, 0.0] for centre in centres.tolist()],
            linkInertialFrameOrientations=[unturned] * n,
            linkParentIndices=list(range(n)),
            linkJointTypes=[bullet.JOINT_REVOLUTE] * n,
            linkJointAxis=[[0.0, 0.0, 1.0]] * n,
            physicsClientId=self._client,
        )
        for link, inertia in zip(self._joints, (inertias / self._scale).tolist(), strict=True):
            bullet.changeDynamics(body, link, physicsClientId=self._client, **off)
            # A call of its own: beside the others it is lost.
            bullet.changeDynamics(body, link, localInertiaDiagonal=[inertia] * 3, physicsClientId=self._client)
        bullet.changeDynamics(body, -1, physicsClientId=self._client, **{key: 0.0 for key in off if key in _BASES})
        return int(body)

    def _set_motors(self, mode: int, forces: list[float]) -> None:
        bullet.setJointMotorControlArray(self._body, self._joints, mode, forces=forces, physicsClientId=self._client)

    def step(self, steps: int) -> None:
        for _ in range(steps):
            bullet.stepSimulation(physicsClientId=self._client)

    def read(self) -> tuple[FloatArray, FloatArray]:
        states = bullet.getJointStates(self._body, self._joints, physicsClientId=self._client)
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def pull(self, x: float, y: float) -> None:
        bullet.setGravity(x, y, 0.0, physicsClientId=self._client)

    def push(self, torques: FloatArray) -> None:
        self._set_motors(bullet.TORQUE_CONTROL, (torques / self._scale).tolist())


class PybulletEngine:
    """PyBullet, in its own process, without a window."""

    name = "pybullet"
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of the package."""
        return version("pybullet")

    def refuses(self, scene: Scene) -> str | None:
        """Chains of more joints than its interface has."""
        if scene.n > _MOST_LINKS:
            return f"{scene.n} links; PyBullet has bodies of at most {_MOST_LINKS}"
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
        """A run at time 0."""
        dt = needed_step(method, dt)
        chosen = self.methods[method].with_defaults(settings)
        return JointRun(scene, dt, _Chain(scene, dt, int(chosen["substeps"]), int(chosen["default_flags"])))
