"""A model file as it stands, as an engine: its own integrator and flags, with contact where that is on."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import nullcontext

import mujoco

from pendbench.engines.mujoco.adapter import MujocoEngine
from pendbench.engines.mujoco.run import Run
from pendbench.engines.protocol import Mapped, Method, Simulation, State
from pendbench.scene.models.read import Model, read_model
from pendbench.scene.scene import Scene

#: The name of its one method.
AS_IT_STANDS = "as it stands"
_ORDERS = {"rk4": 4}


class ModelFile:
    """MuJoCo with a file's own model. Scenes differ from the file's in their start alone."""

    name = "mujoco"

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.model = read_model(path)
        self.effects: Mapping[str, Mapped] = {name: Mapped("as the file has it") for name in self.model.scene.terms}
        order = _ORDERS.get(self.model.integrator, 1)
        self.methods: Mapping[str, Method] = {AS_IT_STANDS: Method(order=order)}

    def version(self) -> str:
        """The version of MuJoCo itself."""
        return MujocoEngine().version()

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        """Nothing: what could not be understood was refused when the file was read."""
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:  # noqa: ARG002
        """A run of the file from the scene's start at time 0."""
        return _FileRun(self.model, scene, dt or self.model.timestep)


class _FileRun(Run):
    """One run of the file."""

    def __init__(self, model: Model, scene: Scene, dt: float) -> None:
        compiled, self._joints = model.compile(), model.joints
        compiled.opt.timestep = dt
        data = mujoco.MjData(compiled)
        data.qpos[:] = model.joints.coordinates(scene.angles)
        data.qvel[:] = model.joints.velocities(scene.rates)
        super().__init__(compiled, data, nullcontext())

    def state(self) -> State:
        return State(self._joints.angles(self._data.qpos), self._joints.rates(self._data.qvel))
