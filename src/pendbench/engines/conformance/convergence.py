"""Do errors fall with the step as the order says: of the state, of the energy, of the momentum?"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.conformance.chains import build, calm, difference, disordered, forward
from pendbench.engines.conformance.check import Reading, SkippedError, Subject, check
from pendbench.engines.conformance.delays import delay
from pendbench.engines.conformance.truth import SAMPLES, truth
from pendbench.engines.protocol import State, refusal
from pendbench.physics.dense import mass_matrix
from pendbench.physics.energy import energy, energy_scale
from pendbench.scene.scene import Scene

#: Names of the check that the others need: what another system does says nothing of a method.
SAME: Final = ("is the same system", "starts at the start")

#: How far a measured order of convergence may be from the one that is claimed.
ORDER_SLACK: Final = 0.2
# That of one number, which may pass through zero, is seen less well.
_ONE_NUMBER: Final = 0.5
# The ladder of steps for the order: fractions of a second. Errors outside this window say nothing of the order: above
# it the method is not in its limit yet, below it is rounding.
_LADDER: Final = (4, 8, 16, 32, 64, 128, 256, 512, 1024)
_FINER: Final = (2048, 4096, 8192)  # where those leave too few
_HIGHEST: Final = 2e-2
_RUNGS: Final = 3
#: The largest error of an adaptive method at its default settings, after 1 s of the calm chain.
_BY_DEFAULT: Final = 1e-6
# What a method may make of its default tolerance in a second. Measured: 9 times (scipy's LSODA at 1e-3), 38 times
# (Drake's method of order 5 at 1e-4).
_OF_TOLERANCE: Final = 100.0
# An error e of the state changes the energy by about e: that it changes by so many times less is no accident.
_TOO_GOOD: Final = 1e6


class Climb(NamedTuple):
    """Numbers of steps a second, and for each the states at the quarters of the first second."""

    steps: tuple[int, ...]
    states: tuple[tuple[State, ...], ...]

    def errors(self, error: Callable[[tuple[State, ...]], float]) -> FloatArray:
        """An error of each rung."""
        return np.array([error(states) for states in self.states])


def climb(its: Subject, scene: Scene, ladder: tuple[int, ...] = _LADDER) -> Climb:
    """The scene with finer and finer steps."""
    return Climb(ladder, tuple(_sampled(its, scene, steps) for steps in ladder))


def _sampled(its: Subject, scene: Scene, steps: int) -> tuple[State, ...]:
    run, found = build(its, scene, dt=1.0 / steps), []
    with np.errstate(all="ignore"):
        for k in range(SAMPLES):
            forward(run, steps // SAMPLES, start=k * steps // SAMPLES)
            found.append(run.state())
    return tuple(found)


class Order(NamedTuple):
    """An order that was seen, and between which steps a second with which errors."""

    order: float
    steps: tuple[int, int]
    errors: tuple[float, float]


def seen_order(its: Subject, steps: tuple[int, ...], errors: FloatArray) -> Order | None:
    """The slope of the finest errors that say something; None where fewer than two do."""
    floor = max(1e-11, 100.0 * its.eps, its.plateau)
    told = np.flatnonzero((errors > floor) & (errors < _HIGHEST))[-_RUNGS:]
    if len(told) < 2:
        return None
    rungs, found = np.array(steps)[told], errors[told]
    order = -float(np.polyfit(np.log(rungs), np.log(found), 1)[0])
    return Order(order, (int(rungs[0]), int(rungs[-1])), (float(found[0]), float(found[-1])))


def state_error(scene: Scene) -> Callable[[tuple[State, ...]], float]:
    """How far states at the quarters of a second are from the truth, rad or rad/s."""
    right = truth(scene)
    return lambda states: max(difference(one, other) for one, other in zip(states, right, strict=True))


@check(
    asks="Does its error fall with the step as its order says, or with its tolerance?",
    unit="orders, or rad",
    limit_from="0.2 of an order, which the error's next term makes; of adaptive methods 1e-6 rad or 100 tolerances",
    needs=SAME,
)
def converges(its: Subject) -> Iterator[Reading]:
    """In a calm swing of two links."""
    if its.adaptive:
        yield from _obeys_its_tolerance(its)
        return
    scene = calm()
    found = climb(its, scene)
    errors = _errors(its, scene, found)
    order = seen_order(its, found.steps, errors)
    if order is None and errors[-1] > 0.1 * _HIGHEST:
        finer = climb(its, scene, _FINER)
        found = Climb(found.steps + finer.steps, found.states + finer.states)
        errors = _errors(its, scene, found)
        order = seen_order(its, found.steps, errors)
    if order is None and its.single and errors.min() < 1e-3:
        raise SkippedError("in single precision its errors are too small to show an order")
    if order is None:
        told = f"no two errors between 1e-11 and {_HIGHEST:g}: {_steadfast(errors)}"
        yield Reading(np.inf, its.slack(ORDER_SLACK), told + _why(scene, found, errors, None))
        return
    off, allowed = abs(order.order - its.order), its.slack(ORDER_SLACK)
    why = "" if off <= allowed else _why(scene, found, errors, order)
    yield Reading(off, allowed, f"{_told(order, its.order)}{why}")


def _errors(its: Subject, scene: Scene, found: Climb) -> FloatArray:
    """Against the truth; of a method with a plateau what changes from one step to the next, which falls alike."""
    if not its.plateau:
        return found.errors(state_error(scene))
    pairs = itertools.pairwise(found.states)
    return np.array([np.inf, *(max(map(difference, one, other)) for one, other in pairs)])


def _told(order: Order, claimed: int) -> str:
    (coarse, fine), (first, last) = order.steps, order.errors
    told = f"errors {first:.2g} and {last:.2g} at {coarse} and {fine} steps a second"
    return f"its order is {order.order:.2f}, and it claims {claimed}: {told}"


def _steadfast(errors: FloatArray) -> str:
    return f"errors from {errors.min():.2g} to {errors.max():.2g}, whatever the step"


def _why(scene: Scene, found: Climb, errors: FloatArray, order: Order | None) -> str:
    """What would explain the errors of the finest step."""
    at = len(found.steps) - 1 if order is None else found.steps.index(order.steps[1])
    why = delay(scene, 1.0 / found.steps[at], found.states[at])
    falls = errors[-2] / errors[-1] if errors[-1] else np.inf
    if why is None and falls < 1.5 and errors[-1] > 1e-4:
        why = "its error does not depend on the step: it takes steps of its own"
    elif why is None and falls < 1.5:
        why = f"its error stops at {errors[-1]:.1g}: single precision somewhere, or iterations that end early"
    return f"; {why}" if why else ""


def _obeys_its_tolerance(its: Subject) -> Iterator[Reading]:
    def error(**settings: float) -> float:
        run = build(its, calm(), settings=settings)
        forward(run, 1, dt=1.0)
        return difference(run.state(), truth(calm())[-1])

    tolerance = its.engine.methods[its.method].settings.get("tolerance")
    loosely = _OF_TOLERANCE * (tolerance.default or 0.0) if tolerance else 0.0
    off = error()
    limit = max(_BY_DEFAULT, loosely, its.rounding(500))
    yield Reading(off, limit, f"at its default settings its error is {off:.2g} after 1 s", "default settings")
    if tolerance and not its.single:
        loose, tight = error(tolerance=1e-4), error(tolerance=1e-9)
        cause = f"its error falls from {loose:.2g} only to {tight:.2g} with a tolerance 1e5 times as tight"
        yield Reading(tight / loose if loose else 0.0, 0.01, cause, "tolerance 1e5 times as tight")


@check(
    asks="Does the energy, less the work of dampers, come to what it should be with the order?",
    unit="orders below",
    limit_from="half an order: the error of one number may pass through zero; 1e-6 for adaptive methods",
    needs=(*SAME, "converges"),
)
def balances_its_energy(its: Subject) -> Iterator[Reading]:
    """Against the energy of the truth at the same times, so that the work of dampers needs no integral."""
    for about, scene in _scenes_with_energy(its).items():
        found = _climb_or_run(its, scene)
        errors = found.errors(_energy_error(scene))
        yield _deficit(its, found.steps, errors, "energy", about)
        conserves = its.engine.methods[its.method].conserves
        if about == "nothing damps" and not (its.adaptive or conserves):
            yield from _too_good(scene, found, errors)


def _energy_error(scene: Scene) -> Callable[[tuple[State, ...]], float]:
    """How far the energies of states are from the truth's, in units of the energy scale."""
    right, scale = [energy(scene, *state[:2]) for state in truth(scene)], energy_scale(scene)

    def error(states: tuple[State, ...]) -> float:
        found = [energy(scene, *state[:2]) for state in states]
        return float(np.abs(np.array(found) - np.array(right)).max()) / scale

    return error


