"""A short run of a model as it stands: whether anything touches, or a joint comes to its limit."""

from __future__ import annotations

from typing import Final, NamedTuple

import mujoco
import numpy as np

from pendbench.scene.models.alone import alone
from pendbench.scene.models.start import Start

#: For how long, s, and how many microseconds it may take at most, by what a step is known to cost.
SECONDS: Final = 10.0
_MOST: Final = 1_000_000.0


class Trial(NamedTuple):
    """happened: what was the first to touch or to reach a limit, empty where nothing did; time: s, how long it ran."""

    happened: str
    time: float


def can_touch(model: mujoco.MjModel) -> bool:
    """Whether the model has anything that may touch or come to a limit."""
    off, bits = model.opt.disableflags, mujoco.mjtDisableBit
    if off & bits.mjDSBL_CONSTRAINT:
        return False
    collide = model.npair or (np.any(model.geom_contype) and np.any(model.geom_conaffinity))
    limited = np.any(model.jnt_limited) and not off & bits.mjDSBL_LIMIT
    return bool(limited or (collide and not off & bits.mjDSBL_CONTACT))


def run_as_it_stands(model: mujoco.MjModel, start: Start) -> Trial:
    """Run the model from its start with its own settings until something touches, or 10 s are over.

    Long chains and small steps are run for less.
    """
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:], data.act[:] = start.coordinates, start.rates, start.controls, 0.0
    step_cost = 5.0 + 0.01 * model.nv**2 + 0.5 * model.ngeom
    steps = int(min(SECONDS / model.opt.timestep, _MOST / step_cost)) + 1
    with alone():
        for _ in range(steps):
            mujoco.mj_step(model, data)
            if data.nefc:
                return Trial(_what(model, data), float(data.time))
            if not np.all(np.isfinite(data.qvel)) or data.warning.number.any():
                break
    return Trial("", float(data.time))


def _what(model: mujoco.MjModel, data: mujoco.MjData) -> str:
    if data.ncon:
        names = [_named(model, "geom", int(geom)) for geom in data.contact.geom[0]]
        return f"{names[0]} touches {names[1]}"
    limits = data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT
    if limits.any():
        return f"{_named(model, 'joint', int(data.efc_id[limits][0]))} comes to its limit"
    return "a constraint acts"


def _named(model: mujoco.MjModel, kind: str, number: int) -> str:
    name = mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), number)
    return f"{kind} {name!r}" if name else f"{kind} number {number + 1}"
