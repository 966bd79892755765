"""What a reader should be told about a row: another system, a wrong order, a plateau, too good a result, bad timing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

#: Accelerations that differ by more than this are those of another system.
MODEL_LIMIT: Final = 1e-6
#: An order this far from the claimed one is worth a word.
ORDER_LIMIT: Final = 0.2
#: A spread of timings above this is noise.
SPREAD_LIMIT: Final = 0.1


def another_system(causes: Mapping[str, Any]) -> bool:
    """Whether the engine's accelerations differ by more than the limit, and by more than they are known."""
    error, limit = causes["model_error"], causes["model_error_limit"]
    return bool(error > max(MODEL_LIMIT, 10 * limit))


def order_differs(causes: Mapping[str, Any]) -> bool:
    """Whether the order seen is another than the claimed one."""
    claimed, observed = causes["order_claimed"], causes["order_observed"]
    return claimed is not None and bool(abs(observed - claimed) > ORDER_LIMIT)


def cause(causes: Mapping[str, Any]) -> str:
    """Why this engine and method leave the truth, in words."""
    if another_system(causes):
        return "model"
    return "integration, amplified by chaos" if math.isfinite(causes["lyapunov_per_s"]) else "integration"


def of_row(row: Mapping[str, Any], causes: Mapping[str, Any], timing: Mapping[str, Any]) -> Iterator[str]:
    """The flags of one row."""
    if another_system(causes):
        yield f"another system: accelerations differ by {causes['model_error']:.1e}"
    if order_differs(causes):
        yield f"order {causes['order_observed']:.1f} where {causes['order_claimed']} is claimed"
    if math.isfinite(causes["plateau"]):
        yield f"plateau: the error stops at {causes['plateau']:.1e}"
    if row["error_max"] == 0.0:
        yield "too good: no error at all"
    elif row["error_half"] is not None and row["error_half"] < 10 * (row["reference_error_half"] or 0.0):
        yield "too good: as near to the reference as that is known"
    if timing.get("step_spread", 0.0) > SPREAD_LIMIT:
        yield f"noisy timing: spread {timing['step_spread']:.0%}"
    if "status" in timing:
        yield f"not timed: {timing['status']}, {timing['reason']}"
