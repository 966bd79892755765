"""The truth of a scene as studies keep it, and how far a run is from it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray, no_numbers, no_rows
from pendbench.base.errors import InputError
from pendbench.physics.geometry import distance, wrapped
from pendbench.scene.scene import Scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.truth.reference import reference_within

#: So many samples that are all the truth to the last bit tell something; the first few of a good method are, too.
_TELLING: Final = 16
#: A chain none of whose angles gets farther from its start than this, rad, does not move.
_STILL: Final = 1e-12


@dataclass(frozen=True, eq=False)
class KeptTruth:
    """The reference at its times t (k,) s, up to its horizon (s); nothing of it where it could not be computed.

    theta, theta_low, omega: (k, n) rad, what double precision leaves out of it, rad/s. bound: (k,) how far the
    reference may be from the truth up to each time, in lengths of the chain; error: the last of these.
    """

    status: str
    reason: str = ""
    horizon: float = math.nan
    error: float = math.nan
    t: FloatArray = field(default_factory=no_numbers)
    theta: FloatArray = field(default_factory=no_rows)
    theta_low: FloatArray = field(default_factory=no_rows)
    omega: FloatArray = field(default_factory=no_rows)
    bound: FloatArray = field(default_factory=no_numbers)

    @property
    def is_still(self) -> bool:
        """Whether nothing moves, so that no error says anything."""
        return len(self.theta) > 1 and bool(np.abs(self.theta - self.theta[0]).max() <= _STILL)


def measure_truth(scene: Scene, times: FloatArray, most_work: float = math.inf) -> KeptTruth:
    """Compute the truth of a scene at `times` (k,) s, rising. Where the reference refuses the scene, that is said.

    most_work: as `reference_within` has it.
    """
    try:
        truth = reference_within(scene, times, most_work)
    except InputError as error:
        return KeptTruth("refused", str(error))
    return KeptTruth(
        truth.status, truth.reason, truth.horizon, float(truth.error), truth.t, truth.theta, truth.theta_low,
        truth.omega, truth.bound,
    )  # fmt: skip


class Compared(NamedTuple):
    """A run at the times that it and its truth share: t (j,) s; error e (j,) in lengths of the chain; angle_error (j,)
    the largest of any angle, rad, whole turns left out; known (j,): how far the truth itself may be off; offset (j, n):
    of the angles, rad; theta (j, n): the truth's, rad.
    """

    t: FloatArray
    error: FloatArray
    angle_error: FloatArray
    known: FloatArray
    offset: FloatArray
    theta: FloatArray


def compare(scene: Scene, run: Trajectory, truth: KeptTruth) -> Compared:
    """How far a run is from the truth, at every time that both have, up to the horizon.

    The truth is computed at the very times of the runs, so times are the same to the last bit or not the same.
    """
    t, ours, theirs = np.intersect1d(run.t, truth.t, assume_unique=True, return_indices=True)
    theta = truth.theta[theirs]
    offset = (run.theta[ours] - theta) - truth.theta_low[theirs]
    with np.errstate(over="ignore", invalid="ignore"):
        angle = np.abs(wrapped(offset)).max(axis=1, initial=0.0)
        return Compared(t, distance(scene.lengths, theta, offset), angle, truth.bound[theirs], offset, theta)


def suspicion(case: Case, run: Trajectory, compared: Compared) -> str:
    """What no honest run does, in words: take no steps, or stay on the truth to the last bit; empty for most runs."""
    wanted = int(np.count_nonzero(run.t))
    least = min(1, wanted) if case.its_method.dense else wanted
    if run.steps is not None and run.steps < least:
        return f"{run.steps} steps to {wanted} different times"
    rounding = 0.5 * np.spacing(np.abs(compared.theta))
    told = len(compared.t) >= _TELLING and bool(np.all(np.abs(compared.offset) <= rounding))
    return "the truth, to the last bit" if told else ""
