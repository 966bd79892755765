"""The effects that MuJoCo has no means for: forces that a callback computes whenever it asks for passive forces.

It asks in every stage of a step, with that stage's time and state, so the order of the method is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

import mujoco
import numpy as np

from pendbench.engines.mjcf import HELD, mass_unit
from pendbench.physics import acting
from pendbench.scene import Scene

Callback = Callable[[mujoco.MjModel, mujoco.MjData], None]


def applied_forces(scene: Scene) -> AbstractContextManager[None]:
    """A context, to be entered as often as wanted, in which MuJoCo adds these forces; an empty one where none act."""
    return nullcontext() if scene.terms.keys() <= HELD.keys() else _Applied(_callback(scene))


class _Applied(AbstractContextManager[None]):
    """MuJoCo has one such callback for the whole process; within `mjcf.alone` it is free."""

    def __init__(self, callback: Callback) -> None:
        self._callback = callback

    def __enter__(self) -> None:
        mujoco.set_mjcb_passive(self._callback)

    def __exit__(self, *_: object) -> None:
        mujoco.set_mjcb_passive(None)


def _callback(scene: Scene) -> Callback:
    forced = scene.without(*HELD)
    unit, shaken, pushed = mass_unit(scene), acting.is_shaken(forced), acting.is_pushed(forced)

    def apply(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if shaken:
            x, y = acting.pivot_acceleration(scene, data.time)
            model.opt.gravity[:] = -x, 0.0, -y
        if pushed:
            with np.errstate(all="ignore"):  # a run that blows up is seen in its state
                torques = acting.generalized_forces(forced, data.time, np.cumsum(data.qpos), np.cumsum(data.qvel))
                data.qfrc_passive[:] += unit * np.cumsum(torques[::-1])[::-1]

    return apply
