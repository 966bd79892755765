"""Steps one after the other, each proved before it counts, and what is seen on the way."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from pendbench.truth.proof.bounds import Bounds, Largest, largest_slope, prove_step
from pendbench.truth.proof.numbers import Number, precision
from pendbench.truth.proof.place import Place, carried, seen
from pendbench.truth.proof.polynomials import Effort, Path, near_solution
from pendbench.truth.proof.system import Rates

#: Why a walk ends before its time.
STUCK: Final = "no step from here could be proved: more bits would help, or the equations are close to singular"
_SMALLEST = 1e-9  # s
_HALVINGS = 8
_BOXES = 100  # the usual count: a larger disc would need more of them than it saves
_RADII: Final = (0.02, 0.8)  # of the radius of convergence that the coefficients suggest


@dataclass(frozen=True)
class Seen:
    """What is proved of one time: a ball for each angle, rad, and each rate, rad/s."""

    t: float
    theta: list[Number]
    omega: list[Number]


class Walk:
    """A place that goes forward in time. t: s, exact. steps: how many have been proved. reason: why it cannot go on."""

    def __init__(self, system: Rates, place: Place, t: Number, effort: Effort, part: float = 0.6) -> None:
        self.system, self.place, self.t, self.effort = system, place, t, effort
        self.steps, self.reason = 0, ""
        self._span, self._part = 2.0 ** -round(math.log2(system.scale) + 2), part

    def advance(self, times: Sequence[float], end: float) -> Iterator[Seen]:
        """One step, not beyond `end`; what is seen at those of the times (rising) that are in it."""
        with precision(self.effort.bits):
            left = end - self.t
        path = near_solution(self.system, self.place.centre, self.t, self._span, self.effort)
        reach = _convergence(path)
        if not 0.25 < reach < 4.0:  # in other units of time the coefficients keep their size
            self._span *= 2.0 ** round(math.log2(min(max(reach, 1e-4), 1e4)))
            path = near_solution(self.system, self.place.centre, self.t, self._span, self.effort)
            reach = _convergence(path)
        found = self._prove(path, reach, left)
        if found is None:
            self.reason = STUCK
            return
        bounds, place = found
        for time in times:
            with precision(self.effort.bits):
                u = (time - self.t) / path.span
                if not u <= bounds.length:
                    break
            yield self._look(path, bounds, u, time)
        with precision(self.effort.bits):
            self.t = self.t + bounds.length * path.span
        self.place = place
        self.steps += 1

    def _look(self, path: Path, bounds: Bounds, u: Number, time: float) -> Seen:
        state = seen(self.place, path, bounds, u, self.effort)
        assert state is not None  # since the whole step is proved
        with precision(self.effort.bits):
            try:
                return Seen(time, *self.system.motion(state))
            except ZeroDivisionError:  # of a state so wide the matrix may be singular
                return Seen(time, [_anything()] * self.system.n, [_anything()] * self.system.n)

    def _prove(self, path: Path, reach: float, left: Number) -> tuple[Bounds, Place] | None:
        while True:
            largest = largest_slope(self.system, path, _short(self._part * reach))
            if largest is not None:
                break
            self._part *= 0.8
            if self._part < _RADII[0]:
                return None
        self._part = min(self._part * (1.03 if largest.boxes < _BOXES else 0.97), _RADII[1])
        length = _length(largest, self.effort)
        for _ in range(_HALVINGS):
            with precision(self.effort.bits):
                asked = (left / path.span).min(length)
            if length * path.span < _SMALLEST:
                return None
            bounds = prove_step(self.system, path, largest, asked, self.effort)
            place = carried(self.place, path, bounds, self.effort) if bounds else None
            if bounds is not None and place is not None:
                return bounds, place
            length = length / 2
        return None


def _anything() -> Number:
    """A ball that holds every number."""
    from flint import arb

    return arb(0.0, math.inf)


def _convergence(path: Path) -> float:
    """The radius of convergence that the last coefficients suggest."""
    largest = 1e-30
    for its in path.state:
        for k in range(max(len(its) - 12, 1), len(its)):
            size = its[k].abs_upper()
            if size > 0:
                largest = max(largest, math.exp(float(size.log()) / k))
    return 1.0 / largest


def _length(largest: Largest, effort: Effort) -> Number:
    """The step, in u, whose truncation is about as small as its rounding."""
    from flint import arb

    size = math.log2(max(float(largest.size), 1e-3))
    ratio = 2.0 ** ((effort.bits + size) / (effort.order - 1))
    return arb(_short(float(largest.radius) / max(ratio, 1.5)))


def _short(x: float) -> float:
    """A number of 12 bits, not above x: sums of such stay exact."""
    mantissa, exponent = math.frexp(x)
    return math.ldexp(math.floor(mantissa * 4096), exponent - 12)
