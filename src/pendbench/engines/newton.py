"""Newton as an engine: its two solvers in joint angles, Featherstone and Steel, on a processor.

All numbers are of single precision, and nothing has to be switched off: Featherstone's angular damping of 0.05 is a
setting that no kernel of it reads, and limits of the joints have no stiffness here. A step is some launches of kernels
from Python, and the first one compiles for 20 s, unless Warp has them in its cache. Derivatives of Featherstone's
kernels, which nobody asks for here, would take 13 s more.

Newton's other solvers are no methods: docs/engines.md says of each why.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.joint_run import JointRun, gravity_at
from pendbench.engines.joints import bodies, joint_values
from pendbench.engines.protocol import Mapped, Method, Simulation, needed_step
from pendbench.engines.silence import silenced
from pendbench.physics import acting
from pendbench.scene.scene import Scene

with silenced():  # it says which devices there are
    import warp

    warp.config.log_level = warp.LOG_ERROR  # and later what it compiles


@contextmanager
def _without_derivatives() -> Iterator[None]:
    """Modules of kernels that come to be in the meantime have none, which takes half as long to compile."""
    kept, warp.config.enable_backward = warp.config.enable_backward, False
    try:
        yield
    finally:
        warp.config.enable_backward = kept


with silenced(), _without_derivatives():
    import newton

    warp.init()

_SOLVERS: Final = {"featherstone": "SolverFeatherstone", "steel": "SolverSteel"}
_METHODS: Final = {
    "featherstone": Method(1, single=True, plateau=5e-4, note="semi-implicit Euler"),
    "steel": Method(1, single=True, plateau=5e-4, note="semi-implicit Euler; Newton's newest solver, experimental"),
}
_TORQUES: Final = "torques in the joints, computed in Python before each step"
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the model"),
    "joint_damping": Mapped(_TORQUES),
    "joint_stiffness": Mapped(_TORQUES),
    "joint_rest": Mapped(_TORQUES),
    "joint_torque": Mapped(_TORQUES),
    "air_drag": Mapped(_TORQUES),
    "rod_mass": Mapped("mass, centre and inertia of the links"),
    "driven_pivot": Mapped("gravity of the pivot's frame, set before each step"),
    "drive_torque": Mapped(_TORQUES),
    "armature": Mapped("armature of the joints"),
    "links": Mapped("mass, centre and inertia of the links"),
}
_MOST_LINKS: Final = 64  # a step factorises a dense matrix in one thread
_FAR: Final = 1e9  # rad: no limit


class _Chain:
    """A model with one articulation, and two states that take turns."""

    def __init__(self, scene: Scene, method: str, dt: float) -> None:
        self._dt, self._heaviest = dt, float(bodies(scene).masses.max())
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # points have no inertia, of which it warns
            self._model = self._made(scene).finalize(device="cpu")
        self._now, self._next = self._model.state(), self._model.state()
        self._control = self._model.control()
        newton.eval_fk(self._model, self._model.joint_q, self._model.joint_qd, self._now)
        with _without_derivatives():
            self._solver = getattr(newton.solvers, _SOLVERS[method])(self._model)
            self._solver.step(self._now, self._next, self._control, None, dt)  # compiles, and is forgotten

    def _made(self, scene: Scene) -> Any:
        builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(*gravity_at(scene, 0.0), 0.0))
        rotors = acting.rotor_inertias(scene)
        offsets = np.append(0.0, scene.lengths[:-1])
        masses, centres, inertias = bodies(scene)
        joints, above = [], -1
        for rotor, offset, mass, centre, inertia in np.stack([rotors, offsets, masses, centres, inertias], 1).tolist():
            its = {"mass": mass / self._heaviest, "inertia": np.eye(3) * inertia / self._heaviest}
            link = builder.add_link(com=(0.0, -centre, 0.0), lock_inertia=True, **its)
            place = warp.transform((0.0, -offset, 0.0), warp.quat_identity())
            limits = {"limit_lower": -_FAR, "limit_upper": _FAR, "limit_ke": 0.0, "limit_kd": 0.0, "friction": 0.0}
            joint = builder.add_joint_revolute(
                above, link, parent_xform=place, axis=(0.0, 0.0, 1.0), armature=rotor / self._heaviest, **limits
            )
            joints.append(joint)
            above = link
        builder.add_articulation(joints)
        builder.joint_q[:] = joint_values(scene.angles).tolist()
        builder.joint_qd[:] = joint_values(scene.rates).tolist()
        return builder

    def step(self, steps: int) -> None:
        for _ in range(steps):
            self._now.clear_forces()
            self._solver.step(self._now, self._next, self._control, None, self._dt)
            self._now, self._next = self._next, self._now

    def read(self) -> tuple[FloatArray, FloatArray]:
        q, v = self._now.joint_q.numpy(), self._now.joint_qd.numpy()
        return q.astype(np.float64), v.astype(np.float64)

    def pull(self, x: float, y: float) -> None:
        self._model.set_gravity((x, y, 0.0))

    def push(self, torques: FloatArray) -> None:
        self._control.joint_f.assign((torques / self._heaviest).astype(np.float32))


class NewtonEngine:
    """Newton, on a processor."""

    name = "newton"
    libraries = ("newton", "warp")
    compiles = True
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of Newton, and that of Warp."""
        return f"{version('newton')}, Warp {version('warp-lang')}"

    def refuses(self, scene: Scene) -> str | None:
        """Chains whose steps take too long."""
        if scene.n > _MOST_LINKS:
            return f"{scene.n} links; a step of more than {_MOST_LINKS} takes Newton too long on a processor"
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:  # noqa: ARG002
        """A run at time 0; no method has settings."""
        return JointRun(scene, needed_step(method, dt), _Chain(scene, method, needed_step(method, dt)))
