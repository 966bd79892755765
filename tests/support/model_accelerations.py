"""MuJoCo's accelerations of a model file as it stands, and those of the scene that it was read as."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from pendbench.physics.dense import accelerations
from pendbench.scene.models.alone import alone
from pendbench.scene.models.read import read_model


def worst_difference(path: Path, states: int, seed: int, spread: float = 1.5) -> float:
    """The largest difference of the links' accelerations at some states, over the largest acceleration there.

    States in which something touches are none that a chain can be compared in; in most of them nothing does.
    """
    model = read_model(path)
    compiled, rng, found = mujoco.MjModel.from_xml_path(str(path)), np.random.default_rng(seed), []
    data = mujoco.MjData(compiled)
    for _ in range(100 * states):
        data.qpos[:] = compiled.qpos0 + rng.uniform(-spread, spread, compiled.nq)
        data.qvel[:] = rng.uniform(-spread, spread, compiled.nv)
        with alone():
            mujoco.mj_forward(compiled, data)
        if data.nefc:
            continue
        theirs = model.joints.rates(data.qacc)
        ours = accelerations(model.scene, model.joints.angles(data.qpos), model.joints.rates(data.qvel))
        found.append(float(abs(ours - theirs).max() / abs(theirs).max()))
        if len(found) == states:
            return max(found)
    raise AssertionError(f"something touches in all but {len(found)} states")
