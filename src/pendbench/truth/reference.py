"""The truth for a scene, how well it is known, and until when.

Two solves in double-double arithmetic that share neither formulation, nor order, nor steps (`solve.py`). Where the two
agree, both are right; the time until which they do is the horizon.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pendbench import __version__
from pendbench.base.arrays import FloatArray
from pendbench.base.ranges import rising_times
from pendbench.scene.scene import Scene, scene_of
from pendbench.scene.trajectory import Maker, Trajectory
from pendbench.truth.solve import ENOUGH, Pair

#: The claim is so many times the largest difference that was seen between the two solves. Chaos turns all errors in one
#: direction, where those of the two can cancel: docs/measuring.md says how often, and by how much.
MARGIN = 100.0


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Truth(Trajectory):
    """A trajectory that ends at its horizon.

    horizon: s, the last sample at which the two solves agree. error: how far the trajectory may be from the truth up to
    there, in units of the chain's total length. bound: (k,) the same up to each sample. disagreement: (k,) how far
    apart the two solves are at each sample. theta_low, omega_low: (k, n) what double precision leaves out of theta and
    omega.
    """

    horizon: float
    error: float
    bound: FloatArray
    disagreement: FloatArray
    theta_low: FloatArray
    omega_low: FloatArray

    def offset(self, theta: FloatArray) -> FloatArray:
        """How far angles theta (j, n) at this trajectory's first j times are from the truth, rad, (j, n)."""
        j = len(theta)
        difference: FloatArray = (theta - self.theta[:j]) - self.theta_low[:j]
        return difference


def reference(scene: Scene | str | os.PathLike[str], times: npt.ArrayLike | None = None) -> Truth:
    """The truth for `scene` at `times` (k,) s, by default 1001 times over its duration, until its horizon.

    scene: a `Scene`, or what `load_scene` takes. times: rising, no matter how far apart; `Truth.t` has the same numbers
    up to the horizon. A step costs O(n), and every time asked for needs one.

    >>> import pendbench as pb
    >>> truth = pb.reference("double", times=[0.0, 1.0])
    >>> truth.horizon, truth.error < 1e-20
    (1.0, True)

    Raises InputError where times are none, or not finite, not rising, or negative. Source: docs/measuring.md.
    """
    return reference_within(scene, times, math.inf)


def reference_within(scene: Scene | str | os.PathLike[str], times: npt.ArrayLike | None, most_work: float) -> Truth:
    """The same, for no more work than this, in steps of its two solves times links: what it ends by is its `reason`."""
    scene = scene_of(scene)
    asked = np.linspace(0.0, scene.duration, 1001) if times is None else times
    wanted = rising_times([asked] if isinstance(asked, int | float) else asked)
    pair, states, gaps, bounds, reason = Pair(scene), [], [], [], ""
    for end in wanted:
        reason = pair.advance(float(end)) if pair.steps * scene.n <= most_work else ENOUGH
        if reason:
            break
        states.append(pair.state())
        gaps.append(pair.gap)
        bounds.append(MARGIN * pair.worst + pair.allowed)
    n, k = scene.n, len(states)
    stacked = np.array(states).reshape(k, 2 * n, 2)
    return Truth(
        t=wanted[:k],
        theta=stacked[:, :n, 0],
        omega=stacked[:, n:, 0],
        gap=np.zeros(k),
        reason=reason,
        horizon=float(wanted[k - 1]) if k else 0.0,
        error=bounds[-1] if k else 0.0,
        bound=np.array(bounds),
        disagreement=np.array(gaps),
        theta_low=stacked[:, :n, 1],
        omega_low=stacked[:, n:, 1],
        scene=scene,
        maker=Maker("reference", "32 digits", versions=(("pendbench", __version__),)),
    )
