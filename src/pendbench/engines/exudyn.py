"""Exudyn as an engine: its kinematic tree, in joint angles, under its own solvers, one step at a time.

The tree is in minimal coordinates: no joint is a constraint, so nothing can come apart. A link may have no inertia
about its centre. Nothing has to be switched off: there is no damping by default. Its default solver, generalised alpha,
has a spectral radius of 0.9, which damps what swings within a few steps, and nothing else.

Effects are a user function in Python that is called at every evaluation of the equations, so methods keep their order.
A new call of `SolveDynamic` forgets what the implicit solvers know of the last step; so its solvers are driven by the
functions that `SolveSteps` itself consists of.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import exudyn
import numpy as np
from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree

from pendbench.base.faults import Fault
from pendbench.engines.joint_run import gravity_at, torques_in_joints, weights_in_joints
from pendbench.engines.joints import absolute_values, bodies, joint_values
from pendbench.engines.protocol import Mapped, Method, Simulation, State, needed_step, not_finite
from pendbench.physics import acting
from pendbench.scene.scene import Scene


class _Solver(NamedTuple):
    """What Exudyn calls it, whether it is explicit, the order, and a note."""

    its_name: str
    explicit: bool
    order: int
    note: str


_SOLVERS: Final = {
    "generalized_alpha": _Solver("GeneralizedAlpha", False, 2, "implicit, Exudyn's default, spectral radius 0.9"),
    "trapezoidal": _Solver("TrapezoidalIndex2", False, 2, "the implicit trapezoidal rule"),
    "rk4": _Solver("RK44", True, 4, "the classical Runge-Kutta method"),
    "rk6": _Solver("RK67", True, 6, "a Runge-Kutta method of seven stages"),
    "euler": _Solver("ExplicitEuler", True, 1, "explicit Euler, of angles and rates"),
}
_METHODS: Final = {name: Method(solver.order, note=solver.note) for name, solver in _SOLVERS.items()}
_FORCES: Final = "torques in the joints, a user function in Python at every evaluation"
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the tree"),
    "joint_damping": Mapped(_FORCES),
    "joint_stiffness": Mapped(_FORCES),
    "joint_rest": Mapped(_FORCES),
    "joint_torque": Mapped(_FORCES),
    "air_drag": Mapped(_FORCES),
    "rod_mass": Mapped("mass, centre and inertia of the links"),
    "driven_pivot": Mapped(f"{_FORCES}: the weight in the pivot's frame"),
    "drive_torque": Mapped(_FORCES),
    "armature": Mapped("its joints have no inertia of their own", refused=True),
    "links": Mapped("mass, centre and inertia of the links"),
}
_START: Final = exudyn.ConfigurationType.StartOfStep
_MANY: Final = 1_000_000_000  # steps that a solver is told of; it is never asked for all


class _Run:
    """One chain under one solver."""

    def __init__(self, scene: Scene, solver: _Solver, dt: float) -> None:
        self._failed = False
        self._container = exudyn.SystemContainer()
        self._mbs = self._container.AddSystem()
        self._add(scene)
        self._mbs.Assemble()
        self._settings = _settings(solver, dt)
        self._solver = exudyn.MainSolverExplicit() if solver.explicit else exudyn.MainSolverImplicitSecondOrder()
        self._solver.InitializeSolver(self._mbs, self._settings)
        self._solver.it.currentStepSize = self._dt = dt
        self._taken = 0

    def _add(self, scene: Scene) -> None:
        n, (masses, centres, inertias) = scene.n, bodies(scene)
        offsets = np.append(0.0, scene.lengths[:-1])
        node = self._mbs.AddNode(
            NodeGenericODE2(
                referenceCoordinates=[0.0] * n,
                initialCoordinates=joint_values(scene.angles).tolist(),
                initialCoordinates_t=joint_values(scene.rates).tolist(),
                numberOfODE2Coordinates=n,
            )
        )
        changing = acting.is_shaken(scene) or acting.is_pushed(scene)
        self._mbs.AddObject(
            ObjectKinematicTree(
                nodeNumber=node,
                jointTypes=[exudyn.JointType.RevoluteZ] * n,
                linkParents=list(range(-1, n - 1)),
                jointTransformations=exudyn.Matrix3DList([np.eye(3)] * n),
                jointOffsets=exudyn.Vector3DList([[0.0, -offset, 0.0] for offset in offsets.tolist()]),
                linkInertiasCOM=exudyn.Matrix3DList([inertia * np.eye(3) for inertia in inertias.tolist()]),
                linkCOMs=exudyn.Vector3DList([[0.0, -centre, 0.0] for centre in centres.tolist()]),
                linkMasses=masses.tolist(),
                gravity=[0.0, 0.0, 0.0] if changing else [*gravity_at(scene, 0.0), 0.0],
                **({"forceUserFunction": self._forces(scene)} if changing else {}),
            )
        )

    def _forces(self, scene: Scene) -> Callable[..., list[float]]:
        """The torques in the joints at each evaluation. It must not raise: Exudyn would print that and go on."""

        def forces(_: Any, t: float, __: int, q: Any, v: Any) -> list[float]:
            q, v = np.array(q), np.array(v)
            with np.errstate(all="ignore"):
                return list(weights_in_joints(scene, t, q) + torques_in_joints(scene, t, q, v))

        return forces

    def advance(self, steps: int) -> None:
        mbs, settings, solver = self._mbs, self._settings, self._solver
        for _ in range(steps):
            if self._failed:
                return
            mbs.systemData.SetTime(self._taken * self._dt, _START)  # the explicit solvers leave that to `SolveSteps`
            solver.InitializeStep(mbs, settings)
            self._failed = not solver.DiscontinuousIteration(mbs, settings)
            solver.FinishStep(mbs, settings)
            self._taken += 1

    def state(self) -> State:
        q, v = self._mbs.systemData.GetODE2Coordinates(), self._mbs.systemData.GetODE2Coordinates_t()
        with np.errstate(all="ignore"):
            return State(absolute_values(np.array(q)), absolute_values(np.array(v)))

    def health(self) -> Fault | None:
        if fault := not_finite(self.state()):
            return fault
        if self._failed:
            return Fault("not converged", "Newton's method gave up in a step")
        return None


def _settings(solver: _Solver, dt: float) -> Any:
    chosen = exudyn.SimulationSettings()
    chosen.timeIntegration.solverType = getattr(exudyn.DynamicSolverType, solver.its_name)
    chosen.timeIntegration.numberOfSteps = _MANY
    chosen.timeIntegration.endTime = _MANY * dt
    chosen.timeIntegration.verboseMode = 0
    chosen.timeIntegration.generalizedAlpha.useNewmark = solver.its_name == "TrapezoidalIndex2"
    chosen.timeIntegration.generalizedAlpha.useIndex2Constraints = solver.its_name == "TrapezoidalIndex2"
    chosen.solution.file.write = False
    return chosen


class ExudynEngine:
    """Exudyn, in double precision, without its renderer."""

    name = "exudyn"
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of Exudyn itself."""
        return str(exudyn.__version__)

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        """Nothing but effects."""
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:  # noqa: ARG002
        """A run at time 0; no method has settings."""
        dt = needed_step(method, dt)
        return _Run(scene, _SOLVERS[method], dt)
