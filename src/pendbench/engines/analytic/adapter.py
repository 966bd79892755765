"""The project's own engine: the equations of motion in O(n), advanced by our own solvers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pendbench import __version__
from pendbench.engines.analytic.choice import cheapest
from pendbench.engines.protocol import AdaptiveSimulation, Mapped, Method, Setting, Simulation, needed_step
from pendbench.scene.scene import Scene
from pendbench.solvers.methods import FixedStep, Form, fixed_step_methods

_DEFAULT: Final = 1e-14
_LIMITS: Final = {
    "tolerance": Setting(_DEFAULT, 1e-15, 1e-2, note="local error allowed per step: rad, and relative for rates"),
    "smallest_step": Setting(1e-12, 0.0, 1.0, note="s; a smaller step ends the run with status 'work limit'"),
    "most_steps": Setting(1e8, 1, 1e15, integer=True, note="more steps end the run with status 'work limit'"),
}

_TAYLOR: Final = "Taylor series, 4 orders and 0.9 for each digit of the tolerance; the order claimed is the default's"

_THREADS: Final = "2 work side by side on the halves of the chain, which pays from some 30,000 links on"

_GRAVITY: Final = frozenset({"gravity"})

_FIXED: Final = fixed_step_methods()


def _described(method: FixedStep) -> Method:
    threads = {"threads": Setting(1, 1, method.threads, integer=True, note=_THREADS)} if method.threads > 1 else {}
    return Method(
        order=method.order,
        note=method.note,
        settings=threads,
        substeps=method.substeps,
        effects=_GRAVITY if method.form is Form.RODS else None,
        conserves=method.conserves,
    )


_METHODS: Final = {
    "adaptive": Method(order=8, adaptive=True, settings=_LIMITS, note="DOP853 with compensated summation"),
    "taylor": Method(order=17, adaptive=True, settings=_LIMITS, note=_TAYLOR, dense=True, effects=_GRAVITY),
    **{name: _described(method) for name, method in _FIXED.items()},
}
_FORCES: Final = "forces at the rods' ends in the recursion"
_INERTIAS: Final = "a recursion of its own, with inertias of two directions"
_EFFECTS: Final = {
    "gravity": Mapped("acceleration of the pivot in the recursion"),
    "joint_damping": Mapped(_FORCES),
    "joint_stiffness": Mapped(_FORCES),
    "joint_rest": Mapped(_FORCES),
    "joint_torque": Mapped(_FORCES),
    "air_drag": Mapped("forces on the masses in the recursion"),
    "rod_mass": Mapped(_INERTIAS),
    "driven_pivot": Mapped("acceleration of the pivot in the recursion"),
    "drive_torque": Mapped(_FORCES),
    "armature": Mapped("a recursion of its own, with inertias of two directions and an angle"),
    "links": Mapped(_INERTIAS),
}


class AnalyticEngine:
    """The analytic engine."""

    name = "analytic"
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def default_method(self, scene: Scene, settings: Mapping[str, float | None]) -> str:
        """What is run where no method is named."""
        given = settings.get("tolerance")
        known = given is not None and _LIMITS["tolerance"].fits(given)
        return cheapest(scene, given if known and given is not None else _DEFAULT)

    def version(self) -> str:
        """The project's own."""
        return __version__

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        """Nothing but effects that a method does not know."""
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation | AdaptiveSimulation:
        """A run at time 0. Raises ValueError where a method with a fixed step gets none."""
        from pendbench.engines.analytic import runs  # compiles or loads the kernels

        given = self.methods[method].with_defaults(settings)
        if method in _FIXED:
            dt = needed_step(method, dt)
            return runs.FixedRun(scene, _FIXED[method], dt, **given)
        run = runs.Taylor if method == "taylor" else runs.Adaptive
        return run(scene, given)
