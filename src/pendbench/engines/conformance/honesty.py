"""Does a method own up: to steps that are far too large, to those that it takes, to what it does beside its work?"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray, all_finite
from pendbench.base.faults import STATUSES, Fault
from pendbench.base.strict import show
from pendbench.engines.conformance.chains import (
    DT,
    after,
    build,
    calm,
    chain,
    difference,
    disordered,
    forward,
    same_bits,
)
from pendbench.engines.conformance.check import Reading, Subject, broken, check, kept
from pendbench.engines.conformance.surroundings import surroundings_kept
from pendbench.engines.conformance.truth import SAMPLES, truth
from pendbench.engines.protocol import AdaptiveSimulation, Simulation, State
from pendbench.physics.energy import energy, energy_scale
from pendbench.scene.scene import Scene

_STEPS: Final = 5
#: Numbers look fine where the energy has not strayed by so much of its scale: what a study calls stable.
_FINE: Final = 0.01
# The table of differences: how many runs, and how far apart in angle, rad: the eighth power of that is nothing.
_RUNS: Final = 9
_APART: Final = 1e-3
_LEVELS: Final = (4, 5, 6)
# Units in the last place. Measured in 200 seeds: 3 to 300 for most bundled methods, and up to 40,000 where velocities
# are differences of positions, over a step of 10 ms, of rods that hold to some ten units.
_NOISE: Final = 2e5


@check(
    asks="Asked for steps of ten seconds, does it say that something is wrong?",
    limit_from="no silence beside numbers that look fine: energy within 1 % of its scale",
)
def owns_up(its: Subject) -> Iterator[Reading]:
    """Steps of many turns, of a whipping chain: a fault, or an energy that shows it; never numbers that look fine."""
    scene = chain(np.linspace(0.0, 2.0, 5), np.full(5, 30.0))
    run = build(its, scene, dt=10.0)
    for k in range(20):
        with np.errstate(all="ignore"):
            forward(run, _STEPS, dt=10.0) if isinstance(run, Simulation) else forward(run, k + 1, dt=0.01)
        if (fault := run.health()) is not None:
            flaws = list(_flaws_of_fault(fault))
            yield from map(broken, flaws) if flaws else [kept()]
            return
        state = run.state()
        if not all_finite(state.theta, state.omega):
            yield broken("the state is not finite, and health() says nothing")
            return
        if isinstance(run, Simulation) and not its.engine.methods[its.method].substeps:
            flaw = _numbers_that_look_fine(its, scene, run.state(), _STEPS * (k + 1))
            if flaw:
                yield broken(flaw)
                return
    yield kept()


def _flaws_of_fault(fault: Fault) -> Iterator[str]:
    if not isinstance(fault, Fault):
        yield f"health() gave {show(fault)}; it must be a Fault or None"
    elif fault.status not in STATUSES or fault.status == "ok":
        yield f"health() gave the status {show(fault.status)}; allowed: {', '.join(STATUSES)}"
    elif not fault.reason:
        yield f"health() gave no reason for {fault.status!r}"


def _numbers_that_look_fine(its: Subject, scene: Scene, state: State, taken: int) -> str | None:
    """What is wrong with a state after so many steps, of which nothing was said."""
    with np.errstate(all="ignore"):
        strayed = float(energy(scene, *state[:2]) - energy(scene, scene.angles, scene.rates)) / energy_scale(scene)
    if abs(strayed) > _FINE:
        return None
    again = build(its, scene, dt=10.0)
    for _ in range(taken):
        if same_bits(again.state(), state):
            return "it started again or stopped, in silence: its state is one that it had before"
        forward(again, 1)
    return f"after {taken} steps of 10 s nothing is said, and the energy is off by {abs(strayed):.2g} only"


@check(asks="Does it take the steps that it is asked for, and count those that it chooses?")
def counts_its_steps(its: Subject) -> Iterator[Reading]:
    """A fixed step that is halved changes the result; chosen steps are counted."""
    if not its.adaptive:
        scene = disordered()
        one, other = build(its, scene, dt=0.01), build(its, scene, dt=0.005)
        forward(one, 20)
        forward(other, 40)
        same = same_bits(one.state(), other.state()) and not its.engine.methods[its.method].substeps
        yield broken("steps of 10 and of 5 ms give the same bits: it takes steps of its own") if same else kept()
        return
    run = build(its, calm())
    assert isinstance(run, AdaptiveSimulation)
    taken = run.advance_to(1.0)
    if not isinstance(taken, int | np.integer):
        yield broken(f"advance_to() gave {show(taken)}; it must be a number of steps")
    else:
        yield kept() if taken >= 1 else broken(f"{taken} steps for a second of motion")


@check(
    asks="Does its state depend smoothly on its start, but for rounding?",
    unit="units in the last place",
    limit_from="measured: 3 to 300, up to 40,000 of differences of positions over a step; of adaptive ones 1e-9, too",
    needs=("repeats itself",),
)
def is_smooth(its: Subject) -> Iterator[Reading]:
    """By the differences of runs from starts along a line.

    What is left in the higher ones is no smooth function of the start. Source: More and Wild, SIAM Journal on
    Scientific Computing 33 (2011), p. 1292.
    """
    steps, along = 20, its.random().normal(size=3)
    table = np.array([_from(its, _APART * k * along, steps) for k in range(_RUNS)])
    values = max(1.0, float(np.abs(table).max()))
    noise = min(_noise(table, level) for level in _LEVELS) / (its.eps * values)
    limit = max(_NOISE, 1e-9 / its.eps) if its.adaptive else max(_NOISE, its.plateau / its.eps)
    whole = its.eps * values * noise
    short = np.array_equal(table.astype(np.float32).astype(float), table) and not its.single
    likely = "its state is in single precision" if short else "single precision somewhere, noise, or a loose iteration"
    yield Reading(noise if np.isfinite(noise) else np.inf, limit, f"its results carry noise of {whole:.1g}: {likely}")


def _from(its: Subject, shift: FloatArray, steps: int) -> FloatArray:
    scene = disordered()
    state = after(its, scene.with_start(scene.angles + shift, scene.rates), steps)
    return np.concatenate([state.theta, state.omega])


def _noise(table: FloatArray, level: int) -> float:
    """The noise in the differences of a level: their root mean square, over what that is of independent noise of 1."""
    differences = np.diff(table, n=level, axis=0)
    squares = np.prod([(level + k) / k for k in range(1, level + 1)])  # (2 k)! / (k!)^2
    return float(np.sqrt((differences**2).mean(axis=0) / squares).max())


@check(
    asks="Is a run that goes on from a state the same as one that starts there?",
    unit="rad or rad/s",
    limit_from="four times what half the step changes (its error, where it chooses its steps), and rounding",
    needs=("is the same system",),
)
def forgets_its_past(its: Subject) -> Iterator[Reading]:
    """A shift in time changes nothing, where nothing drives."""
    whole, finer = build(its, calm()), build(its, calm(), dt=0.5 * DT)
    forward(whole, 250)
    there = whole.state()
    forward(whole, 250, start=250)
    forward(finer, 1000, dt=0.5 * DT)
    fresh = after(its, calm().with_start(there.theta, there.omega), 250)
    apart, own = difference(whole.state(), fresh), difference(whole.state(), finer.state())
    if its.adaptive:  # it has chosen the same steps twice, which says nothing of its error
        own = max(own, difference(whole.state(), truth(calm())[SAMPLES // 2 - 1]))
    cause = f"a run that starts from a state on the way ends {apart:.2g} apart: something but the state decides"
    yield Reading(apart, 4.0 * own + its.rounding(500), cause)


@check(asks="Does it print nothing, and leave the working folder and numpy's error state as they were?")
def leaves_the_process_alone(its: Subject) -> Iterator[Reading]:
    """While it is built, advances and is read."""
    with surroundings_kept() as flaws:
        run = build(its, calm())
        forward(run, 5)
        run.state()
        run.health()
    yield from map(broken, flaws) if flaws else [kept()]
