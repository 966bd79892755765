"""The runs of the analytic engine: each holds a state and advances it with one of our solvers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.engines.protocol import Fault, State
from pendbench.physics import canonical
from pendbench.physics.acting import check_plain
from pendbench.physics.geometry import positions, velocities
from pendbench.physics.recursion import system_of
from pendbench.physics.series import series_system_of
from pendbench.scene import Scene
from pendbench.solvers import adaptive, explicit, frame, gauss, outcome, rattle, tableaux, taylor


def _finite(*arrays: FloatArray) -> Fault | None:
    if all(np.all(np.isfinite(array)) for array in arrays):
        return None
    return Fault("not finite", "an angle or a rate is not finite")


def _given_up(how: int, t: float) -> Fault | None:
    if how not in outcome.REASONS:
        return None
    status, reason = outcome.REASONS[how]
    return Fault(status, f"{reason} at t = {t:.6g} s")


class RungeKutta:
    """Explicit Runge-Kutta with a fixed step."""

    def __init__(self, scene: Scene, dt: float, method: tableaux.Tableau) -> None:
        self._system, self._method, self._dt, self._taken = system_of(scene), method, dt, 0
        self._y = np.concatenate([scene.angles, scene.rates])

    def advance(self, steps: int) -> None:
        """Take `steps` steps."""
        explicit.runge_kutta(self._system, self._method, self._taken, self._dt, self._y, steps)
        self._taken += steps

    def state(self) -> State:
        """The state now."""
        theta, omega = np.split(self._y, 2)
        return State(theta.copy(), omega.copy())

    def health(self) -> Fault | None:
        """Whether it is finite."""
        return _finite(self._y)


class SemiImplicitEuler:
    """Semi-implicit Euler."""

    def __init__(self, scene: Scene, dt: float) -> None:
        self._system, self._dt, self._taken = system_of(scene), dt, 0
        self._q, self._v = scene.angles.copy(), scene.rates.copy()

    def advance(self, steps: int) -> None:
        """Take `steps` steps."""
        explicit.semi_implicit_euler(self._system, self._taken, self._dt, self._q, self._v, steps)
        self._taken += steps

    def state(self) -> State:
        """The state now."""
        return State(self._q.copy(), self._v.copy())

    def health(self) -> Fault | None:
        """Whether it is finite."""
        return _finite(self._q, self._v)


class Adaptive:
    """An embedded pair with error control and compensated summation."""

    def __init__(self, scene: Scene, settings: Mapping[str, Any]) -> None:
        self._system, self._t = system_of(scene), 0.0
        self._y, self._carry = np.concatenate([scene.angles, scene.rates]), np.zeros(2 * scene.n)
        # Angles are measured absolutely: a rod that has turned a thousand times is no less well known.
        self._relative = np.concatenate([np.zeros(scene.n), np.ones(scene.n)])
        self._settings, self._left = settings, int(settings["most_steps"])
        self._h, self._outcome = adaptive.FIRST_STEP, outcome.DONE

    def advance_to(self, time: float) -> int:
        """Advance to `time` and return how many steps that took."""
        progress = adaptive.integrate(
            self._system,
            tableaux.DOP853,
            self._t,
            time,
            self._h,
            self._y,
            self._carry,
            self._settings["tolerance"],
            self._relative,
            self._settings["smallest_step"],
            self._left,
        )
        taken: int = progress.accepted + progress.rejected
        self._t, self._h, self._outcome, self._left = progress.t, progress.h, progress.outcome, self._left - taken
        return taken

    def state(self) -> State:
        """The state now."""
        theta, omega = np.split(self._y, 2)
        return State(theta.copy(), omega.copy())

    def health(self) -> Fault | None:
        """Whether it is finite and within its limits."""
        return _given_up(self._outcome, self._t) or _finite(self._y)


class Taylor:
    """Taylor's method, its order chosen for the tolerance."""

    def __init__(self, scene: Scene, settings: Mapping[str, Any]) -> None:
        order = taylor.order_for(settings["tolerance"])
        self._system, self._t, self._h = series_system_of(scene, order), 0.0, taylor.NO_STEP
        self._q, self._v, self._carry = scene.angles.copy(), np.zeros((order + 1, scene.n)), np.zeros((2, scene.n))
        self._v[0] = scene.rates
        self._state = State(scene.angles.copy(), scene.rates.copy())
        self._settings, self._left, self._outcome = settings, int(settings["most_steps"]), outcome.DONE

    def advance_to(self, time: float) -> int:
        """Advance to `time` and return how many series that took."""
        progress = taylor.integrate(
            self._system,
            self._t,
            self._h,
            time,
            self._q,
            self._v,
            self._carry,
            self._settings["tolerance"],
            1.0,
            self._settings["smallest_step"],
            self._left,
        )
        taken: int = progress.accepted
        self._t, self._h, self._outcome, self._left = progress.t, progress.h, progress.outcome, self._left - taken
        reached = time - self._t if self._outcome == outcome.DONE else 0.0
        taylor.state_at(reached, self._q, self._v, self._carry, *self._state[:2])
        return taken

    def state(self) -> State:
        """The state now."""
        return State(self._state.theta.copy(), self._state.omega.copy())

    def health(self) -> Fault | None:
        """Whether it is finite and within its limits."""
        return _given_up(self._outcome, self._t) or _finite(self._state.theta, self._state.omega)


