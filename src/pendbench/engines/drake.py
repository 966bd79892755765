"""Drake as an engine, from the package `drake`: a multibody plant, in joint angles, discrete or under its integrators.

A plant with a time step advances by its discrete solver, semi-implicit Euler without contacts; one without is
integrated with control of the error, in accuracies that are those of each step. Pure point masses are allowed, and
nothing has to be switched off: a revolute joint has no damping unless it is given.

Effects are a system in Python whose output is the plant's generalised force. It is asked at each step of the discrete
plant and at each evaluation of the others, so methods keep their order.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any, Final

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, RotationalInertia, SpatialInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from pendbench.base.faults import Fault
from pendbench.engines.joint_run import gravity_at, torques_in_joints, weights_in_joints
from pendbench.engines.joints import absolute_values, bodies, joint_values
from pendbench.engines.protocol import Mapped, Method, Setting, State, needed_step, not_finite
from pendbench.physics import acting
from pendbench.scene.scene import Scene

_ACCURACY: Final = {"tolerance": Setting(1e-4, 1e-13, 1e-2, note="accuracy, of a step; Drake's own is 1e-4")}
_SCHEMES: Final = {"rk3": "runge_kutta3", "rk5": "runge_kutta5"}
_METHODS: Final = {
    "discrete": Method(1, note="the discrete plant: semi-implicit Euler"),
    "rk3": Method(3, adaptive=True, settings=_ACCURACY, note="Runge-Kutta of order 3 (2), Drake's default"),
    "rk5": Method(5, adaptive=True, settings=_ACCURACY, note="Runge-Kutta of order 5 (4)"),
}
_LONGEST_STEP: Final = 0.1  # s, Drake's own
_FORCES: Final = "generalised force, a system in Python at every evaluation"
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the plant"),
    "joint_damping": Mapped(_FORCES),
    "joint_stiffness": Mapped(_FORCES),
    "joint_rest": Mapped(_FORCES),
    "joint_torque": Mapped(_FORCES),
    "air_drag": Mapped(_FORCES),
    "rod_mass": Mapped("mass, centre and inertia of the bodies"),
    "driven_pivot": Mapped(f"{_FORCES}: the weight in the pivot's frame"),
    "drive_torque": Mapped(_FORCES),
    "armature": Mapped("its rotors belong to actuators, which the adapter does not add", refused=True),
    "links": Mapped("mass, centre and inertia of the bodies"),
}


class _Forces(LeafSystem):  # type: ignore[misc]
    """What acts on a chain besides constant gravity."""

    def __init__(self, scene: Scene) -> None:
        LeafSystem.__init__(self)
        self._scene = scene
        self.DeclareVectorInputPort("state", 2 * scene.n)
        self.DeclareVectorOutputPort("torques", scene.n, self._torques)

    def _torques(self, context: Any, output: Any) -> None:
        q, v = np.split(self.get_input_port(0).Eval(context), 2)
        t = context.get_time()
        with np.errstate(all="ignore"):
            output.SetFromVector(weights_in_joints(self._scene, t, q) + torques_in_joints(self._scene, t, q, v))


def _plant(scene: Scene, dt: float, gravity: tuple[float, float]) -> Any:
    """Each rod lies along -y of its body's frame, its joint at the origin."""
    plant = MultibodyPlant(time_step=dt)
    above, offset = plant.world_body(), 0.0
    for i, (mass, centre, inertia) in enumerate(np.stack(bodies(scene), axis=1).tolist()):
        moments = RotationalInertia(inertia, 0.0, inertia)  # of a thin rod: Drake wants those of a real body
        its = SpatialInertia.MakeFromCentralInertia(mass=mass, p_PScm_E=[0.0, -centre, 0.0], I_SScm_E=moments)
        body = plant.AddRigidBody(f"link {i}", its)
        end = plant.AddFrame(FixedOffsetFrame(f"end {i}", above.body_frame(), RigidTransform([0.0, -offset, 0.0])))
        plant.AddJoint(RevoluteJoint(f"joint {i}", end, body.body_frame(), [0.0, 0.0, 1.0], damping=0.0))
        above, offset = body, float(scene.lengths[i])
    plant.mutable_gravity_field().set_gravity_vector([*gravity, 0.0])
    plant.Finalize()
    return plant


class _Chain:
    """A chain in a simulator, at its start."""

    def __init__(self, scene: Scene, dt: float) -> None:
        changing = acting.is_shaken(scene) or acting.is_pushed(scene)
        builder = DiagramBuilder()
        self._plant = builder.AddSystem(_plant(scene, dt, (0.0, 0.0) if changing else gravity_at(scene, 0.0)))
        if changing:
            forces = builder.AddSystem(_Forces(scene))
            builder.Connect(self._plant.get_state_output_port(), forces.get_input_port(0))
            builder.Connect(forces.get_output_port(0), self._plant.get_applied_generalized_force_input_port())
        self.simulator = Simulator(builder.Build())
        self._own = self._plant.GetMyContextFromRoot(self.simulator.get_mutable_context())
        self._plant.SetPositions(self._own, joint_values(scene.angles))
        self._plant.SetVelocities(self._own, joint_values(scene.rates))
        self._wrong = ""

    def advance_to(self, time: float) -> None:
        """Or not, where Drake raises, which it does for what is not finite."""
        if self._wrong:
            return
        try:
            self.simulator.AdvanceTo(time)
        except (RuntimeError, ValueError) as error:
            self._wrong = " ".join(str(error).split())

    def state(self) -> State:
        q, v = self._plant.GetPositions(self._own), self._plant.GetVelocities(self._own)
        with np.errstate(all="ignore"):
            return State(absolute_values(q), absolute_values(v))

    def health(self) -> Fault | None:
        if fault := not_finite(self.state()):
            return fault
        return Fault("work limit", self._wrong) if self._wrong else None


class _Discrete:
    """A plant with a step. An update is due at the beginning of its step: after k of them it is between two."""

    def __init__(self, scene: Scene, dt: float) -> None:
        self._chain, self._dt, self._taken = _Chain(scene, dt), dt, 0
        self.state, self.health = self._chain.state, self._chain.health

    def advance(self, steps: int) -> None:
        self._taken += steps
        self._chain.advance_to((self._taken - 0.5) * self._dt)


class _Integrated:
    """A plant without one."""

    def __init__(self, scene: Scene, scheme: str, accuracy: float) -> None:
        self._chain = _Chain(scene, 0.0)
        self.state, self.health = self._chain.state, self._chain.health
        ResetIntegratorFromFlags(self._chain.simulator, scheme, _LONGEST_STEP)
        self._integrator = self._chain.simulator.get_mutable_integrator()
        self._integrator.set_target_accuracy(accuracy)

    def advance_to(self, time: float) -> int:
        before = self._integrator.get_num_steps_taken()
        self._chain.advance_to(time)
        return int(self._integrator.get_num_steps_taken() - before)


class DrakeEngine:
    """Drake, in double precision."""

    name = "drake"
    libraries = ("pydrake",)
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of Drake itself."""
        return version("drake")

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        """Nothing but effects."""
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> _Discrete | _Integrated:
        """A run at time 0."""
        if method in _SCHEMES:
            return _Integrated(scene, _SCHEMES[method], self.methods[method].with_defaults(settings)["tolerance"])
        return _Discrete(scene, needed_step(method, dt))
