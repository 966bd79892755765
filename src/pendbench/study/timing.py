"""What a case costs, as studies keep it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from pendbench.engines.registry import engine
from pendbench.measures.clock import time_case, time_each_step
from pendbench.study.case import Case

#: A spread of timings above this is noise.
SPREAD_LIMIT: Final = 0.1


@dataclass(frozen=True)
class Timed:
    """us for a step, and for a step and reading the state after it; (largest - smallest) / median of the samples; s to
    build the run, for its first step, and for stepping up to the time asked for; nan where it was not measured.
    """

    status: str
    reason: str = ""
    step_us: float = math.nan
    step_spread: float = math.nan
    simulated_s_per_s: float = math.nan
    build_s: float = math.nan
    first_call_s: float = math.nan
    run_s: float = math.nan
    step_and_state_us: float = math.nan

    @property
    def noisy(self) -> bool:
        """Whether the machine did something else in between."""
        return self.step_spread > SPREAD_LIMIT

    @property
    def flags(self) -> Iterator[str]:
        """That the timing is noisy, or that there is none."""
        if self.noisy:
            yield f"noisy timing: spread {self.step_spread:.0%}"
        if self.status not in ("ok", "not timed"):
            yield f"not timed: {self.status}, {self.reason}"


#: Of a case that was not to be timed: how quickly a run fails is not what it costs.
UNTIMED: Final = Timed("not timed")


def measure_timing(case: Case, until: float) -> Timed:
    """What stepping a case up to `until` (s) costs."""
    found = time_case(engine(case.engine), case.scene, case.method, case.dt, dict(case.settings), until)
    return Timed(
        "ok", "", found.step_us, found.spread, until / found.run_s, found.build_s, found.first_call_s, found.run_s
    )


def measure_timing_with_states(case: Case, until: float, interval: float) -> Timed:
    """The same, and what a step costs who reads the state after each (after every `interval` s, if it has no step)."""
    each = time_each_step(engine(case.engine), case.scene, case.method, case.dt, dict(case.settings), interval)
    return replace(measure_timing(case, until), step_and_state_us=each)
