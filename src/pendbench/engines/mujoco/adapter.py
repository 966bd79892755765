"""MuJoCo as an engine: hinges between bodies that are made into point masses, in joint angles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import mujoco

from pendbench.engines.joints import absolute_values, joint_values
from pendbench.engines.mujoco.forces import applied_forces, constant_torques
from pendbench.engines.mujoco.mjcf import compile_chain
from pendbench.engines.mujoco.run import Run
from pendbench.engines.protocol import Mapped, Method, Setting, Simulation, State, needed_step
from pendbench.scene.scene import Scene

# New in MuJoCo 3.13: with an older one there is no such method, and who asks for it is told which there are.
_DISCRETE: Final = getattr(mujoco.mjtIntegrator, "mjINT_DISCRETE", None)
_INTEGRATORS: Final = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "euler_explicit": mujoco.mjtIntegrator.mjINT_EULER,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "discrete": _DISCRETE,
}
#: What a model file calls them.
_IN_FILES: Final = {
    "euler": "Euler",
    "euler_explicit": "Euler",
    "rk4": "RK4",
    "implicit": "implicit",
    "implicitfast": "implicitfast",
    "discrete": "discrete",
}
_SETTINGS: Final = {
    "default_flags": Setting(0, 0, 1, integer=True, note="1: what MuJoCo has on by itself is not turned off"),
}


def _method(order: int, note: str) -> Method:
    return Method(order=order, settings=_SETTINGS, note=note)


_METHODS: Final = {
    "euler": _method(1, "semi-implicit Euler, MuJoCo's default: implicit in the joints' damping"),
    "euler_explicit": _method(1, "the same with damping taken as it is at the start of the step"),
    "rk4": _method(4, "the classical Runge-Kutta method"),
    "implicit": _method(1, "Euler, implicit in forces that depend on velocity"),
    "implicitfast": _method(1, "as implicit, without the Coriolis forces: Euler, where nothing is damped"),
}
if _DISCRETE is not None:
    _METHODS["discrete"] = _method(1, "Euler, implicit in the joints' springs and damping")
_CALLBACK: Final = "computed by a passive-force callback in Python, at every stage of a step"
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the model"),
    "joint_damping": Mapped("damping of the joints"),
    "joint_stiffness": Mapped("stiffness of the joints"),
    "joint_rest": Mapped("springref of the joints"),
    "joint_torque": Mapped("qfrc_applied of the joints, set once"),
    "air_drag": Mapped(f"force on the masses, {_CALLBACK}; its own fluid model is another law"),
    "rod_mass": Mapped("mass, centre and inertia of the bodies"),
    "driven_pivot": Mapped(f"gravity of the pivot's frame, {_CALLBACK}"),
    "drive_torque": Mapped(f"torque in the joint, {_CALLBACK}"),
    "armature": Mapped("armature of the joints"),
    "links": Mapped("mass, centre and inertia of the bodies"),
}

# Limits found with MuJoCo 4.0.0. A deeper chain is refused by its compiler; an offset of 1e-7 m is taken for none, and
# the motion is wrong without a word.
_MOST_LINKS: Final = 1023
_SHORTEST: Final = 1e-6


class _ChainRun(Run):
    """One chain in MuJoCo."""

    def __init__(self, scene: Scene, method: str, dt: float, default_flags: bool) -> None:
        model = compile_chain(scene)
        if default_flags:
            model.opt.disableflags = 0
        model.opt.integrator = _INTEGRATORS[method]
        model.opt.timestep = dt
        data = mujoco.MjData(model)
        data.qpos[:] = joint_values(scene.angles)
        data.qvel[:] = joint_values(scene.rates)
        data.qfrc_applied[:] = constant_torques(scene)
        if method == "euler_explicit":
            model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
        super().__init__(model, data, applied_forces(scene))

    def state(self) -> State:
        return State(absolute_values(self._data.qpos), absolute_values(self._data.qvel))


class MujocoEngine:
    """MuJoCo, without its viewer. It has the same equations in joint angles, and differs by method and rounding."""

    name = "mujoco"
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of MuJoCo itself."""
        return str(mujoco.__version__)

    def refuses(self, scene: Scene) -> str | None:
        """Chains that its compiler refuses or takes for others."""
        if scene.n > _MOST_LINKS:
            return f"{scene.n} links; MuJoCo compiles chains of at most {_MOST_LINKS} bodies"
        if scene.lengths.min() < _SHORTEST:
            return f"a rod of {scene.lengths.min():g} m; MuJoCo takes lengths near 1e-7 m for zero"
        return None

    def setting_line(self, method: str, dt: float | None, settings: Mapping[str, float]) -> str:
        """The line of a model file that asks for this."""
        del settings
        flag = '<flag eulerdamp="disable"/>' if method == "euler_explicit" else ""
        option = f'<option timestep="{dt!r}" integrator="{_IN_FILES[method]}"'
        return f"{option}>{flag}</option>" if flag else f"{option}/>"

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
        """A run at time 0."""
        dt = needed_step(method, dt)
        return _ChainRun(scene, method, dt, default_flags=bool(settings.get("default_flags")))
