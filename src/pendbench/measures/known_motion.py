"""What is known of a chain's motion, for runs to be compared with: how far it can be predicted, and its first swing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray, no_numbers, no_rows
from pendbench.engines.protocol import refusal
from pendbench.engines.recording import fault_of
from pendbench.engines.registry import engine
from pendbench.measures.coarse_motion import KNOWN, Coarse, coarse_errors, coarse_motion, first_turn
from pendbench.measures.titles import FAITHFUL
from pendbench.physics.geometry import distance
from pendbench.scene.scene import Scene

#: Up to so many links a method of high order computes the motion; beyond, two finer steps of one for long chains do.
ACCURATE: Final = 2000
#: A start that is turned by so much, rad, tells how long the motion can be predicted.
TURNED: Final = 1e-6
#: As long as it leads to masses that are off by less than this, in lengths of the chain. It is a fourth of what a
#: faithful run may be off: just after the crack of a whip all solutions, the true one too, are near 1 % apart.
PREDICTED: Final = FAITHFUL / 4.0

_TOLERANCES: Final = (1e-9, 1e-8)  # of the motion, and from the turned start: a thousand times what it needs to be
_FINER: Final = (8, 4)


@dataclass(frozen=True, eq=False)
class Known:
    """A motion at the multiples of an interval, from 0 on; status and reason where something went wrong.

    angles (j, n) rad: while it can be predicted. centre, tip (k, 2) m and lowest (k,) m: the coarse motion until it
    turns back. Each is empty where it is not known.
    """

    status: str
    reason: str = ""
    angles: FloatArray = field(default_factory=no_rows)
    centre: FloatArray = field(default_factory=no_rows)
    tip: FloatArray = field(default_factory=no_rows)
    lowest: FloatArray = field(default_factory=no_numbers)

    @property
    def samples(self) -> int:
        """Up to which sample a run is compared with it."""
        return max(len(self.angles), len(self.lowest))

    def swing(self, at: slice) -> Coarse:
        """Some samples of the coarse motion."""
        return Coarse(self.centre[at], self.tip[at], self.lowest[at])


def measure_known(scene: Scene, every: float) -> Known:
    """The motion of a chain at multiples of `every` s, no longer than its duration.

    Two solutions tell how far it is known: of up to `ACCURATE` links by `adaptive`, the other at a looser tolerance and
    from a start that is turned by `TURNED`; of more by `bdf2`, with an eighth and a fourth of `every`. The motion can
    be predicted as long as they are within `PREDICTED` of each other in e(t), which is asked of the first kind alone;
    the first swing is known where they agree to 0.5 % of the length.
    """
    accurate = scene.n <= ACCURATE
    why = refusal(engine("analytic"), "adaptive" if accurate else "bdf2", scene)
    if why is not None:
        return Known("refused", why)
    runs = _accurate(scene) if accurate else _coarse(scene, every)
    followed = _Followed(scene, predicting=accurate)
    for i in range(max(1, round(scene.duration / every)) + 1):
        for run in runs:
            run.advance(i * every)
            if (fault := fault_of(run.simulation)) is not None:
                return Known(*fault)
        if not followed.goes_on(*(run.simulation.state().theta for run in runs)):
            break
    return followed.known()


@dataclass
class _Run:
    """A simulation, and the step with which it comes to a time, s; None where it chooses its own."""

    simulation: Any
    dt: float | None = None
    taken: int = 0

    def advance(self, time: float) -> None:
        """Advance to a time, s."""
        if self.dt is None:
            if time > 0.0:
                self.simulation.advance_to(time)
            return
        steps = round(time / self.dt)
        self.simulation.advance(steps - self.taken)
        self.taken = steps


def _accurate(scene: Scene) -> list[_Run]:
    starts = (scene, scene.with_start(scene.angles + TURNED, scene.rates))
    pairs = zip(starts, _TOLERANCES, strict=True)
    return [_Run(engine("analytic").build(start, "adaptive", None, tolerance=tolerance)) for start, tolerance in pairs]


def _coarse(scene: Scene, every: float) -> list[_Run]:
    return [_Run(engine("analytic").build(scene, "bdf2", every / finer), every / finer) for finer in _FINER]


class _Followed:
    """Two solutions of a scene, as they come, and how far they are of use."""

    def __init__(self, scene: Scene, *, predicting: bool) -> None:
        self._scene, self._predicting, self._swinging = scene, predicting, True
        self._angles: list[FloatArray] = []
        self._motions: tuple[list[Coarse], list[Coarse]] = ([], [])

    def goes_on(self, best: FloatArray, other: FloatArray) -> bool:
        """Take the next sample of both, angles (n,) rad, and say whether one more is of use."""
        if self._predicting:
            self._predicting = bool(distance(self._scene.lengths, best, other - best) < PREDICTED)
        if self._predicting:
            self._angles.append(best)
        if self._swinging:
            for motion, theta in zip(self._motions, (best, other), strict=True):
                motion.append(coarse_motion(self._scene, theta))
            self._swinging = first_turn(_joined(self._motions[0])) == len(self._motions[0]) - 1
        return self._predicting or self._swinging

    def known(self) -> Known:
        """What is known by now."""
        best, other = map(_joined, self._motions)
        until = first_turn(best) + 1
        best, other = (Coarse(*(part[:until] for part in motion)) for motion in (best, other))
        agree = coarse_errors(other, best, self._scene.total_length).worst < KNOWN
        angles = np.array(self._angles).reshape(-1, self._scene.n)
        return Known("ok", "", angles, *best) if agree else Known("ok", "", angles)


def _joined(motion: Sequence[Coarse]) -> Coarse:
    """Samples as one motion."""
    return Coarse(*(np.array(part) for part in zip(*motion, strict=True)))
