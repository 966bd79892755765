"""Exudyn as an engine: what it can do, and which run does it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import exudyn

from pendbench.engines.exudyn.runs import Chosen, Explicit, Implicit
from pendbench.engines.protocol import AdaptiveSimulation, Mapped, Method, Setting, Simulation, needed_step
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
_TOLERANCE: Final = {"tolerance": Setting(1e-8, 1e-13, 1e-2, note="of a step, rad and rad/s; Exudyn's is 1e-8")}
_METHODS: Final = {
    **{name: Method(its.order, substeps=not its.explicit, note=its.note) for name, its in _SOLVERS.items()},
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
            return Chosen(scene, self.methods[method].with_defaults(settings)["tolerance"])
        its = _SOLVERS[method]
        return (Explicit if its.explicit else Implicit)(scene, its.its_name, needed_step(method, dt))