def _scenes_with_energy(its: Subject) -> Mapping[str, Scene]:
    damped = disordered().with_(joint_damping=0.1)
    known = refusal(its.engine, its.method, damped) is None
    return {"nothing damps": disordered()} | ({"joints damp": damped} if known else {})


def _climb_or_run(its: Subject, scene: Scene) -> Climb:
    return climb(its, scene, (1000,) if its.adaptive else _LADDER)


def _deficit(its: Subject, steps: tuple[int, ...], errors: FloatArray, what: str, about: str) -> Reading:
    """By how much the order of an error is below what is claimed; of an adaptive method, how large it is."""
    if its.adaptive:
        cause = f"the {what} is off by {errors[0]:.2g} of its scale at its default settings"
        return Reading(float(errors[0]), max(_BY_DEFAULT, its.rounding(500)), cause, about)
    order = seen_order(its, steps, errors)
    if order is None:
        stays = float(errors[-1])
        return Reading(
            0.0 if stays < _HIGHEST else np.inf, its.slack(_ONE_NUMBER), f"the {what} is off by {stays:.2g}", about
        )
    cause = f"the {what} comes to what it should be with order {order.order:.2f}, and the method claims {its.order}"
    return Reading(max(0.0, its.order - order.order), its.slack(_ONE_NUMBER), cause, about)