class Gauss:
    """Gauss-Legendre collocation in angles and momenta."""

    def __init__(self, scene: Scene, dt: float, stages: int) -> None:
        self._system, self._method, self._dt = system_of(scene), gauss.gauss_legendre(stages), dt
        self._taken, self._stuck = 0, False
        self._q, self._p = scene.angles.copy(), np.empty(scene.n)
        self._rates = scene.rates.copy()
        canonical.momenta_of(self._system, self._q, self._rates, self._p)
        self._carry, self._slopes = np.zeros((2, scene.n)), np.zeros((2, stages, scene.n))
        self._slopes[0] = self._rates

    def advance(self, steps: int) -> None:
        """Take `steps` steps, or as many as converge."""
        if self._stuck:
            return
        taken = gauss.collocate(
            self._system, self._method, self._taken, self._dt, self._q, self._p, self._carry, self._slopes, steps
        )
        self._taken += taken
        self._stuck = taken < steps
        if steps:
            canonical.rates_of(self._system, self._q, self._p, self._rates)

    def state(self) -> State:
        """The state now."""
        return State(self._q.copy(), self._rates.copy())

    def health(self) -> Fault | None:
        """Whether it is finite and its stages converged."""
        if self._stuck:
            where = f"at t = {self._taken * self._dt:.6g} s"
            return Fault("not converged", f"the stages of a step did not converge {where}; a smaller step might")
        return _finite(self._q, self._rates)


class _Ends:
    """The rods' ends in the plane, as RATTLE moves them, and what they say of angles and rates."""

    def __init__(self, scene: Scene) -> None:
        check_plain(scene, "RATTLE")
        gravity = scene.effects.gravity or 0.0
        self.rods = rattle.Rods(scene.masses.copy(), scene.lengths.copy(), gravity, np.empty((8, scene.n)))
        self.points = positions(scene.lengths, scene.angles)
        self.speeds = velocities(scene.lengths, scene.angles, scene.rates)
        self.forces = np.zeros(scene.n)
        self._start = State(scene.angles.copy(), scene.rates.copy())
        self.turns = np.round((scene.angles - self._directions()) / (2 * np.pi))

    def _rods_now(self) -> FloatArray:
        return np.diff(self.points, axis=0, prepend=np.zeros((1, 2)))

    def _directions(self) -> FloatArray:
        rods = self._rods_now()
        return np.arctan2(rods[:, 0], -rods[:, 1])

    def state(self, taken: int) -> State:
        """The angles and rates after that many steps, and how far the worst rod is from its length."""
        if taken == 0:
            return State(self._start.theta.copy(), self._start.omega.copy())
        theta = self._directions() + 2 * np.pi * self.turns
        relative = np.diff(self.speeds, axis=0, prepend=np.zeros((1, 2)))
        omega = (np.cos(theta) * relative[:, 0] + np.sin(theta) * relative[:, 1]) / self.rods.lengths
        gap = np.abs(np.hypot(*self._rods_now().T) / self.rods.lengths - 1).max()
        return State(theta, omega, float(gap))


class Rattle:
    """RATTLE on the rods' ends."""

    def __init__(self, scene: Scene, dt: float) -> None:
        self._ends, self._dt, self._taken, self._stuck = _Ends(scene), dt, 0, False

    def advance(self, steps: int) -> None:
        """Take `steps` steps, or as many as converge."""
        if self._stuck:
            return
        ends = self._ends
        taken = rattle.rattle(ends.rods, self._dt, ends.points, ends.speeds, ends.forces, ends.turns, steps)
        self._taken += taken
        self._stuck = taken < steps

    def state(self) -> State:
        """The state now, and how far the worst rod is from its length."""
        return self._ends.state(self._taken)

    def health(self) -> Fault | None:
        """Whether it is finite and its rods could be kept at their lengths."""
        if self._stuck:
            where = f"at t = {self._taken * self._dt:.6g} s"
            return Fault("not converged", f"no forces keep the rods at their lengths {where}; a smaller step might")
        return _finite(self._ends.points, self._ends.speeds)


class Frame:
    """RATTLE on the rods' ends, each frame in as many steps as it asks for."""

    def __init__(self, scene: Scene, dt: float) -> None:
        self._ends, self._dt, self._taken, self._stuck = _Ends(scene), dt, 0, False
        self._substeps = 1

    def advance(self, steps: int) -> None:
        """Take `steps` frames, or as many as can be cut finely enough."""
        if self._stuck:
            return
        ends = self._ends
        progress = frame.advance(
            ends.rods, self._dt, self._substeps, ends.points, ends.speeds, ends.forces, ends.turns, steps
        )
        self._substeps = progress.substeps
        self._taken += progress.frames
        self._stuck = progress.frames < steps

    def state(self) -> State:
        """The state now, and how far the worst rod is from its length."""
        return self._ends.state(self._taken)

    def health(self) -> Fault | None:
        """Whether it is finite and its frames could be cut finely enough."""
        if self._stuck:
            where = f"at t = {self._taken * self._dt:.6g} s"
            needs = f"the chain moves too fast for {frame.MOST_SUBSTEPS} steps in a frame"
            return Fault("not converged", f"{needs} {where}; a shorter frame would do")
        return _finite(self._ends.points, self._ends.speeds)
