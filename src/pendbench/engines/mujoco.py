"""MuJoCo as an engine: hinges between bodies that are made into point masses, in joint angles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import mujoco
import numpy as np

from pendbench.engines.mjcf import alone, compile_chain, joint_values
from pendbench.engines.mujoco_forces import applied_forces
from pendbench.engines.protocol import Fault, Mapped, Method, Setting, Simulation, State
from pendbench.scene import Scene

_INTEGRATORS: Final = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "euler_explicit": mujoco.mjtIntegrator.mjINT_EULER,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
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
_CALLBACK: Final = "computed by a passive-force callback in Python, at every stage of a step"
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the model"),
    "joint_damping": Mapped("damping of the joints"),
    "joint_stiffness": Mapped("stiffness of the joints"),
    "air_drag": Mapped(f"force on the masses, {_CALLBACK}; its own fluid model is another law"),
    "rod_mass": Mapped("mass, centre and inertia of the bodies"),
    "driven_pivot": Mapped(f"gravity of the pivot's frame, {_CALLBACK}"),
    "drive_torque": Mapped(f"torque in the joint, {_CALLBACK}"),
}

# Limits found with MuJoCo 4.0.0. A deeper chain is refused by its compiler; an offset of 1e-7 m is taken for none, and
# the motion is wrong without a word.
_MOST_LINKS: Final = 1023
_SHORTEST: Final = 1e-6
_MOST_STEPS_A_CALL: Final = 2**30  # the count of a native call has 32 bits


class _Run:
    """One chain in MuJoCo. Only joint angles and rates are read: all else in MjData lags a step behind."""

    def __init__(self, scene: Scene, method: str, dt: float, default_flags: bool) -> None:
        self._model = compile_chain(scene)
        if default_flags:
            self._model.opt.disableflags = 0
        self._model.opt.integrator = _INTEGRATORS[method]
        self._model.opt.timestep = dt
        self._data = mujoco.MjData(self._model)
        self._data.qpos[:] = joint_values(scene.angles)
        self._data.qvel[:] = joint_values(scene.rates)
        self._taken = 0
        if method == "euler_explicit":
            self._model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
        self._forces = applied_forces(scene)

    def advance(self, steps: int) -> None:
        self._taken += steps
        with alone(), self._forces:
            while steps > 0:
                mujoco.mj_step(self._model, self._data, nstep=min(steps, _MOST_STEPS_A_CALL))
                steps -= _MOST_STEPS_A_CALL

    def state(self) -> State:
        return State(np.cumsum(self._data.qpos), np.cumsum(self._data.qvel))

    def health(self) -> Fault | None:
        if not (np.all(np.isfinite(self._data.qpos)) and np.all(np.isfinite(self._data.qvel))):
            return Fault("not finite", "a joint's angle or rate is not finite")
        return self._reset() or self._warned()

    def _reset(self) -> Fault | None:
        """A run that blows up starts again at time 0, unless told not to: its clock is then behind."""
        time, expected = self._data.time, self._taken * self._model.opt.timestep
        # The clock is a sum of steps: its rounding grows with their number squared, at worst.
        slack = self._model.opt.timestep * max(0.5, np.finfo(float).eps * self._taken**2)
        if abs(time - expected) <= slack:
            return None
        return Fault("reset", f"its clock says {time:.6g} s after {expected:.6g} s of steps")

    def _warned(self) -> Fault | None:
        counts = self._data.warning.number
        if not counts.any():
            return None
        kind = int(np.flatnonzero(counts)[0])
        text = mujoco.mju_warningText(kind, self._data.warning[kind].lastinfo)
        return Fault("warned", f"{text} ({counts[kind]} times)")


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

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
        """A run at time 0."""
        if dt is None:
            raise ValueError(f"method {method!r} needs a step")
        return _Run(scene, method, dt, default_flags=bool(settings.get("default_flags")))
