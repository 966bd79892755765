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
    if all(math.isnan(causes[name]) for name in ("model_error", "order_observed", "growth_per_s")):
        return "not known"
    return "integration, amplified by chaos" if math.isfinite(causes["lyapunov_per_s"]) else "integration"


def of_row(
    run: Mapping[str, Any], causes: Mapping[str, Any], model: Mapping[str, Any], timing: Mapping[str, Any]
) -> Iterator[str]:
    """The flags of one row.

    run: from the scene's own start. causes: of all steps of its method. model, timing: what was measured of them, or
    the status and reason of not being measured.
    """
    if another_system(causes):
        yield f"another system: accelerations differ by {causes['model_error']:.1e}"
    yield from _of_steps(causes)
    if good := _too_good(run, run.get("error_half"), run.get("reference_error_half")):
        yield f"too good: {good}"
    if "status" in model:
        yield f"model not compared: {model['status']}, {model['reason']}"
    yield from of_timing(timing)


def of_priced_row(run: Mapping[str, Any], order: Mapping[str, Any], timing: Mapping[str, Any]) -> Iterator[str]:
    """The flags of a row of a study of cost: of its run, of what the steps of its method showed, of its timing."""
    yield from _of_steps(order)
    if good := _too_good(run, run.get("error_max"), run.get("reference_error")):
        yield f"too good: {good}"
    yield from of_timing(timing)


def of_timing(timing: Mapping[str, Any]) -> Iterator[str]:
    """The flags of a timing: that it is noisy, or that there is none."""
    if timing.get("step_spread", 0.0) > SPREAD_LIMIT:
        yield f"noisy timing: spread {timing['step_spread']:.0%}"
    if "status" in timing:
        yield f"not timed: {timing['status']}, {timing['reason']}"


def _of_steps(shown: Mapping[str, Any]) -> Iterator[str]:
    if order_differs(shown):
        yield f"order {shown['order_observed']:.1f} where {shown['order_claimed']} is claimed"
    if math.isfinite(shown["plateau"]):
        yield f"plateau: the error stops at {shown['plateau']:.1e}"


def _too_good(run: Mapping[str, Any], error: float | None, known: float | None) -> str:
    """No engine comes as near to the truth as that is known, in double precision, or stays on it to the last bit."""
    if run.get("error_max") == 0.0:
        return "no error at all"
    if error is not None and known is not None and error < 10 * known:
        return "as near to the reference as that is known"
    return str(run.get("too_good", ""))
