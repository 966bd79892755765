"""What a reader should be told about a row: another system, a wrong order, a plateau, too good a result.

Flags of timings are in `study.timing`; the columns of each kind join those that it has.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

#: Accelerations that differ by more than this are those of another system.
MODEL_LIMIT: Final = 1e-6
#: An order this far from the claimed one is worth a word.
ORDER_LIMIT: Final = 0.2
#: An error that is so many times a plateau with finer steps has not just stopped falling.
WORSE: Final = 10.0


def is_another_system(model_error: float, limit: float, allowed: float = MODEL_LIMIT) -> bool:
    """Whether accelerations differ by more than is allowed, and by more than they are known (`limit`)."""
    return model_error > max(allowed, 10 * limit)


def order_differs(claimed: int | None, observed: float) -> bool:
    """Whether the order seen is another than the claimed one."""
    return claimed is not None and abs(observed - claimed) > ORDER_LIMIT


def of_steps(claimed: int | None, observed: float, plateau: float, finest: float = math.nan) -> Iterator[str]:
    """What the steps of a method show together. finest: the error with the finest of them."""
    if order_differs(claimed, observed):
        yield f"order {observed:.1f} where {claimed} is claimed"
    if math.isfinite(plateau):
        worse = f", and is {finest:.1e} with the finest step" if finest > WORSE * plateau else ""
        yield f"plateau: the error stops at {plateau:.1e}{worse}"


def too_good(error_max: float, error: float, known: float, seen: str) -> Iterator[str]:
    """That no engine comes as near to the truth as that is known (`known`), or stays on it to the last bit (`seen`)."""
    if error_max == 0.0:
        yield "too good: no error at all"
    elif error < 10 * known:
        yield "too good: as near to the reference as that is known"
    elif seen:
        yield f"too good: {seen}"
