"""The project's own engine: the equations of motion in O(n), advanced by our own solvers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pendbench import __version__
from pendbench.engines.protocol import AdaptiveSimulation, Mapped, Method, Setting, Simulation
from pendbench.scene import Scene

_LIMITS: Final = {
    "tolerance": Setting(1e-14, 1e-15, 1e-2, note="local error allowed per step: rad, and relative for rates"),
    "smallest_step": Setting(1e-12, 0.0, 1.0, note="s; a smaller step ends the run with status 'work limit'"),
    "most_steps": Setting(1e8, 1, 1e15, integer=True, note="more steps end the run with status 'work limit'"),
}

_TAYLOR: Final = "Taylor series, 4 orders and 0.9 for each digit of the tolerance; the order claimed is the default's"

_GRAVITY: Final = frozenset({"gravity"})

_METHODS: Final = {
    "adaptive": Method(order=8, adaptive=True, settings=_LIMITS, note="DOP853 with compensated summation"),
    "taylor": Method(order=17, adaptive=True, settings=_LIMITS, note=_TAYLOR, dense=True, effects=_GRAVITY),
    "rk4": Method(order=4, note="the classical Runge-Kutta method"),
    "euler": Method(order=1, note="semi-implicit Euler, the method of most engines for games"),
    "gauss4": Method(order=4, note="Gauss-Legendre collocation with two stages: implicit, symplectic"),
    "gauss6": Method(order=6, note="Gauss-Legendre collocation with three stages: implicit, symplectic"),
    "rattle": Method(order=2, note="constrained Cartesian Stormer-Verlet: symplectic, for large n", effects=_GRAVITY),
    "frame": Method(order=2, substeps=True, note="RATTLE in as many equal steps as needed", effects=_GRAVITY),
}
_FORCES: Final = "forces at the rods' ends in the recursion"
_EFFECTS: Final = {
    "gravity": Mapped("acceleration of the pivot in the recursion"),
    "joint_damping": Mapped(_FORCES),
    "joint_stiffness": Mapped(_FORCES),
    "air_drag": Mapped("forces on the masses in the recursion"),
    "rod_mass": Mapped("a recursion of its own, with inertias of two directions"),
    "driven_pivot": Mapped("acceleration of the pivot in the recursion"),
    "drive_torque": Mapped(_FORCES),
}


class AnalyticEngine:
    """The analytic engine."""

    name = "analytic"
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The project's own."""
        return __version__

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        """Nothing but effects that a method does not know."""
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation | AdaptiveSimulation:
        """A run at time 0. Raises ValueError where a method with a fixed step gets none."""
        from pendbench.engines import analytic_runs as runs  # compiles or loads the kernels
        from pendbench.solvers.tableaux import RK4

        if self.methods[method].adaptive:
            run = runs.Taylor if method == "taylor" else runs.Adaptive
            return run(scene, self.methods[method].with_defaults(settings))
        if dt is None:
            raise ValueError(f"method {method!r} needs a step")
        match method:
            case "rk4":
                return runs.RungeKutta(scene, dt, RK4)
            case "euler":
                return runs.SemiImplicitEuler(scene, dt)
            case "rattle":
                return runs.Rattle(scene, dt)
            case "frame":
                return runs.Frame(scene, dt)
            case _:
                return runs.Gauss(scene, dt, stages=self.methods[method].order // 2)
