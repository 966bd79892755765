"""Where a model begins: at a keyframe, or in its reference pose."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError, choose


@dataclass(frozen=True, eq=False)
class Start:
    """keyframe: its name, "" where it has none, None for the reference pose; coordinates (nq,) rad, rates (nv,) rad/s.

    controls (nu,) and activations (na,): what the actuators are told.
    """

    keyframe: str | None
    coordinates: FloatArray
    rates: FloatArray
    controls: FloatArray
    activations: FloatArray


def start_of(model: mujoco.MjModel, keyframe: str | None) -> Start:
    """The model's start: the keyframe of that name, else its first one, else its reference pose.

    Raises `InputError`, a sentence, where there is no such keyframe.
    """
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_KEY, key) or "" for key in range(model.nkey)]
    if keyframe is not None and keyframe not in names:
        raise InputError(choose("keyframe", keyframe, filter(None, names)))
    if not names:
        nothing = np.zeros(model.nu), np.zeros(model.na)
        return Start(None, np.array(model.qpos0), np.zeros(model.nv), *nothing)
    key = 0 if keyframe is None else names.index(keyframe)
    values = (model.key_qpos, model.key_qvel, model.key_ctrl, model.key_act)
    return Start(names[key], *(np.array(each[key]) for each in values))
