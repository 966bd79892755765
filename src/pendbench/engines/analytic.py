"""The project's own engine: the O(n) recursion, advanced by our solvers. A simulation holds arrays; kernels do the rest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from pendbench import __version__
from pendbench.engines.protocol import AdaptiveSimulation, Fault, Method, Setting, Simulation, State
from pendbench.scene import Scene
from pendbench.trajectory import FloatArray

_SETTINGS: Final = {
    "tolerance": Setting(1e-14, 1e-15, 1e-2, note="local error allowed per step: rad, and relative for rates"),
    "smallest_step": Setting(1e-12, 0.0, 1.0, note="s; a smaller step ends the run with status 'work limit'"),
    "most_steps": Setting(1e8, 1, 1e15, integer=True, note="more steps end the run with status 'work limit'"),
}

_METHODS: Final = {
    "adaptive": Method(order=8, adaptive=True, settings=_SETTINGS, note="DOP853 with compensated summation"),
    "rk4": Method(order=4, note="the classical Runge-Kutta method"),
    "euler": Method(order=1, note="semi-implicit Euler, the method of most engines for games"),
}


def _start(scene: Scene) -> FloatArray:
    return np.concatenate([scene.angles, scene.rates])


def _state(y: FloatArray) -> State:
    n = len(y) // 2
    return State(y[:n].copy(), y[n:].copy())


def _finite(y: FloatArray) -> Fault | None:
    return None if np.all(np.isfinite(y)) else Fault("not finite", "the state is no longer finite")


class _FixedStep:
    """`rk4` and `euler`."""

    def __init__(self, scene: Scene, method: str, dt: float) -> None:
        from pendbench.physics.recursion import system_of
        from pendbench.solvers import explicit, tableaux

        self._system, self._y, self._dt, self._taken = system_of(scene), _start(scene), dt, 0
        self._rk4 = tableaux.RK4 if method == "rk4" else None
        self._runge_kutta, self._euler = explicit.runge_kutta, explicit.semi_implicit_euler

    def advance(self, steps: int) -> None:
        t = self._taken * self._dt
        if self._rk4 is None:
            n = len(self._y) // 2
            self._euler(self._system, t, self._dt, self._y[:n], self._y[n:], steps)
        else:
            self._runge_kutta(self._system, self._rk4, t, self._dt, self._y, steps)
        self._taken += steps

    def state(self) -> State:
        return _state(self._y)

    def health(self) -> Fault | None:
        return _finite(self._y)


class _Adaptive:
    """`adaptive`."""

    def __init__(self, scene: Scene, tolerance: float, smallest_step: float, most_steps: float) -> None:
        from pendbench.physics.recursion import system_of
        from pendbench.solvers import adaptive, tableaux

        self._integrate, self._method, self._system = adaptive.integrate, tableaux.DOP853, system_of(scene)
        self._reasons = adaptive.REASONS
        self._y, self._carry, self._t = _start(scene), np.zeros(2 * scene.n), 0.0
        self._relative = np.concatenate([np.zeros(scene.n), np.ones(scene.n)])
        self._tolerance, self._smallest, self._left = tolerance, smallest_step, int(most_steps)
        self._h, self._outcome = adaptive.FIRST_STEP, adaptive.DONE

    def advance_to(self, time: float) -> int:
        progress = self._integrate(
            self._system,
            self._method,
            self._t,
            time,
            self._h,
            self._y,
            self._carry,
            self._tolerance,
            self._relative,
            self._smallest,
            self._left,
        )
        taken: int = progress.accepted + progress.rejected
        self._t, self._h, self._outcome, self._left = progress.t, progress.h, progress.outcome, self._left - taken
        return taken

    def state(self) -> State:
        return _state(self._y)

    def health(self) -> Fault | None:
        if self._outcome in self._reasons:
            status, reason = self._reasons[self._outcome]
            return Fault(status, f"{reason} at t = {self._t:.6g} s")
        return _finite(self._y)


class AnalyticEngine:
    """The analytic engine."""

    name = "analytic"
    methods: Mapping[str, Method] = _METHODS

    def version(self) -> str:
        return __version__

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        return None

    def build(
        self, scene: Scene, method: str, dt: float | None, **settings: float
    ) -> Simulation | AdaptiveSimulation:
        if self.methods[method].adaptive:
            return _Adaptive(scene, **self.methods[method].with_defaults(settings))
        if dt is None:
            raise ValueError(f"method {method!r} needs a step")
        return _FixedStep(scene, method, dt)
