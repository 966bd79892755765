"""Whether a long chain *moves well*: what of its motion can be seen from afar, and an energy that only falls.

Beyond some hundred links, steps of the length of a picture cannot follow each link. What they can be asked is in
docs/measuring.md, "Coarse motion".
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.measures.verdict import HOLDS
from pendbench.physics.acting import lumped_masses
from pendbench.physics.geometry import positions
from pendbench.scene.scene import Scene

#: How far, in lengths of the chain, the coarse motion of one that moves well may be off.
SEEN: Final = 0.02

#: How well, in lengths of the chain, a solution has to be known that others are compared with.
KNOWN: Final = 0.005


class Coarse(NamedTuple):
    """centre, of mass, and tip: (..., 2) m. lowest: the height of the lowest mass, (...,) m."""

    centre: FloatArray
    tip: FloatArray
    lowest: FloatArray


class CoarseErrors(NamedTuple):
    """The largest errors of the coarse motion, in lengths of the chain; nan where they are not known."""

    centre: float = math.nan
    tip: float = math.nan
    lowest: float = math.nan

    @property
    def worst(self) -> float:
        """The largest of them, nan where one is not known."""
        return float(np.max(self))


def coarse_motion(scene: Scene, theta: FloatArray) -> Coarse:
    """The coarse motion of a scene at angles theta (..., n) rad. Rods with mass count at their ends, as in (E53)."""
    places, masses = positions(scene.lengths, theta), lumped_masses(scene)
    centre = np.einsum("i,...ij->...j", masses / masses.sum(), places)
    return Coarse(centre, places[..., -1, :], places[..., 1].min(axis=-1))


def first_turn(motion: Coarse) -> int:
    """The sample (k,) at which the centre of mass turns back about the pivot for the first time; the last if none."""
    angle = np.unwrap(np.arctan2(motion.centre[:, 0], -motion.centre[:, 1]))
    turning = np.sign(np.diff(angle))
    way = turning[turning != 0.0][:1]
    back = np.flatnonzero(turning == -way) if way.size else way
    return int(back[0]) if back.size else len(angle) - 1


def coarse_errors(found: Coarse, truth: Coarse, length: float) -> CoarseErrors:
    """How far a motion is from another at the same samples (k,), over the chain's length, m."""
    centre, tip = (np.hypot(*(a - b).T).max() / length for a, b in zip(found[:2], truth[:2], strict=True))
    return CoarseErrors(float(centre), float(tip), float(np.abs(found.lowest - truth.lowest).max() / length))


def largest_rise(energy: FloatArray) -> float:
    """By how much the energy (k,) J is at most above what it was at any sample before, J; nan where it is not finite.

    A method that damps may lose energy. One that puts some of it back adds what nothing gave.
    """
    if not np.all(np.isfinite(energy)):
        return math.nan
    return float((energy - np.minimum.accumulate(energy)).max(initial=0.0))


def why_it_moves_badly(status: str, rise: float, gap: float, errors: CoarseErrors) -> str:
    """The first that is wrong with a run, in the order below, in a few words; empty where it moves well.

    status: how it ended. rise: `largest_rise` over the energy scale. gap: the worst rod's relative error in length.
    """
    if status != "ok":
        return f"breaks: {status}"
    if not gap < HOLDS:
        return f"a rod is off its length by {gap:.2g} of it"
    if not rise < HOLDS:
        return f"the energy rises by {rise:.3g} of its scale"
    if math.isnan(errors.worst):
        return "not known: no solution to compare with converged"
    if not errors.worst < SEEN:
        names = [name for name, error in errors._asdict().items() if not error < SEEN]
        return f"off by {errors.worst:.2g} of the length: {', '.join(names)}"
    return ""
