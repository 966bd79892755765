"""How a run or a job can end, in one word each, and a fault with its reason."""

from __future__ import annotations

from typing import Final, NamedTuple

#: Every status a run can end with, and what it means. The order is from best to worst.
STATUSES: Final = {
    "ok": "the run reached its end and nothing was wrong with it",
    "refused": "the engine cannot represent the scene",
    "warned": "the engine warned about its own state",
    "torn": "a joint came apart: a rod is far from its length",
    "reset": "the engine started again from its initial state",
    "not converged": "an iteration inside the method did not converge",
    "energy lost": "the energy, less the work of what damps and drives, strayed by more than its scale",
    "work limit": "the method needed more steps, or smaller ones, than it was allowed",
    "not finite": "an angle or a rate is infinite or not a number",
    "timed out": "the run took longer than it was allowed",
    "out of memory": "the run wanted more memory than it was allowed",
    "crashed": "the process that ran the engine died",
    "error": "the engine raised an exception",
}


class Fault(NamedTuple):
    """What went wrong: one of `STATUSES`, and the reason in words."""

    status: str
    reason: str
