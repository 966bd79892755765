"""A run of a MuJoCo model, whatever it is of."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Final

import mujoco
import numpy as np

from pendbench.base.arrays import all_finite
from pendbench.base.faults import Fault
from pendbench.scene.models.alone import alone

_EPSILON: Final = float(np.finfo(float).eps)
_MOST_STEPS_A_CALL: Final = 2**30  # the count of a native call has 32 bits


class Run:
    """Steps a model from where its data is, at time 0, with these forces; a subclass says what its state is.

    Only joint angles and rates are read: all else in MjData lags a step behind.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, forces: AbstractContextManager[None]) -> None:
        self._model, self._data, self._forces, self._taken = model, data, forces, 0

    def advance(self, steps: int) -> None:
        self._taken += steps
        with alone(), self._forces:
            while steps > 0:
                mujoco.mj_step(self._model, self._data, nstep=min(steps, _MOST_STEPS_A_CALL))
                steps -= _MOST_STEPS_A_CALL

    def health(self) -> Fault | None:
        if not all_finite(self._data.qpos, self._data.qvel):
            return Fault("not finite", "a joint's angle or rate is not finite")
        return self._reset() or self._warned()

    def _reset(self) -> Fault | None:
        """A run that blows up starts again at time 0, unless told not to: its clock is then behind."""
        time, expected = self._data.time, self._taken * self._model.opt.timestep
        # The clock is a sum of steps: its rounding grows with their number squared, at worst.
        slack = self._model.opt.timestep * max(0.5, _EPSILON * self._taken**2)
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
