"""What a run leaves behind: times, angles, rates and how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pendbench.arrays import FloatArray

#: Every status a run can end with, and what it means. The order is from best to worst.
STATUSES: Final = {
    "ok": "the run reached its end and nothing was wrong with it",
    "refused": "the engine cannot represent the scene",
    "warned": "the engine warned about its own state",
    "torn": "a joint came apart: a rod is far from its length",
    "reset": "the engine started again from its initial state",
    "not converged": "an iteration inside the method did not converge",
    "work limit": "the method needed more steps, or smaller ones, than it was allowed",
    "not finite": "an angle or a rate is infinite or not a number",
    "timed out": "the run took longer than it was allowed",
    "out of memory": "the run wanted more memory than it was allowed",
    "crashed": "the process that ran the engine died",
    "error": "the engine raised an exception",
}


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Samples of one run. A run that failed holds the samples from before it failed.

    t: (k,) s; theta: (k, n) rad, absolute angles; omega: (k, n) rad/s; gap: (k,) how far the worst rod is from its
    length, over that length (0 for engines that work in angles); steps: how many steps were taken, where the engine
    can tell.
    """

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    gap: FloatArray
    status: str = "ok"
    reason: str = ""
    steps: int | None = None

    def __post_init__(self) -> None:
        if self.status not in STATUSES:
            raise ValueError(f"unknown status {self.status!r}")
