"""How a study of kind `cost` measures, in a few words: the long ones are in docs/measuring.md."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from pendbench.report.columns import is_missing, number_text

_POINTS: Final = """\
- **Error.** The largest distance of any mass from where the reference has it, over the chain's length L, at evenly
  spaced times up to the scene's time of comparison, each on a whole step of the case. That time is well inside the
  horizon, so that it is the method that is seen and not chaos.
- **Reference.** Two solves in double-double arithmetic (about 32 digits) that share neither formulation nor order nor
  steps. Their largest difference is the reference's error.
- **Cost.** Only stepping up to the time of comparison is timed: no building, no first step, no recording. The median of
  five samples, one case at a time. Where an engine must be called for each step, the calls are part of it.
- **Price of an accuracy.** Between two neighbouring steps (or tolerances) of which the coarser misses the accuracy and
  the finer has it, by interpolation of logarithms; never beyond what was measured. "≤": the coarsest step that ran is
  as accurate already, so that a coarser one might do for less; its whole cost counts. "Not reached": no step of this
  study is so accurate; a finer one might be.
- **Order.** The slope of log error against log step between the two finest steps that show it, where errors are neither
  rounding (below 1e-12) nor large (above 0.03). A plateau is an error that finer steps do not bring down.
- **One more digit.** By what factor the cost grows for an error ten times smaller: a least-squares line through log
  cost against log error, between the same bounds. For a fixed step of order p it tends to 10^(1/p).
- **Energy.** From our own formula and the engine's angles and rates, never from the engine. Its scale is the full range
  of the potential, or the kinetic energy at the start where that is larger.{long_runs}
- **Step and state.** The median over 200 steps of advancing by one and asking for the state, from Python; for a method
  that chooses its steps, of advancing by one of the sampling intervals and asking.

The full definitions are in `docs/measuring.md`. The columns:"""


def method(options: Mapping[str, Any]) -> str:
    """The definitions, with the study's own numbers in them."""
    return _POINTS.format(long_runs=_long_runs(options.get("long_runs")))


def _long_runs(asked: Any) -> str:
    if not isinstance(asked, Mapping) or is_missing(asked.get("steps")) or is_missing(asked.get("dt")):
        return ""
    steps, dt = number_text(asked["steps"], "d"), number_text(asked["dt"])
    return f" Long runs take {steps} steps of {dt} s."
