"""The two solves of the reference, each in 32 digits, side by side.

Under gravity: angles with the O(n) recursion at order 28, and unit vectors with tensions from a tridiagonal system at
order 24. Where more acts: two O(n) eliminations that run in opposite directions, one for accelerations and one for
forces; or matrices in place of the second, where rigid links have their centres elsewhere than between their ends, or
joints have rotors.
docs/measuring.md says what they share.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.scene.scene import Scene

#: The reference ends where its two solves differ by more than this (in units of e: lengths of the chain).
AGREEMENT = 1e-9

# One extrapolated step carries about 1e-29 of rounding; a tolerance much nearer to that is met by no step. Where the
# equations themselves lose digits (mass ratios of 1e8) a solve takes the next one and goes on.
_TOLERANCES = (1e-27, 1e-24, 1e-21, 1e-18)
_COLUMNS = (14, 12)
_FIRST_STEP = 1e-3
_SMALLEST_STEP = 1e-12
_MOST_STEPS = 1_000_000  # besides the one that every sample needs
_MOST_STEPS_AT_ONCE = 1000  # between two samples; more say that the tolerance cannot be met
_STEPS_BETWEEN = 10  # comparisons of the two, where samples are further apart

HORIZON = "ends at its horizon: past it the two solves no longer agree"
STUCK = "ends where one of its solves would have needed more steps, or smaller ones, than it is allowed"
ENOUGH = "ends where it would have taken more work than was asked for"


class Solve:
    """One of the two solves: a system, its state (d, 2), and how it advances.

    allowed: what its steps may have been off by together, in units of the state.
    """

    def __init__(self, system: Any, state: FloatArray, columns: int) -> None:
        self._system, self.state, self._weights = system, state, _weights(columns)
        self._relative = np.ones(len(state))
        self.h, self.steps, self.t, self.allowed = _FIRST_STEP, 0, 0.0, 0.0
        self._tolerances, self._left = list(_TOLERANCES), _MOST_STEPS

    def advance(self, end: float) -> bool:
        """Advance to `end`, s; False where the solve cannot go on."""
        from pendbench.solvers.extended.extrapolation import integrate_extended
        from pendbench.solvers.outcome import DONE, TOO_MANY, TOO_SMALL

        usual = self.h
        self._left += 1
        while self._left > 0:
            reached = integrate_extended(
                self._system,
                self._weights,
                self.t,
                end,
                self.h,
                self.state,
                self._tolerances[0],
                self._relative,
                _SMALLEST_STEP,
                min(self._left, max(_MOST_STEPS_AT_ONCE, math.ceil(4 * (end - self.t) / usual))),
            )
            taken = reached.accepted + reached.rejected
            self.t, self.h, self.steps, self._left = reached.t, reached.h, self.steps + taken, self._left - taken
            self.allowed += reached.accepted * self._tolerances[0]
            if reached.outcome == DONE:
                return True
            if reached.outcome not in (TOO_SMALL, TOO_MANY) or len(self._tolerances) == 1:
                return False
            del self._tolerances[0]
            self.h = usual
        return False


@cache
def _weights(columns: int) -> FloatArray:
    from pendbench.solvers.extended.extrapolation import neville_weights

    return neville_weights(columns)


class Pair:
    """The two solves of one scene, at the same time.

    gap: how far apart they are now, in units of e; worst: the most that this has been.
    """

    def __init__(self, scene: Scene) -> None:
        from pendbench.physics.acting import is_plain

        self._scene, self._plain = scene, is_plain(scene)
        self._first, self._second = _plain_solves(scene) if self._plain else _solves_with_effects(scene)
        self.gap, self.worst = 0.0, 0.0

    @property
    def steps(self) -> int:
        """How many steps both have taken."""
        return self._first.steps + self._second.steps

    @property
    def allowed(self) -> float:
        """What the first solve's steps may have been off by together, rad or rad/s."""
        return self._first.allowed

    def advance(self, end: float) -> str:
        """Advance both to `end`, s; why not, where they did not get there."""
        while True:
            stop = self._next_stop(end)
            if not (self._first.advance(stop) and self._second.advance(stop)):
                return STUCK
            self.gap = self._compare()
            if not self.gap <= AGREEMENT:
                return HORIZON
            self.worst = max(self.worst, self.gap)
            if stop == end:
                return ""

    def _next_stop(self, end: float) -> float:
        t = self._first.t
        stop = t + _STEPS_BETWEEN * min(self._first.h, self._second.h)
        return min(end, max(stop, math.nextafter(t, math.inf)))

    def _compare(self) -> float:
        from pendbench.physics.extended.gravity import form_difference
        from pendbench.physics.geometry import distance

        state, other, n = self._first.state, self._second.state, self._scene.n
        apart = form_difference(state, other) if self._plain else (other[:n] - state[:n]).sum(axis=1)
        return float(distance(self._scene.lengths, state[:n, 0], apart))

    def state(self) -> FloatArray:
        """Angles and rates of the first solve, (2 n, 2): high and low parts."""
        from pendbench.physics.extended.gravity import with_whole_turns

        if self._plain:
            return with_whole_turns(self._scene, self._first.state)
        return self._first.state[: 2 * self._scene.n].copy()


def _plain_solves(scene: Scene) -> tuple[Solve, Solve]:
    from pendbench.physics.extended.gravity import angle_form, vector_form

    return Solve(*angle_form(scene), _COLUMNS[0]), Solve(*vector_form(scene), _COLUMNS[1])


def _solves_with_effects(scene: Scene) -> tuple[Solve, Solve]:
    from pendbench.physics.acting import rotor_inertias
    from pendbench.physics.extended.inertias import inertia_form
    from pendbench.physics.extended.matrices import matrix_form
    from pendbench.physics.extended.mobilities import mobility_form, suits
    from pendbench.physics.extended.rotors import rotor_form

    if rotor_inertias(scene).any():
        return Solve(*rotor_form(scene), _COLUMNS[0]), Solve(*matrix_form(scene), _COLUMNS[1])
    first = Solve(*inertia_form(scene), _COLUMNS[0])
    if suits(scene):
        return first, Solve(*mobility_form(scene), _COLUMNS[1])
    return first, Solve(*matrix_form(scene), _COLUMNS[1])


def solve_angles(scene: Scene, times: FloatArray) -> Iterator[FloatArray]:
    """The angle form's state (2 n, 2) at each time (s, rising), the same array each time, as long as it goes on."""
    return _states(_plain_solves(scene)[0], times)


def solve_vectors(scene: Scene, times: FloatArray) -> Iterator[FloatArray]:
    """The vector form's state (3 n, 2) at each time (s, rising), the same array each time, as long as it goes on."""
    return _states(_plain_solves(scene)[1], times)


def _states(solve: Solve, times: FloatArray) -> Iterator[FloatArray]:
    for end in times:
        if not solve.advance(float(end)):
            return
        yield solve.state
