"""What most people write: the note's matrices in numpy, under the solvers of scipy's `solve_ivp`.

The chain's equations as they stand, C(theta) theta'' = S(theta) theta'^2 + torques, built and solved anew at each
call. The solvers are those that `solve_ivp` makes, driven step by step; a state on the way is read off their dense
output, as `t_eval` does it. So a state is as good as the interpolant, and not only as the step.

The default tolerance is scipy's, 1e-3: its RK45 then keeps a double pendulum for about a second.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import scipy

from pendbench.base.arrays import FloatArray, all_finite
from pendbench.base.faults import Fault
from pendbench.engines.protocol import AdaptiveSimulation, Mapped, Method, Setting, State
from pendbench.physics import acting
from pendbench.scene.scene import Scene

_SOLVERS: Final = {
    "rk45": ("RK45", 5, "Dormand and Prince, solve_ivp's default"),
    "dop853": ("DOP853", 8, "Dormand and Prince, of order 8"),
    "lsoda": ("LSODA", 12, "Adams or backward differences, of order up to 12, whichever it finds fit"),
    "radau": ("Radau", 5, "Radau IIA, implicit, with a Jacobian by differences"),
    "tight": ("DOP853", 8, "DOP853 as tight as doubles allow"),
}
_SHARE: Final = 1e-3  # of atol in rtol, as scipy's own defaults have it
_DEFAULT: Final = 1e-3
_TIGHTEST: Final = 1e-13  # scipy takes 100 roundings for the least
_FOREVER: Final = 1e12  # s; a run goes on for as long as it is asked to

_TOLERANCE: Final = "rtol; atol is a thousandth of it"
_MOST: Final = Setting(1e7, 1, 1e15, integer=True, note="more steps end the run with status 'work limit'")


def _method(name: str) -> Method:
    _, order, note = _SOLVERS[name]
    settings = {"most_steps": _MOST}
    if name != "tight":  # at any other tolerance it would be dop853
        settings = {"tolerance": Setting(_DEFAULT, _TIGHTEST, 1e-2, note=_TOLERANCE), **settings}
    return Method(order, adaptive=True, dense=True, settings=settings, note=note)


_TORQUES: Final = "in the equations of motion, computed in numpy"
_EFFECTS: Final = {
    "gravity": Mapped("in the equations of motion"),
    "joint_damping": Mapped(_TORQUES),
    "joint_stiffness": Mapped(_TORQUES),
    "joint_rest": Mapped(_TORQUES),
    "joint_torque": Mapped(_TORQUES),
    "air_drag": Mapped(_TORQUES),
    "rod_mass": Mapped("in the mass matrix"),
    "driven_pivot": Mapped("gravity of the pivot's frame, in the equations of motion"),
    "drive_torque": Mapped(_TORQUES),
    "armature": Mapped("in the mass matrix"),
    "links": Mapped("in the mass matrix"),
}
_MOST_LINKS: Final = 1000  # a hundred thousand solves of n^3 each


class _Equations:
    """The derivative of (theta, omega), (2n,)."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._n = scene, scene.n
        masses, index = acting.lumped_masses(scene), np.arange(scene.n)
        hanging = np.cumsum(masses[::-1])[::-1]
        self._levers = hanging * scene.lengths
        self._pairs = hanging[np.maximum.outer(index, index)] * np.outer(scene.lengths, scene.lengths)
        bends = np.eye(scene.n) - np.eye(scene.n, k=-1)
        rotors = bends.T @ (acting.rotor_inertias(scene)[:, np.newaxis] * bends)
        self._fixed = rotors + np.diag(acting.link_inertias(scene))
        self._pushed = acting.is_pushed(scene)

    def __call__(self, t: float, y: FloatArray) -> FloatArray:
        theta, omega = y[: self._n], y[self._n :]
        apart = np.subtract.outer(theta, theta)
        x, upwards = acting.pivot_acceleration(self._scene, t)
        right = -(self._pairs * np.sin(apart)) @ omega**2
        right -= self._levers * (upwards * np.sin(theta) + x * np.cos(theta))
        if self._pushed:
            right += acting.generalized_forces(self._scene, t, theta, omega)
        return np.concatenate([omega, np.linalg.solve(self._pairs * np.cos(apart) + self._fixed, right)])


class _Run:
    """One chain under one solver."""

    def __init__(self, scene: Scene, method: str, tolerance: float, most_steps: int) -> None:
        solver: Any = getattr(scipy.integrate, _SOLVERS[method][0])
        start = np.concatenate([scene.angles, scene.rates])
        equations, limits = _Equations(scene), {"rtol": tolerance, "atol": _SHARE * tolerance}
        with np.errstate(all="ignore"):
            if method == "lsoda" and not equations(0.0, start).any():
                # Where nothing moves yet it takes that share of the time to go, which is for ever here.
                limits["first_step"] = scene.duration * math.sqrt(tolerance)
            self._solver = solver(equations, 0.0, start, _FOREVER, **limits)
        self._left, self._time, self._wrong = most_steps, 0.0, ""
        self._between: Any = None

    def advance_to(self, time: float) -> int:
        before, its = self._left, self._solver
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # LSODA warns before it fails, which is told as a fault
            while its.t < time and self._left > 0 and not self._wrong:
                self._left -= 1
                self._step()
        self._time = min(time, its.t)
        return before - self._left

    def _step(self) -> None:
        self._between = None
        try:
            said = self._solver.step()
        except (ValueError, np.linalg.LinAlgError) as error:  # a matrix with infinities in it, or a singular one
            said = str(error)
        if self._solver.status == "failed" or not all_finite(self._solver.y):
            said = said or "an angle or a rate is not finite"
        self._wrong = said or ""

    def state(self) -> State:
        its = self._solver
        with np.errstate(all="ignore"):
            y = its.y if self._time == its.t else self._within_step()(self._time)
        theta, omega = np.split(np.array(y, np.float64), 2)
        return State(theta, omega)

    def _within_step(self) -> Any:
        """The states of the last step, made once: DOP853 evaluates its equations three times more for them."""
        if self._between is None:
            self._between = self._solver.dense_output()
        return self._between

    def health(self) -> Fault | None:
        at = f"at t = {self._solver.t:.6g} s"
        if self._wrong:
            return Fault("not finite" if "finite" in self._wrong else "work limit", f"{self._wrong} {at}")
        return None if self._left > 0 else Fault("work limit", f"more steps than allowed {at}")


class ScipyEngine:
    """scipy, with the note's equations in numpy."""

    name = "scipy"
    methods: Mapping[str, Method] = {name: _method(name) for name in _SOLVERS}
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of scipy itself."""
        return str(scipy.__version__)

    def refuses(self, scene: Scene) -> str | None:
        """Chains whose matrices take too long."""
        if scene.n > _MOST_LINKS:
            return f"{scene.n} links; more than {_MOST_LINKS} take too long with dense matrices"
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> AdaptiveSimulation:  # noqa: ARG002
        """A run at time 0."""
        chosen = self.methods[method].with_defaults(settings)
        return _Run(scene, method, chosen.get("tolerance", _TIGHTEST), int(chosen["most_steps"]))
