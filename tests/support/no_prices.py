"""A job of the study of effects that fails, for workers to find."""

from __future__ import annotations

from pendbench.kinds.effects.work import Prices
from pendbench.study.case import Case


def fail_to_price(cases: dict[str, Case], bare: str) -> Prices:  # noqa: ARG001
    raise RuntimeError("no clock today")
