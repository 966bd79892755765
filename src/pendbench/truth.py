"""The truth for a scene, how well it is known, and until when.

Two solves in double-double arithmetic that share neither formulation, nor order, nor steps: angles with the O(n)
recursion at order 28, and unit vectors with tensions from a tridiagonal system at order 24; where more than gravity
acts, a recursion for rods with mass, and the matrices of the equations of motion. Where the two agree, both are right;
the time until which they do is the horizon.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from pendbench.arrays import FloatArray
from pendbench.errors import InputError
from pendbench.scene import Scene, load_scene
from pendbench.trajectory import Trajectory

#: The reference ends where its two solves differ by more than this (in units of e: lengths of the chain).
AGREEMENT = 1e-9
#: The most links of a chain on which more than gravity acts.
MOST_WITH_EFFECTS = 200

# One extrapolated step carries about 1e-29 of rounding; a tolerance much nearer to that is met by no step. Where the
# equations themselves lose digits (mass ratios of 1e8) a solve takes the next one and goes on.
_TOLERANCES = (1e-27, 1e-24, 1e-21, 1e-18)
_COLUMNS = (14, 12)
_FIRST_STEP = 1e-3
_SMALLEST_STEP = 1e-12
_MOST_STEPS = 1_000_000
_MOST_STEPS_AT_ONCE = 1000  # between two samples; more say that the tolerance cannot be met


@dataclass(frozen=True, eq=False, kw_only=True)
class Truth(Trajectory):
    """A trajectory that ends at its horizon.

    horizon: s, the last sample at which the two solves agree. error: the largest disagreement up to there, in units of
    the chain's total length. disagreement: (k,) the same at each sample. theta_low, omega_low: (k, n) what double
    precision leaves out of theta and omega.
    """

    horizon: float
    error: float
    disagreement: FloatArray
    theta_low: FloatArray
    omega_low: FloatArray

    def offset(self, theta: FloatArray) -> FloatArray:
        """How far angles theta (j, n) at this trajectory's first j times are from the truth, rad, (j, n)."""
        j = len(theta)
        difference: FloatArray = (theta - self.theta[:j]) - self.theta_low[:j]
        return difference


class _Solve:
    """One of the two solves: a system, its state, and how it advances."""

    def __init__(self, system: Any, state: FloatArray, weights: FloatArray) -> None:
        self.system, self.state, self.weights = system, state, weights
        self.relative = np.ones(len(state))
        self.h, self.steps, self.tolerances = _FIRST_STEP, 0, list(_TOLERANCES)

    def advance(self, t: float, end: float) -> bool:
        """Advance from t to end; False where the solve cannot go on."""
        from pendbench.solvers.extrapolation import integrate_extended
        from pendbench.solvers.outcome import DONE, TOO_MANY, TOO_SMALL

        usual = self.h
        while self.steps < _MOST_STEPS:
            progress = integrate_extended(
                self.system,
                self.weights,
                t,
                end,
                self.h,
                self.state,
                self.tolerances[0],
                self.relative,
                _SMALLEST_STEP,
                max(_MOST_STEPS_AT_ONCE, math.ceil(4 * (end - t) / usual)),
            )
            t, self.h, self.steps = progress.t, progress.h, self.steps + progress.accepted + progress.rejected
            if progress.outcome == DONE:
                return True
            if progress.outcome not in (TOO_SMALL, TOO_MANY) or len(self.tolerances) == 1:
                return False
            del self.tolerances[0]
            self.h = usual
        return False


@cache
def _weights(columns: int) -> FloatArray:
    from pendbench.solvers.extrapolation import neville_weights

    return neville_weights(columns)


def _solve(system: Any, state: FloatArray, columns: int, times: FloatArray) -> Iterator[FloatArray]:
    solve = _Solve(system, state, _weights(columns))
    t = 0.0
    for end in times:
        if not solve.advance(t, end):
            return
        t = float(end)
        yield solve.state


def solve_angles(scene: Scene, times: FloatArray) -> Iterator[FloatArray]:
    """The angle form's state (2 n, 2) at each time (s, rising), the same array each time, as long as it goes on."""
    from pendbench.physics.extended import angle_form

    return _solve(*angle_form(scene), _COLUMNS[0], times)


