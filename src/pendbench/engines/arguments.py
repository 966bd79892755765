"""What can be asked of a method with a fixed step, and of one that chooses its steps, checked in one place."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.base.ranges import STEP
from pendbench.base.strict import show

#: How many samples a run has, about, where no times are asked for.
SAMPLES: Final = 1000
#: How far a time may be from a whole number of steps, in steps.
SLACK: Final = 1e-6

_MOST_STEPS: Final = 2**53  # beyond this, floats do not count


def step_of(method: str, adaptive: bool, dt: object) -> float | None:
    """The step, s, of the method called `method`; None where it chooses its steps. Raises `InputError`."""
    if adaptive:
        if dt is not None:
            raise InputError(f"dt is {show(dt)}; allowed: none, since method {method!r} chooses its steps")
        return None
    try:
        return STEP.read(dt)
    except ValueError as error:
        found = "missing" if dt is None else show(dt)
        raise InputError(f"dt is {found}; allowed: {error}, the step of method {method!r}") from None


def whole_steps(duration: float, dt: float) -> int:
    """How many whole steps of dt (s) there are in a duration (s)."""
    return math.floor(duration / dt + SLACK)


def on_steps(times: FloatArray, dt: float, duration: float) -> FloatArray:
    """The times (k,) s, each on the whole step of dt (s) within the duration (s) that is nearest; each once."""
    counts = np.unique(np.minimum(np.rint(times / dt), whole_steps(duration, dt)))
    return np.asarray(counts * dt, dtype=np.float64)


def step_counts(times: FloatArray, dt: float) -> npt.NDArray[np.int64]:
    """How many steps of dt (s) each of the times (k,) s is from the start; InputError for what is no whole multiple."""
    with np.errstate(over="ignore"):
        counts = _bounded(times / dt, dt)
    whole = np.rint(counts)
    astray = np.flatnonzero(np.abs(counts - whole) > SLACK)
    if astray.size:
        raise InputError(f"times has {times[astray[0]]:.9g} s; allowed: whole multiples of dt = {dt:g} s")
    if np.any(np.diff(whole) < 1):
        raise InputError(f"times are closer together than dt = {dt:g} s; allowed: different multiples of it")
    return whole.astype(np.int64)


def even_counts(duration: float, dt: float) -> npt.NDArray[np.int64]:
    """About `SAMPLES` counts of steps, evenly spaced from 0, and the last step within the duration."""
    total = math.floor(_bounded(np.array([duration / dt]), dt)[0] + SLACK)
    if total < 1:
        raise InputError(f"dt is {dt:g}; allowed: at most the scene's duration of {duration:g} s")
    stride = max(1, round(total / SAMPLES))
    return np.unique(np.append(np.arange(0, total, stride), total))


def _bounded(counts: FloatArray, dt: float) -> FloatArray:
    if not np.all(counts < _MOST_STEPS):
        raise InputError(f"dt is {dt:g}; allowed: steps of which the run needs at most {_MOST_STEPS:g}")
    return counts
