"""Whether a run was stable: one word for each, from its status, its energy and its joints."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from pendbench.arrays import FloatArray

#: Every verdict and what it means, from best to worst.
VERDICTS: Final = {
    "holds": "the energy stays within 1 % of its scale, and every rod within 1 % of its length",
    "drifts": "the energy strays by more than 1 % of its scale, or a rod by more than 1 % of its length",
    "refused": "the engine cannot represent the scene",
    "gives up": "the method itself says that it cannot go on",
    "warned": "the engine warned about its own state",
    "breaks": "the energy, or a rod, strays by more than its whole scale, or numbers are no longer finite",
    "resets": "the engine started again from its initial state",
    "timed out": "the run took longer than the study allows",
    "out of memory": "the run wanted more memory than the study allows",
    "crashed": "the process that ran the engine died",
    "error": "the engine raised an exception",
}

HOLDS: Final = 0.01
BREAKS: Final = 1.0

_OF_STATUS: Final = {
    "not converged": "gives up",
    "work limit": "gives up",
    "reset": "resets",
    "torn": "breaks",
    "not finite": "breaks",
}


class Verdict(NamedTuple):
    """A word of `VERDICTS`, the reason where it is not `holds`, and when the energy was lost, s (nan where never)."""

    word: str
    reason: str
    broke: float


def rank(word: str) -> int:
    """The place of a verdict, 0 for the best."""
    return list(VERDICTS).index(word)


def verdict_of(status: str, reason: str, t: FloatArray, strays: FloatArray, gap: FloatArray) -> Verdict:
    """The verdict on a run.

    status, reason: how it ended. t (k,) s: its samples; strays (k,): the energy's deviation there in units of the
    energy scale; gap (k,): the worst rod's relative error in length.
    """
    with np.errstate(invalid="ignore"):
        lost = np.flatnonzero(~((np.abs(strays) <= BREAKS) & (np.abs(gap) <= BREAKS)))
    broke = float(t[lost[0]]) if lost.size else float("nan")
    if status == "ok":
        return Verdict(*_of_whole_run(broke, strays, gap), broke)
    if lost.size and status != "reset":
        return Verdict("breaks", f"{_energy_lost(broke)}; then {reason}", broke)
    return Verdict(_OF_STATUS.get(status, status), reason, broke)


def _of_whole_run(broke: float, strays: FloatArray, gap: FloatArray) -> tuple[str, str]:
    if not np.isnan(broke):
        return "breaks", _energy_lost(broke)
    worst, torn = float(np.abs(strays).max()), float(np.abs(gap).max())
    if torn >= HOLDS:
        return "drifts", f"a rod is off its length by {torn:.2g} of it"
    if worst >= HOLDS:
        return "drifts", f"the energy strays by {worst:.2g} of its scale"
    return "holds", ""


def _energy_lost(broke: float) -> str:
    return f"the energy, or a rod, is astray by more than its scale at t = {broke:.3g} s"