def solve_vectors(scene: Scene, times: FloatArray) -> Iterator[FloatArray]:
    """The vector form's state (3 n, 2) at each time (s, rising), the same array each time, as long as it goes on."""
    from pendbench.physics.extended import vector_form

    return _solve(*vector_form(scene), _COLUMNS[1], times)


def _march(scene: Scene, times: FloatArray) -> Iterator[tuple[FloatArray, float]]:
    """The first form's state (2 n, 2) and its distance from the second's, at each time, as long as both go on."""
    from pendbench.physics.acting import is_plain
    from pendbench.physics.geometry import distance

    pairs = _plain_pairs(scene, times) if is_plain(scene) else _pairs_with_effects(scene, times)
    for state, difference in pairs:
        yield state, float(distance(scene.lengths, state[: scene.n, 0], difference))


def _plain_pairs(scene: Scene, times: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    from pendbench.physics.extended import form_difference, with_whole_turns

    for angles, vectors in zip(solve_angles(scene, times), solve_vectors(scene, times), strict=False):
        yield with_whole_turns(scene, angles), form_difference(angles, vectors)


def _pairs_with_effects(scene: Scene, times: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    from pendbench.physics.extended_effects import dense_form, recursive_form

    recursive = _solve(*recursive_form(scene), _COLUMNS[0], times)
    dense = _solve(*dense_form(scene), _COLUMNS[1], times)
    for state, other in zip(recursive, dense, strict=False):
        yield state[: 2 * scene.n].copy(), (other - state)[: scene.n].sum(axis=1)


def _rising(times: npt.ArrayLike) -> FloatArray:
    try:
        array = np.atleast_1d(np.asarray(times, dtype=np.float64))
    except (TypeError, ValueError):
        array = np.array([np.nan])
    fits = array.ndim == 1 and array.size > 0 and bool(np.all(np.isfinite(array)))
    if not (fits and array[0] >= 0.0 and np.all(np.diff(array) > 0.0)):
        raise InputError("times cannot be used; allowed: one or more finite, rising numbers from 0 on, s")
    return array


def _check_size(scene: Scene) -> None:
    from pendbench.physics.acting import is_plain

    if scene.n > MOST_WITH_EFFECTS and not is_plain(scene):
        said = f"scene {scene.name!r} has {scene.n} links and more than gravity"
        raise InputError(f"{said}; allowed for the reference: at most {MOST_WITH_EFFECTS}")


def reference(scene: Scene | str | os.PathLike[str], times: npt.ArrayLike | None = None) -> Truth:
    """The truth for `scene` at `times` (k,) s, by default 1001 times over its duration, until its horizon.

    scene: a `Scene`, or what `load_scene` takes. A step costs O(n) under gravity, and O(n^3) where more acts: 100 links
    then took 0.3 s for a millisecond. Raises InputError where times are none, or not finite, not rising, or
    negative, and for more than `MOST_WITH_EFFECTS` links with more than gravity. Source: docs/measuring.md.
    """
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    _check_size(scene)
    wanted = np.linspace(0.0, scene.duration, 1001) if times is None else _rising(times)
    states, gaps, reason = [], [], ""
    for state, gap in _march(scene, wanted):
        if not gap <= AGREEMENT:
            reason = "ends at its horizon: past it the two solves no longer agree"
            break
        states.append(state)
        gaps.append(gap)
    n, k = scene.n, len(states)
    stacked = np.array(states).reshape(k, 2 * n, 2)
    disagreement = np.array(gaps)
    if k < len(wanted) and not reason:
        reason = "ends where one of its solves would have needed more steps, or smaller ones, than it is allowed"
    return Truth(
        t=wanted[:k],
        theta=stacked[:, :n, 0],
        omega=stacked[:, n:, 0],
        gap=np.zeros(k),
        reason=reason,
        horizon=float(wanted[k - 1]) if k else 0.0,
        error=float(disagreement.max()) if k else 0.0,
        disagreement=disagreement,
        theta_low=stacked[:, :n, 1],
        omega_low=stacked[:, n:, 1],
    )