def _too_good(scene: Scene, found: Climb, errors: FloatArray) -> Iterator[Reading]:
    """Whether the energy is kept to rounding by a method whose state is far off: put back by hand."""
    states = found.errors(state_error(scene))
    rough = np.flatnonzero((states > 1e-4) & (states < 0.5))
    if rough.size:
        at = int(rough[-1])
        ratio = float(states[at] / max(errors[at], 1e-16))
        cause = (
            f"its state is off by {states[at]:.2g} and its energy by {errors[at]:.2g}: the energy is put back by hand"
        )
        yield Reading(ratio, _TOO_GOOD, cause, "state against energy")


@check(
    asks="Does the angular momentum about the pivot stay, where nothing turns the chain?",
    unit="orders below",
    limit_from="half an order: the error of one number may pass through zero; 1e-6 for adaptive methods",
    needs=(*SAME, "converges", "has no gravity unasked"),
)
def keeps_its_momentum(its: Subject) -> Iterator[Reading]:
    """Without gravity."""
    scene = dataclasses.replace(disordered(gravity=None), name="free")
    first = _momentum(scene, State(scene.angles, scene.rates))
    size = float(np.abs(mass_matrix(scene, scene.angles) @ scene.rates).max())
    found = _climb_or_run(its, scene)
    errors = found.errors(lambda states: max(abs(_momentum(scene, state) - first) for state in states) / size)
    yield _deficit(its, found.steps, errors, "momentum", "")


def _momentum(scene: Scene, state: State) -> float:
    """The sum of the momenta of all angles, kg m^2/s: equations.md (E7)."""
    return float((mass_matrix(scene, state.theta) @ state.omega).sum())
