"""MJX as an engine: MuJoCo's equations in JAX, compiled for each chain, many steps in one call.

JAX computes in single precision unless it is told otherwise. `euler_single` takes MJX as it comes; the other methods
tell JAX to use doubles, for their own calls alone. Compiling takes from seconds to minutes for each number of links;
what is compiled is kept in the user's cache, unless JAX was told to keep it elsewhere.

There is no callback in Python from compiled code: what MuJoCo has no law for (drag, motors, driven pivots) is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from typing import Any, Final

import jax
import mujoco
import numpy as np
from mujoco import mjx

from pendbench.base.faults import Fault
from pendbench.base.files import user_cache
from pendbench.engines.joints import absolute_values, joint_values
from pendbench.engines.mujoco.forces import constant_torques
from pendbench.engines.mujoco.mjcf import compile_chain
from pendbench.engines.protocol import Mapped, Method, Simulation, State, needed_step, not_finite
from pendbench.scene.scene import Scene

_INTEGRATORS: Final = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
    "euler_single": mujoco.mjtIntegrator.mjINT_EULER,
}
_METHODS: Final = {
    "euler": Method(1, note="semi-implicit Euler, in doubles"),
    "rk4": Method(4, note="the classical Runge-Kutta method, in doubles"),
    "euler_single": Method(1, single=True, plateau=5e-4, note="semi-implicit Euler, as JAX has it by default"),
}
_CLOSED: Final = Mapped("compiled code calls no Python", refused=True)
_EFFECTS: Final = {
    "gravity": Mapped("gravity of the model"),
    "joint_damping": Mapped("damping of the joints"),
    "joint_stiffness": Mapped("stiffness of the joints"),
    "joint_rest": Mapped("springref of the joints"),
    "joint_torque": Mapped("qfrc_applied of the joints, set once"),
    "air_drag": _CLOSED,
    "rod_mass": Mapped("mass, centre and inertia of the bodies"),
    "driven_pivot": _CLOSED,
    "drive_torque": _CLOSED,
    "armature": Mapped("armature of the joints"),
    "links": Mapped("mass, centre and inertia of the bodies"),
}
# Either flag turns off both in MJX 3.17, springs and damping: none is set.
_PASSIVE: Final = int(mujoco.mjtDisableBit.mjDSBL_SPRING | mujoco.mjtDisableBit.mjDSBL_DAMPER)
# XLA's newer way to fuse loops computes what a link hands on again wherever it is used: 0.03 ms a step with 4 links,
# 300 ms with 8. So it is turned off, for all methods.
_UNREPEATED: Final[dict[str, bool]] = {"xla_cpu_use_fusion_emitters": False}
_MOST_LINKS: Final = 20  # JAX unrolls the tree: rk4 of so many takes 100 s and 3.7 GB to compile


@cache
def _advanced() -> Any:
    """Steps in one call; compiled anew for each shape and precision."""
    if jax.config.jax_compilation_cache_dir is None:
        with suppress(RuntimeError):  # this user has no home
            jax.config.update("jax_compilation_cache_dir", str(user_cache() / "jax"))

    def advanced(model: Any, data: Any, steps: int) -> Any:
        return jax.lax.fori_loop(0, steps, lambda _, d: mjx.step(model, d), data)

    return jax.jit(advanced, compiler_options=_options())


def _options() -> dict[str, bool]:
    """What XLA is told, where it is of a version that knows it."""
    try:
        jax.jit(lambda x: x, compiler_options=_UNREPEATED)(0.0)
    except jax.errors.JaxRuntimeError:
        return {}
    return _UNREPEATED


class _Run:
    """One chain on JAX's default device."""

    def __init__(self, scene: Scene, method: str, dt: float) -> None:
        compiled = compile_chain(scene)
        compiled.opt.disableflags &= ~_PASSIVE
        compiled.opt.integrator, compiled.opt.timestep = _INTEGRATORS[method], dt
        self._doubles = not _METHODS[method].single
        with jax.enable_x64(self._doubles):
            self._model = mjx.put_model(compiled)
            start = mjx.make_data(self._model).replace(
                qpos=jax.numpy.array(joint_values(scene.angles)),
                qvel=jax.numpy.array(joint_values(scene.rates)),
                qfrc_applied=jax.numpy.array(constant_torques(scene)),
            )
            # Bound to a device, as what comes back is: the second call would compile everything once more.
            self._data = jax.device_put(start, jax.devices()[0])
        self.advance(0)  # compiles, which is no part of a step

    def advance(self, steps: int) -> None:
        with jax.enable_x64(self._doubles):
            self._data = jax.block_until_ready(_advanced()(self._model, self._data, steps))

    def state(self) -> State:
        q, v = np.array(self._data.qpos, np.float64), np.array(self._data.qvel, np.float64)
        with np.errstate(all="ignore"):
            return State(absolute_values(q), absolute_values(v))

    def health(self) -> Fault | None:
        return not_finite(self.state())


class MjxEngine:
    """MJX."""

    name = "mjx"
    libraries = ("mujoco", "jax")
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of MJX, and that of JAX."""
        return f"{version('mujoco-mjx')}, JAX {version('jax')}"

    def refuses(self, scene: Scene) -> str | None:
        """Chains that take too long to compile."""
        if scene.n > _MOST_LINKS:
            return f"{scene.n} links; compiling more than {_MOST_LINKS} takes JAX too long"
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:  # noqa: ARG002
        """A run at time 0; no method has settings."""
        dt = needed_step(method, dt)
        return _Run(scene, method, dt)
