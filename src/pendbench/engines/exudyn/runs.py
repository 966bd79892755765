"""Runs of a chain by Exudyn's solvers: by a formula, by Newton's method, and with steps that it chooses."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import exudyn

from pendbench.base.faults import Fault
from pendbench.engines.exudyn.tree import Chain
from pendbench.engines.protocol import not_finite
from pendbench.scene.scene import Scene

_INITIAL: Final = exudyn.ConfigurationType.Initial
_SHORTEST_STEP: Final = 1e-12  # s; Exudyn's own is 1e-8
_FIRST_STEP: Final = 0.01  # s, the longest that Exudyn takes by default; one that ends in infinities would be kept
exudyn.config.suppressWarnings = True  # it prints them


@contextmanager
def _interruptible() -> Iterator[None]:
    """Exudyn makes an error of an interrupt that comes while it is at work, or in a user function: it is one again."""
    try:
        yield
    except Exception as error:
        if isinstance(error.__cause__, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        raise


def _settings(its_name: str, dt: float) -> Any:
    chosen = exudyn.SimulationSettings()
    chosen.timeIntegration.numberOfSteps, chosen.timeIntegration.endTime = 1, dt  # so that its step is dt, to the bit
    chosen.timeIntegration.solverType = getattr(exudyn.DynamicSolverType, its_name)
    chosen.timeIntegration.verboseMode = 0
    chosen.timeIntegration.generalizedAlpha.useNewmark = its_name == "TrapezoidalIndex2"
    chosen.timeIntegration.generalizedAlpha.useIndex2Constraints = its_name == "TrapezoidalIndex2"
    chosen.solution.file.write = False
    return chosen


class _Stepped:
    """A run with a fixed step. Each is a call of `SolveSteps`, so it is the same run however many are asked for."""

    def __init__(self, scene: Scene, its_name: str, dt: float, solver: Any, *, cut: bool) -> None:
        self._chain, self._failed, self._taken, self._dt = Chain(scene), False, 0, dt
        self.state = self._chain.state
        self._settings = _settings(its_name, dt)
        self._settings.timeIntegration.adaptiveStep = cut
        self._solver = solver
        self._solver.InitializeSolver(self._chain.mbs, self._settings)

    def advance(self, steps: int) -> None:
        with _interruptible():
            for _ in range(steps):
                if self._failed:
                    return
                start = self._taken * self._dt
                self._taken += 1
                self._failed = True  # unless it comes to its end: an interrupt leaves the run in the middle of a step
                self._failed = not self._step(start)

    def _step(self, start: float) -> bool:
        raise NotImplementedError

    def _solve(self, start: float, end: float) -> bool:
        now = self._solver.it
        now.startTime = now.currentTime = start
        now.endTime = end
        return bool(self._solver.SolveSteps(self._chain.mbs, self._settings))

    def health(self) -> Fault | None:
        if fault := not_finite(self.state()):
            return fault
        return Fault("not converged", "Exudyn gave up in the shortest step") if self._failed else None


class Explicit(_Stepped):
    """A run by a formula."""

    def __init__(self, scene: Scene, its_name: str, dt: float) -> None:
        super().__init__(scene, its_name, dt, exudyn.MainSolverExplicit(), cut=False)

    def _step(self, start: float) -> bool:
        return self._solve(start, start + 0.5 * self._dt)  # the first step past it is the last


class Implicit(_Stepped):
    """A run whose step is cut where Newton's method fails, and for some steps after that.

    A call of `SolveSteps` begins with a new Jacobian and with the whole step. How far steps are cut is kept from one to
    the next, by Exudyn's own rule.
    """

    def __init__(self, scene: Scene, its_name: str, dt: float) -> None:
        super().__init__(scene, its_name, dt, exudyn.MainSolverImplicitSecondOrder(), cut=True)
        self._parts, self._good = 1, 0

    def _step(self, start: float) -> bool:
        self._solver.it.maxStepSize = self._dt / self._parts
        solved = self._solve(start, self._taken * self._dt)
        self._choose_parts(self._solver.it)
        return solved

    def _choose_parts(self, last: Any) -> None:
        """Into how many parts the next step is cut."""
        rule, parts = self._settings.timeIntegration, last.currentStepIndex - 1
        if parts > self._parts:
            self._parts, self._good = 1 << (parts - 1).bit_length(), 0
            return
        self._good += parts
        easy = last.newtonSteps + last.discontinuousIteration <= rule.adaptiveStepRecoveryIterations
        if self._parts > 1 and self._good >= rule.adaptiveStepRecoverySteps and easy:
            self._parts, self._good = self._parts // 2, 0


class Chosen:
    """A run that chooses its steps, in each advance from a short one on."""

    def __init__(self, scene: Scene, tolerance: float) -> None:
        self._chain, self._time, self._failed = Chain(scene), 0.0, False
        self.state = self._chain.state
        self._settings = _settings("DOPRI5", _FIRST_STEP)
        chosen = self._settings.timeIntegration
        # No relative one: Exudyn's scale, a + r x without absolute values, is 0 at -1 where a and r are the same, and a
        # step that begins there is taken whatever its error is.
        chosen.absoluteTolerance, chosen.relativeTolerance = tolerance, 0.0
        chosen.minimumStepSize = _SHORTEST_STEP

    def advance_to(self, time: float) -> int:
        if self._failed or time <= self._time:
            return 0
        chosen = self._settings.timeIntegration
        chosen.startTime, chosen.endTime = self._time, time
        chosen.initialStepSize = min(_FIRST_STEP, time - self._time)
        solver, data = exudyn.MainSolverExplicit(), self._chain.mbs.systemData
        self._failed = True  # unless it comes to its end, as above
        with _interruptible():
            self._failed = not solver.SolveSystem(self._chain.mbs, self._settings)
        data.SetODE2Coordinates(data.GetODE2Coordinates(), _INITIAL)
        data.SetODE2Coordinates_t(data.GetODE2Coordinates_t(), _INITIAL)
        data.SetTime(time, _INITIAL)
        self._time = time
        return int(solver.it.currentStepIndex) - 1

    def health(self) -> Fault | None:
        if fault := not_finite(self.state()):
            return fault
        return Fault("work limit", "its control of the step gave up") if self._failed else None
