"""The runs of the analytic engine: each holds a state and advances it with one of our solvers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol

import numpy as np

from pendbench.base.faults import Fault
from pendbench.engines.protocol import State, not_finite
from pendbench.physics.acting import check_plain
from pendbench.physics.kernels.system import RotorSystem
from pendbench.physics.kernels.table import momenta_of, rates_of, series_system_of, system_of
from pendbench.scene.scene import Scene
from pendbench.solvers import adaptive, control, outcome, taylor
from pendbench.solvers.closing import chain_of
from pendbench.solvers.compensated import sum_from
from pendbench.solvers.dop853 import DOP853
from pendbench.solvers.methods import FixedStep, Form

#: Of a run that is not asked again: an interrupt, or an error, left it somewhere in the middle.
_INTERRUPTED: Final = Fault("error", "a call to go on did not come to its end, so where it is now is not known")


def _given_up(how: int, t: float) -> Fault | None:
    if how not in outcome.REASONS:
        return None
    status, reason = outcome.REASONS[how]
    return Fault(status, f"{reason} at t = {t:.6g} s")


class _Rates:
    """Angles and rates, as a method of that form advances them."""

    def __init__(self, scene: Scene, method: FixedStep) -> None:
        self.system, self.state = system_of(scene), method.begin(scene.angles, scene.rates)

    def now(self, taken: int) -> State:  # noqa: ARG002
        return State(self.state.q.copy(), self.state.v.copy())


def _unforced(system: Any) -> Any:
    """The same chain, and nothing that acts on it: momenta and rates know only that, so all effects share kernels."""
    if isinstance(system, RotorSystem):
        return RotorSystem(_unforced(system.chain), system.rotors)
    return system._replace(pivots=(), joints=(), drags=())


class _Momenta:
    """Angles and momenta."""

    def __init__(self, scene: Scene, method: FixedStep) -> None:
        self.system, momenta = system_of(scene), np.empty(scene.n)
        self._bare, self._rates = _unforced(self.system), scene.rates.copy()
        momenta_of(self._bare, scene.angles.copy(), self._rates, momenta)
        self.state = method.begin(scene.angles, momenta, scene.rates)

    def now(self, taken: int) -> State:
        if taken:
            rates_of(self._bare, self.state.q, self.state.p, self._rates)
        return State(self.state.q.copy(), self._rates.copy())


class _Rods:
    """The rods in the plane, and the angles and rates that they leave."""

    def __init__(self, scene: Scene, method: FixedStep) -> None:
        check_plain(scene, method.name)
        self.system = chain_of(scene.masses, scene.lengths, scene.effects.gravity or 0.0)
        self.state = method.begin(scene.angles, scene.rates)

    def now(self, taken: int) -> State:  # noqa: ARG002
        return State(self.state.q.copy(), self.state.v.copy(), float(self.state.gap[0]))


class _Variables(Protocol):
    """A system, its state as a solver keeps it, and what that says after so many steps."""

    system: Any
    state: Any

    def now(self, taken: int) -> State: ...


_VARIABLES: Final[Mapping[Form, Callable[[Scene, FixedStep], _Variables]]] = {
    Form.RATES: _Rates,
    Form.MOMENTA: _Momenta,
    Form.RODS: _Rods,
}


class FixedRun:
    """A method with a fixed step, in the variables of its form. threads: how many it may use."""

    def __init__(self, scene: Scene, method: FixedStep, dt: float, threads: float = 1) -> None:
        self._method, self._dt, self._taken = method, dt, 0
        self._fault: Fault | None = None
        self._last = (int(threads),) if method.threads > 1 else ()
        self._variables = _VARIABLES[method.form](scene, method)

    def advance(self, steps: int) -> None:
        """Take `steps` steps, or as many as can be taken."""
        if self._fault is not None:
            return
        its, self._fault = self._variables, _INTERRUPTED  # unless it comes to its end
        taken = self._method.advance(its.system, its.state, self._taken, self._dt, steps, *self._last)
        self._taken += taken
        self._fault = None if taken == steps else self._stuck()

    def state(self) -> State:
        """The state now."""
        return self._variables.now(self._taken)

    def health(self) -> Fault | None:
        """Whether it is finite, and whether all steps could be taken."""
        return self._fault or not_finite(self.state())

    def _stuck(self) -> Fault:
        where = f"at t = {self._taken * self._dt:.6g} s"
        return Fault("not converged", f"{self._method.stuck} {where}; {self._method.remedy}")


def _limits(settings: Mapping[str, Any], relative: Any) -> control.Limits:
    smallest, most_steps = float(settings["smallest_step"]), int(settings["most_steps"])
    return control.Limits(float(settings["tolerance"]), relative, smallest, most_steps)


class _ChoosingSteps:
    """A run that chooses its steps; how it advances, and what its state is, its class says. begin: its time, s."""

    def __init__(self, settings: Mapping[str, Any], relative: Any, begin: float, first_step: float) -> None:
        self._limits, self._t, self._h = _limits(settings, relative), begin, first_step
        self._outcome, self._at_work = outcome.DONE, False

    def advance_to(self, time: float) -> int:
        """Advance to `time` and return how many steps that took."""
        if self._at_work:
            return 0
        self._at_work = True  # for good, unless this comes to its end
        found = self._integrate(time)
        taken: int = found.accepted + found.rejected
        self._t, self._h, self._outcome = found.t, found.h, found.outcome
        self._limits, self._at_work = control.less(self._limits, taken) if taken else self._limits, False
        return taken

    def health(self) -> Fault | None:
        """Whether it is finite and within its limits."""
        if self._at_work:
            return _INTERRUPTED
        return _given_up(self._outcome, self._t) or not_finite(self.state())

    def state(self) -> State:
        """The state now."""
        raise NotImplementedError

    def _integrate(self, time: float) -> outcome.Reached:
        raise NotImplementedError


class Adaptive(_ChoosingSteps):
    """An embedded pair with error control and compensated summation. begin: the time of the scene's start, s."""

    def __init__(self, scene: Scene, settings: Mapping[str, Any], begin: float = 0.0) -> None:
        # Angles are measured absolutely: a rod that has turned a thousand times is no less well known.
        relative = np.concatenate([np.zeros(scene.n), np.ones(scene.n)])
        super().__init__(settings, relative, begin, control.FIRST_STEP)
        self._system, self._y = system_of(scene), sum_from(np.concatenate([scene.angles, scene.rates]))

    def _integrate(self, time: float) -> outcome.Reached:
        return adaptive.integrate(self._system, DOP853, self._limits, self._t, self._h, time, self._y)

    def state(self) -> State:
        n, value = len(self._y.value) // 2, self._y.value
        return State(value[:n].copy(), value[n:].copy())


class Taylor(_ChoosingSteps):
    """Taylor's method, its order chosen for the tolerance."""

    def __init__(self, scene: Scene, settings: Mapping[str, Any]) -> None:
        super().__init__(settings, 1.0, 0.0, taylor.NO_STEP)
        order = taylor.order_for(settings["tolerance"])
        self._system = series_system_of(scene, order)
        self._series = taylor.series_from(scene.angles, scene.rates, order)
        self._state = State(scene.angles.copy(), scene.rates.copy())

    def _integrate(self, time: float) -> outcome.Reached:
        found = taylor.integrate(self._system, self._limits, self._t, self._h, time, self._series)
        reached = time - found.t if found.outcome == outcome.DONE else 0.0
        taylor.state_at(reached, self._series, *self._state[:2])
        return found

    def state(self) -> State:
        return State(self._state.theta.copy(), self._state.omega.copy())
