"""Whether an engine simulates the same system, as studies keep it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pendbench.engines.registry import engine
from pendbench.measures.model_error import model_error
from pendbench.study.case import Case
from pendbench.study.flags import MODEL_LIMIT, is_another_system


@dataclass(frozen=True)
class Model:
    """How far an engine's accelerations are from the equations', over the largest, and how well that is known."""

    status: str
    reason: str = ""
    error: float = math.nan
    limit: float = math.nan

    def is_another(self, allowed: float = MODEL_LIMIT) -> bool:
        """Whether the engine simulates another system: `is_another_system`."""
        return is_another_system(self.error, self.limit, allowed)


def measure_model(case: Case, seed: int) -> Model:
    """How far the accelerations of the case's engine are from the equations'.

    What gives way, or is of single precision, has none that a short span would show: its difference is not known.
    """
    if engine(case.engine).methods[case.method].plateau:
        return Model("ok", "it gives way, or is in single precision")
    return Model("ok", "", *model_error(engine(case.engine), case.scene, case.method, dict(case.settings), seed))
