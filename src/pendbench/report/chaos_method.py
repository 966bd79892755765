"""How a study of kind `chaos` measures, in a few words: the long ones are in docs/measuring.md."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from pendbench.report.columns import is_missing, number_text

_POINTS: Final = """\
- **Error.** e(t) is the largest distance of any mass from where the reference has it, over the chain's length
  L.{sample}
- **Reference.** Two solves in double-double arithmetic (about 32 digits) that share neither formulation nor order nor
  steps: angles with a recursion along the chain at order 28, and unit vectors with the rods' tensions at order 24. The
  horizon is the last sample up to which they agree to 1e-9 L; the reference's error is their largest difference up to
  there.
- **Time to divergence.** The first time at which e(t) passes a threshold, by interpolation of log e between two
  samples. The median over the starts counts a start that does not get there before its own horizon as later than all
  that do; where the median falls on such a start, there is no time. A run that ended early has diverged when it ended.
- **Model error.** In random states of the chain, the engine's acceleration is the limit of its mean acceleration over
  a shrinking span of time (Romberg's scheme); the model error is its difference from the equations', over the largest
  acceleration. Above 1e-6, and above ten times the last change of that limit, it is another system.
- **Order.** The slope of log e against log step between the two finest steps whose errors{order_time} are neither
  rounding (below 1e-13) nor large (above 0.03). A plateau is an error that finer steps do not bring down.
- **Growth.** A least-squares exponential through e(t) while it lies between 1e-12 and 1e-2; and the same for a start
  that is 1e-10 rad away and solved accurately, which shows what chaos does in these seconds to any small error. The
  Lyapunov exponent is the mean rate at which two solutions part that are brought back to 1e-7 of each other again and
  again{lyapunov_time}.
- **Energy.** From our own formula and the engine's angles and rates, never from the engine. Its scale is the full range
  of the potential, or the kinetic energy at the start where that is larger.
- **Cost.** Only stepping is timed: no building, no first step, no recording. The median of five samples of about 10 ms
  or more, one case at a time. An engine that must be called for each step pays for the calls here, as it does for its
  users.

The full definitions are in `docs/measuring.md`. The columns:"""


def method(options: Mapping[str, Any]) -> str:
    """The definitions, with the study's own numbers in them."""
    return _POINTS.format(
        sample=_with(options, "sample", " It is sampled about every {} s, on whole steps of the case."),
        order_time=_with(options, "order_time", ", after {} s,"),
        lyapunov_time=_with(options, "lyapunov_time", ", over {} s"),
    )


def _with(options: Mapping[str, Any], name: str, text: str) -> str:
    value = options.get(name)
    return "" if is_missing(value) else text.format(number_text(value))
