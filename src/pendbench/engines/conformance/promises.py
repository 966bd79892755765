"""What every method owes its caller, whatever it computes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pendbench.base.strict import show
from pendbench.engines.conformance.chains import (
    after,
    build,
    calm,
    difference,
    disordered,
    forward,
    same_bits,
)
from pendbench.engines.conformance.check import Reading, Subject, broken, check, kept
from pendbench.engines.conformance.truth import names_of_effects
from pendbench.engines.protocol import Simulation, State, mapped_effects

#: Where the limit of two runs comes from that should be one.
ROUNDING = (
    "rounding: 20 units in the last place for each step, 1e-9 for what iterations and tolerances leave, or the plateau"
)
STATE = "rad or rad/s"


@check(asks="Has it a name, a version, methods with orders, and settings within their bounds?", whole=True)
def describes_itself(its: Subject) -> Iterator[Reading]:
    """The engine as a whole."""
    flaws = [*_flaws_of_engine(its), *_flaws_of_methods(its)]
    yield from map(broken, flaws) if flaws else [kept()]


def _flaws_of_engine(its: Subject) -> Iterator[str]:
    engine = its.engine
    if not (engine.name and engine.name.isprintable()):
        yield f"its name is {show(engine.name)}; it must be printable text"
    version = engine.version()
    if not (isinstance(version, str) and version):
        yield f"version() gave {show(version)}; it must be text"
    if unknown := sorted(set(mapped_effects(engine)) - set(names_of_effects())):
        yield f"effects has {show(unknown[0])}; allowed: {', '.join(names_of_effects())}"


def _flaws_of_methods(its: Subject) -> Iterator[str]:
    for name, method in its.engine.methods.items():
        if not (isinstance(name, str) and name):
            yield f"a method is called {show(name)}; its name must be text"
        if method.order < 1:
            yield f"method {name!r} claims order {show(method.order)}; it must be 1 or more"
        for key, setting in method.settings.items():
            default = setting.low if setting.default is None else setting.default
            if not setting.low <= default <= setting.high:
                yield f"the default of {key!r}, method {name!r}, is outside its own bounds"


@check(asks="Is the state at time 0 that of the scene?", unit=STATE, limit_from=ROUNDING)
def starts_at_the_start(its: Subject) -> Iterator[Reading]:
    """With health() quiet."""
    scene = disordered()
    run = build(its, scene)
    off = difference(run.state(), State(scene.angles, scene.rates))
    yield Reading(off, its.rounding(1), f"at time 0 the state is off the scene's start by {off:.2g}")
    if (fault := run.health()) is not None:
        yield broken(f"at time 0 health() says {show(str(fault))}")


@check(asks="Does state() give float64 arrays (n,) that the run does not go on to use?")
def gives_arrays_of_its_own(its: Subject) -> Iterator[Reading]:
    """Neither does the run write into them, nor does it read what others write."""
    run, twin = build(its, disordered()), build(its, disordered())
    before = run.state()
    for name, array in (("theta", before.theta), ("omega", before.omega)):
        if not isinstance(array, np.ndarray) or array.shape != (3,) or array.dtype != np.float64:
            yield broken(f"{name} is not a float64 array of shape (3,)")
            return
    copied = State(before.theta.copy(), before.omega.copy())
    forward(run, 3)
    if not same_bits(before, copied):
        yield broken("a state that was read changes when the run goes on")
    before = run.state()
    before.theta[:], before.omega[:] = 9.0, 9.0
    forward(run, 2, start=3)
    forward(twin, 3)
    forward(twin, 2, start=3)
    same = difference(run.state(), twin.state()) < its.rounding(5)
    yield kept() if same else broken("writing into a state that was read changes the run")


@check(
    asks="Do two runs of one scene give the same bits, and leave each other alone?",
    unit=STATE,
    limit_from="none: no bit may differ",
)
def repeats_itself(its: Subject) -> Iterator[Reading]:
    """One after the other, so that a state shared by both shows."""
    run, twin = build(its, disordered()), build(its, disordered())
    before = twin.state()
    if not same_bits(before, twin.state()):
        yield Reading(
            difference(before, twin.state()), 0.0, "two readings of one state differ: something in it is random"
        )
        return
    forward(run, 50)
    moved = difference(before, twin.state())
    if not moved < its.rounding(1):
        yield Reading(moved, 0.0, "advancing one run moves another: they share their state")
        return
    forward(twin, 50)
    one, other = run.state(), twin.state()
    apart = 0.0 if same_bits(one, other) else max(difference(one, other), 5e-324)
    yield Reading(apart, 0.0, f"two runs of one scene differ by {apart:.2g}: something in it is random, or remembered")


@check(
    asks="Are 2 steps and 3 steps the same as 5 steps?",
    unit=STATE,
    limit_from=f"no bit for a fixed step; else {ROUNDING}",
)
def adds_steps_up(its: Subject) -> Iterator[Reading]:
    """With the state read in between, and no steps taken."""
    whole, parts = build(its, disordered()), build(its, disordered())
    forward(whole, 5)
    forward(parts, 2)
    for _ in range(3):
        parts.state()
        parts.health()
    if isinstance(parts, Simulation):
        parts.advance(0)
    forward(parts, 3, start=2)
    fixed, one, other = isinstance(whole, Simulation), whole.state(), parts.state()
    apart = 0.0 if same_bits(one, other) else max(difference(one, other), 5e-324)
    split = (
        "2 steps and 3 steps are not the same as 5 steps"
        if fixed
        else "going on from a time on the way is not the same"
    )
    yield Reading(
        apart, 0.0 if fixed else its.rounding(5), f"{split}: the result depends on the calls, {apart:.2g} apart"
    )


@check(asks="Is the scene as it was after a run?")
def leaves_the_scene_alone(its: Subject) -> Iterator[Reading]:
    """By its digest."""
    scene = disordered()
    before = scene.digest
    forward(build(its, scene), 5)
    yield kept() if scene.digest == before else broken("the scene was changed")


@check(
    asks="Is a calm run reported as well, with its rods as long as they were?",
    unit="of a rod's length",
    limit_from="1 %: what a study calls stable",
)
def is_well_when_calm(its: Subject) -> Iterator[Reading]:
    """Half a second of the calm chain."""
    run = build(its, calm())
    forward(run, 500)
    if (fault := run.health()) is not None:
        yield broken(f"a calm run is reported as {show(str(fault))}")
    gap = abs(run.state().gap)
    yield Reading(gap, 0.01, f"in a calm run a rod is off its length by {gap:.2g} of it")


@check(asks="Does the mirrored chain move in the mirror?", unit=STATE, limit_from=ROUNDING)
def mirrors(its: Subject) -> Iterator[Reading]:
    """Nothing that acts on it tells left from right."""
    left, right = after(its, disordered()), after(its, disordered(sign=-1.0))
    off = difference(left, State(-right.theta, -right.omega))
    yield Reading(off, its.rounding(500), f"the mirrored chain does not move in the mirror: off by {off:.2g}")


@check(asks="Does a chain of a thousand times the mass move alike?", unit=STATE, limit_from=ROUNDING)
def ignores_the_unit_of_mass(its: Subject) -> Iterator[Reading]:
    """The equations have masses in ratios only."""
    one, other = after(its, disordered()), after(its, disordered(masses=1000.0))
    off = difference(one, other)
    yield Reading(off, its.rounding(500), f"a thousand times the mass moves differently: off by {off:.2g}")
