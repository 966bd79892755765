"""The effects that MuJoCo has no means for: forces that a callback computes whenever it asks for passive forces.

It asks in every stage of a step, with that stage's time and state, so the order of the method is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Final

import mujoco
import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.joints import absolute_values, joint_forces
from pendbench.engines.mujoco.mjcf import HELD, mass_unit
from pendbench.physics import acting
from pendbench.scene.scene import Scene

#: The effects that it simulates without a callback: what its model holds, and what it is told once.
_BY_ITSELF: Final = frozenset({*HELD, "joint_torque"})
Callback = Callable[[mujoco.MjModel, mujoco.MjData], None]


def applied_forces(scene: Scene) -> AbstractContextManager[None]:
    """A context, to be entered as often as wanted, in which MuJoCo adds these forces; an empty one where none act."""
    return nullcontext() if scene.terms.keys() <= _BY_ITSELF else _Applied(_callback(scene))


def constant_torques(scene: Scene) -> FloatArray:
    """What MuJoCo is told once to apply to the joints (n,), in its unit of mass."""
    torques = scene.effects.joint_torque
    return mass_unit(scene) * np.broadcast_to(np.asarray(0.0 if torques is None else torques), scene.n)


class _Applied(AbstractContextManager[None]):
    """MuJoCo has one such callback for the whole process; within `mjcf.alone` it is free."""

    def __init__(self, callback: Callback) -> None:
        self._callback = callback

    def __enter__(self) -> None:
        mujoco.set_mjcb_passive(self._callback)

    def __exit__(self, *_: object) -> None:
        mujoco.set_mjcb_passive(None)


def _callback(scene: Scene) -> Callback:
    forced = scene.without(*(_BY_ITSELF - {"rod_mass"}))  # which pushes nothing, and may hold masses of 0
    unit, shaken, pushed = mass_unit(scene), acting.is_shaken(forced), acting.is_pushed(forced)

    def apply(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if shaken:
            x, y = acting.pivot_acceleration(scene, data.time)
            model.opt.gravity[:] = -x, 0.0, -y
        if pushed:
            with np.errstate(all="ignore"):  # a run that blows up is seen in its state
                theta, omega = absolute_values(data.qpos), absolute_values(data.qvel)
                data.qfrc_passive[:] += unit * joint_forces(acting.generalized_forces(forced, data.time, theta, omega))

    return apply
