"""A chain that was read, against the model that it was read from: what was not understood shows in the forces."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np

from pendbench.base.errors import InputError
from pendbench.scene.models.alone import alone
from pendbench.scene.models.plane import Read
from pendbench.scene.models.start import Start

#: What MuJoCo's accelerations may leave of the chain's equations, over the sum of the terms in these.
AGREES: Final = 1e-6
_STATES: Final = 3


def check_forces(model: mujoco.MjModel, start: Start, read: Read) -> None:
    """Raise `InputError` where MuJoCo's accelerations, without constraints, are not those of the chain.

    At the start and at three states around it; the residual and not the accelerations are compared, since long chains
    of unequal masses lose digits in any solve.
    """
    data, random = mujoco.MjData(model), np.random.default_rng(1)
    data.ctrl[:], data.act[:] = start.controls, start.activations
    left = size = 0.0
    for spread in (0.0, *[1.0] * _STATES):
        data.qpos[:] = start.coordinates + spread * random.uniform(-1.0, 1.0, model.nq)
        data.qvel[:] = start.rates + spread * random.uniform(-1.0, 1.0, model.nv)
        with alone():
            mujoco.mj_forward(model, data)
        rates, found = read.joints.rates(data.qvel), read.joints.rates(data.qacc_smooth)
        inertia, torques = read.chain.system(read.joints.angles(data.qpos), rates)
        left = max(left, float(abs(inertia @ found - torques).max()))
        size = max(size, float((abs(inertia) @ (abs(found) + rates**2) + abs(torques)).max()))
    if not left <= AGREES * size:
        raise InputError(
            f"MuJoCo's accelerations are not those of the chain in it, by {left / size:.1g} of the forces; allowed: "
            "models in which nothing acts that a scene does not have"
        )
