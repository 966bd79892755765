"""Whether a run was stable: one word for each, from its status, its energy and its joints."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray

#: Every verdict and what it means, from best to worst.
VERDICTS: Final = {
    "holds": "the energy stays within 1 % of its scale, and every rod within 1 % of its length",
    "drifts": "the energy strays by more than 1 % of its scale, or a rod by more than 1 % of its length",
    "not told": "too few samples to tell the balance of energy to 1 %: the step is too long for what damps or drives",
    "refused": "the engine cannot represent the scene",
    "gives up": "the method itself says that it cannot go on",
    "warned": "the engine warned about its own state",
    "breaks": "the energy, or a rod, strays by more than its whole scale, or numbers are no longer finite",
    "resets": "the engine started again from its initial state",
    "timed out": "not known: the run took longer than the study allows",
    "out of memory": "not known: the run wanted more memory than the study allows",
    "crashed": "the process that ran the engine died",
    "error": "the engine raised an exception",
}

HOLDS: Final = 0.01
BREAKS: Final = 1.0

#: Verdicts that say nothing of the method: it was the study that stopped the run.
_NOT_KNOWN: Final = frozenset({"timed out", "out of memory"})

_OF_STATUS: Final = {
    "not converged": "gives up",
    "work limit": "gives up",
    "reset": "resets",
    "torn": "breaks",
    "energy lost": "breaks",
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


def is_known(word: str) -> bool:
    """Whether a verdict tells what the method does."""
    return word not in _NOT_KNOWN


def verdict_of(
    status: str, reason: str, t: FloatArray, strays: FloatArray, gap: FloatArray, floor: float = math.nan
) -> Verdict:
    """The verdict on a run.

    status, reason: how it ended. t (k,) s: its samples; strays (k,): the energy's deviation there in units of the
    energy scale; gap (k,): the worst rod's relative error in length. floor: how well the strays are known, where they
    are those of a balance, less what may be the samples' own.
    """
    with np.errstate(invalid="ignore"):
        lost = np.flatnonzero(~((np.abs(strays) <= BREAKS) & (np.abs(gap) <= BREAKS)))
    broke = float(t[lost[0]]) if lost.size else float("nan")
    if status == "ok":
        return Verdict(*_of_whole_run(broke, strays, gap, floor), broke)
    if lost.size and status != "reset":
        return Verdict("breaks", f"{_energy_lost(broke)}; then {reason}", broke)
    return Verdict(_OF_STATUS.get(status, status), reason, broke)


def _of_whole_run(broke: float, strays: FloatArray, gap: FloatArray, floor: float) -> tuple[str, str]:
    if not np.isnan(broke):
        return "breaks", _energy_lost(broke)
    worst, torn = float(np.abs(strays).max()), float(np.abs(gap).max())
    if torn >= HOLDS:
        return "drifts", f"a rod is off its length by {torn:.2g} of it"
    if worst >= HOLDS:
        return "drifts", f"the energy strays by {worst:.2g} of its scale"
    if floor >= HOLDS:
        return "not told", f"the balance of energy is known to {floor:.2g} of its scale only: too few samples"
    return "holds", ""


def _energy_lost(broke: float) -> str:
    return f"the energy, or a rod, is astray by more than its scale at t = {broke:.3g} s"
