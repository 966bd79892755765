"""Exudyn as an engine: its kinematic tree, in joint angles, under its own solvers.

The tree is in minimal coordinates: no joint is a constraint, so nothing can come apart. A link may have no inertia
about its centre. Nothing has to be switched off: there is no damping by default. Its default solver, generalised alpha,
has a spectral radius of 0.9, which damps what swings within a few steps, and nothing else.

Effects are a user function in Python that is called at every evaluation of the equations, so methods keep their order.
A new call of `SolveDynamic` forgets what the implicit solvers know of the last step; so those with a fixed step are
made once and asked to go on by `SolveSteps`. What that consists of can be called too, and must not be: where Newton's
method begins a step again, it begins at the state that `SolveSteps` alone keeps. DOPRI5, which chooses its steps, is
explicit and knows nothing of the last: each advance is a call of its own, from the state that the one before left.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

import exudyn
import numpy as np
from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree

from pendbench.base.faults import Fault
from pendbench.engines.joint_run import gravity_at, torques_in_joints, weights_in_joints
from pendbench.engines.joints import absolute_values, bodies, joint_values
from pendbench.engines.protocol import (
    AdaptiveSimulation,
    Mapped,
    Method,
    Setting,
    Simulation,
    State,
    needed_step,
    not_finite,
)
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
_TOLERANCE: Final = {"tolerance": Setting(1e-8, 1e-13, 1e-2, note="of a step, relative and absolute; Exudyn's is 1e-8")}
_METHODS: Final = {
    **{name: Method(solver.order, note=solver.note) for name, solver in _SOLVERS.items()},
    "dopri5": Method(5, adaptive=True, settings=_TOLERANCE, note="Runge-Kutta of order 5 (4), of Dormand and Prince"),
}
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
_INITIAL: Final = exudyn.ConfigurationType.Initial
_SHORTEST_STEP: Final = 1e-12  # s; Exudyn's own is 1e-8
_FIRST_STEP: Final = 0.01  # s, the longest that Exudyn takes by default; one that ends in infinities would be kept
exudyn.config.suppressWarnings = True  # it prints them


class _Chain:
    """One chain, at its start."""

    def __init__(self, scene: Scene) -> None:
        self._container = exudyn.SystemContainer()
        self.mbs = self._container.AddSystem()
        self._add(scene)
        self.mbs.Assemble()

    def _add(self, scene: Scene) -> None:
        n, (masses, centres, inertias) = scene.n, bodies(scene)
        offsets = np.append(0.0, scene.lengths[:-1])
        node = self.mbs.AddNode(
            NodeGenericODE2(
                referenceCoordinates=[0.0] * n,
                initialCoordinates=joint_values(scene.angles).tolist(),
                initialCoordinates_t=joint_values(scene.rates).tolist(),
                numberOfODE2Coordinates=n,
            )
        )
        changing = acting.is_shaken(scene) or acting.is_pushed(scene)
        self.mbs.AddObject(
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

    def state(self) -> State:
        """The state now."""
        q, v = self.mbs.systemData.GetODE2Coordinates(), self.mbs.systemData.GetODE2Coordinates_t()
        with np.errstate(all="ignore"):
            return State(absolute_values(np.array(q)), absolute_values(np.array(v)))


@contextmanager
def _interruptible() -> Iterator[None]:
    """Exudyn makes an error of an interrupt that comes while it is at work, or in a user function: it is one again."""
    try:
        yield
    except Exception as error:
        if isinstance(error.__cause__, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        raise


class _Stepped:
    """A run with a fixed step."""

    def __init__(self, scene: Scene, solver: _Solver, dt: float) -> None:
        self._chain, self._failed, self._taken, self._dt = _Chain(scene), False, 0, dt
        self.state = self._chain.state
        self._settings = _settings(solver.its_name)
        self._settings.timeIntegration.adaptiveStep = False
        self._settings.timeIntegration.numberOfSteps = 1
        self._settings.timeIntegration.endTime = dt  # so that this is its step, to the bit
        self._implicit = not solver.explicit
        self._solver = exudyn.MainSolverImplicitSecondOrder() if self._implicit else exudyn.MainSolverExplicit()
        self._solver.InitializeSolver(self._chain.mbs, self._settings)

    def advance(self, steps: int) -> None:
        at_once = 1 if self._implicit else max(steps, 1)  # a call begins with a new Jacobian: so it is one every step
        with _interruptible():
            for _ in range(0, steps, at_once):
                if self._failed:
                    return
                self._advance(at_once)

    def _advance(self, steps: int) -> None:
        now = self._solver.it
        now.startTime = self._taken * self._dt
        self._taken += steps
        now.endTime = (self._taken - 0.5) * self._dt  # the first step past it is the last
        self._failed = not self._solver.SolveSteps(self._chain.mbs, self._settings)

    def health(self) -> Fault | None:
        if fault := not_finite(self.state()):
            return fault
        return Fault("not converged", "Newton's method gave up in a step") if self._failed else None


class _Chosen:
    """A run that chooses its steps, in each advance from a short one on."""

    def __init__(self, scene: Scene, tolerance: float) -> None:
        self._chain, self._time, self._failed = _Chain(scene), 0.0, False
        self.state = self._chain.state
        self._settings = _settings("DOPRI5")
        chosen = self._settings.timeIntegration
        chosen.absoluteTolerance = chosen.relativeTolerance = tolerance
        chosen.minimumStepSize = _SHORTEST_STEP
        chosen.numberOfSteps = 1  # no step is longer than the time to be advanced

    def advance_to(self, time: float) -> int:
        if self._failed or time <= self._time:
            return 0
        chosen = self._settings.timeIntegration
        chosen.startTime, chosen.endTime = self._time, time
        chosen.initialStepSize = min(_FIRST_STEP, time - self._time)
        solver, data = exudyn.MainSolverExplicit(), self._chain.mbs.systemData
        with _interruptible():
            self._failed = not solver.SolveSystem(self._chain.mbs, self._settings)
        data.SetODE2Coordinates(data.GetODE2Coordinates(), _INITIAL)
        data.SetODE2Coordinates_t(data.GetODE2Coordinates_t(), _INITIAL)
        data.SetTime(time, _INITIAL)
        self._time = time
        return int(solver.it.currentStepIndex) - 1

    def health(self) -> Fault | None:
        if fault := not_finite(self.state()):
            return fault
        return Fault("work limit", "its control of the step gave up") if self._failed else None


def _settings(its_name: str) -> Any:
    chosen = exudyn.SimulationSettings()
    chosen.timeIntegration.solverType = getattr(exudyn.DynamicSolverType, its_name)
    chosen.timeIntegration.verboseMode = 0
    chosen.timeIntegration.generalizedAlpha.useNewmark = its_name == "TrapezoidalIndex2"
    chosen.timeIntegration.generalizedAlpha.useIndex2Constraints = its_name == "TrapezoidalIndex2"
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

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation | AdaptiveSimulation:
        """A run at time 0."""
        if method == "dopri5":
            return _Chosen(scene, self.methods[method].with_defaults(settings)["tolerance"])
        return _Stepped(scene, _SOLVERS[method], needed_step(method, dt))
