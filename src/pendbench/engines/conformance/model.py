"""Does a method have the accelerations of the equations, in random states of chains of every kind?"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.accelerations import acceleration_at_start, longest_span
from pendbench.engines.conformance.chains import build, calm, careful, chain, difference, disordered, forward
from pendbench.engines.conformance.check import Reading, Subject, check
from pendbench.engines.conformance.suspects import Seen, suspect
from pendbench.engines.conformance.truth import truth
from pendbench.engines.protocol import State, refusal
from pendbench.physics.dense import accelerations
from pendbench.scene.scene import Scene

# Of the largest acceleration. Measured: 4e-13 to 1e-6 for the bundled methods, whatever their order.
_ACCELERATION: Final = 1e-6
_LIMIT: Final = "1e-6, 30 times how well the limit of its steps is known, and the rounding of its rates over the span"
# How far the limit of steps may be off, over what its own estimate says: measured up to 17, for `xpbd` in 200 seeds.
_DOUBT: Final = 30.0
_SIZE: Final = "of the largest acceleration"
# An iterative solver that starts from its last answer needs about n^2 / 3 iterations to settle: of a long chain, 10 for
# each of so many steps are enough.
_SETTLED: Final = 128
_STEPS: Final = 64
_FALLEN: Final = 0.75  # of what it was: it falls
# What settles exponentially and has this left with four times the steps has more than `_FALLEN` left with 32 times.
_STANDS: Final = 0.98
# Of methods with a plateau: two numbers of fine steps a second, and how far off they may be in other chains than the
# calm one, whose plateau it is.
_FINE: Final = (2048, 4096)
_PLATEAUS: Final = 10.0


class _Measured(NamedTuple):
    """Accelerations (n,) rad/s^2 that an engine has; how far off, and how far they may be, over the largest one."""

    found: FloatArray
    off: float
    limit: float


def _swing(random: np.random.Generator, n: int, **parts: float | FloatArray) -> Scene:
    """Any angles, and rates of the size of a swing."""
    scene = chain(random.uniform(-math.pi, math.pi, n), np.zeros(n), **parts)  # type: ignore[arg-type]
    return scene.with_start(scene.angles, random.normal(0.0, math.sqrt(9.81 / scene.total_length), n))


def _rope(random: np.random.Generator) -> Scene:
    """Thirty short links in a bent line: a rope that is neither straight nor crumpled."""
    angles = np.cumsum(random.normal(0.0, 0.2, 30))
    return chain(angles, random.normal(0.0, 1.0, 30), length=0.1)


_CHAINS: Final[dict[str, Callable[[np.random.Generator], Scene]]] = {
    "two links": lambda random: _swing(random, 2),
    "three links": lambda random: _swing(random, 3),
    "ten links": lambda random: _swing(random, 10, length=0.2),
    "heavy tip": lambda random: _swing(random, 3, masses=np.array([1.0, 1.0, 100.0])),
    "rope of thirty": _rope,
}


@check(asks="Are its accelerations those of the equations, in random states?", unit=_SIZE, limit_from=_LIMIT)
def is_the_same_system(its: Subject) -> Iterator[Reading]:
    """Their limit for short spans knows no order of a method.

    What gives way, or is rounded to single precision, may have no such limit, and a plateau: its motion is looked at.
    """
    if its.plateau:
        yield from _comes_down_to_its_plateau(its)
        return
    random = its.random()
    known = [("a calm chain", calm()), ("a bent chain", disordered())]
    for about, scene in known + [(name, make(random)) for name, make in _CHAINS.items()]:
        if about.startswith("rope") and refusal(its.engine, its.method, scene) is not None:
            continue  # it says so itself
        _, off, limit = _settled(its, scene, _SETTLED if scene.n > 10 else _STEPS)
        yield Reading(off, limit, "" if off <= limit else _cause(its, off), about)
        if not off <= limit:
            return  # the other chains would say the same


def _comes_down_to_its_plateau(its: Subject) -> Iterator[Reading]:
    """The state after a quarter of a second, in the limit of fine steps as two of them and its order give it."""
    for about, scene in (("a calm chain", calm()), ("a bent chain", disordered())):
        coarse, fine = (_early(its, scene, steps) for steps in _FINE)
        share = 1.0 / (2**its.order - 1)
        limit = State(*(b + share * (b - a) for a, b in zip(coarse[:2], fine[:2], strict=True)))
        off = difference(limit, truth(scene)[0])
        cause = f"another system: off by {off:.2g} in the limit of fine steps, and its plateau is {its.plateau:g}"
        yield Reading(off, _PLATEAUS * its.plateau, cause, f"{about}, its motion")


def _early(its: Subject, scene: Scene, steps: int) -> State:
    run = build(its, scene, dt=1.0 / steps)
    forward(run, steps // 4)
    return run.state()


def _settled(its: Subject, scene: Scene, steps: int) -> _Measured:
    """The accelerations of a solver that may want more steps to settle: those of the fewest that will do.

    What falls with the number of steps in a span is no other system, but a solver on its way; where it is a long way,
    the limit is taken, and what does not fall at all is not waited for. More steps have more rounding, which excuses
    nothing that does not fall.
    """
    first = before = last = _accelerations(its, scene, steps)
    if first.off <= first.limit:
        return first
    for times in (2, 4, 8, 16, 32):
        before, last = last, _accelerations(its, scene, times * steps)
        if last.off <= min(last.limit, _FALLEN * first.off):
            return last
        if times == 4 and not last.off < _STANDS * first.off:
            return first
    if not last.off < _FALLEN * before.off:
        return first
    found = 2.0 * last.found - before.found
    exact = accelerations(scene, scene.angles, scene.rates)
    return _Measured(found, float(np.abs(found - exact).max() / np.abs(exact).max()), before.off)


def _accelerations(its: Subject, scene: Scene, steps: int) -> _Measured:
    exact = accelerations(scene, scene.angles, scene.rates)
    size, fastest = float(np.abs(exact).max()), float(np.abs(scene.rates).max())
    pace = size + fastest**2
    build(its, scene)  # says what is wrong with a run before its numbers are used
    found, known = acceleration_at_start(its.engine, scene, its.method, pace, careful(its), steps)
    rounded = 50.0 * its.eps * max(fastest, 1.0) / longest_span(pace)
    off = float(np.abs(found - exact).max()) / size
    return _Measured(found, off if math.isfinite(off) else math.inf, _ACCELERATION + (_DOUBT * known + rounded) / size)


def _cause(its: Subject, off: float) -> str:
    """What is wrong, and what would explain it in a few more states of a short chain."""
    random, seen, known = its.random(), [], 0.0
    for _ in range(4):
        scene = _swing(random, 3)
        found, _, limit = _accelerations(its, scene, _STEPS)
        seen.append(Seen(scene, found))
        known = max(known, limit)
    why = suspect(seen, known / off)
    said = f"another system: accelerations differ by {off:.2g} of the largest"
    return f"{said}; {why}" if why else said


@check(
    asks="Does a lone link go on turning where nothing acts, slowly and fast?",
    unit="of its rate",
    limit_from="1 %: a method that stretches the rod loses rate in proportion to its step, 0.002 rad here",
)
def has_no_gravity_unasked(its: Subject) -> Iterator[Reading]:
    """Without gravity the rate of a single link is what it was."""
    for rate in (2.0, 1000.0):
        scene, dt = chain(np.array([1.0]), np.array([rate]), gravity=None), 0.002 / rate
        run = build(its, scene, dt=dt)
        forward(run, 500, dt=dt)
        omega = float(run.state().omega[0])
        off = abs(omega - rate) / rate
        cause = f"without gravity, a single link's rate of {rate:g} rad/s becomes {omega:.5g}"
        clipped = "; clipped, or drag unasked" if rate > 2.0 else "; gravity or drag unasked"
        yield Reading(off if math.isfinite(off) else math.inf, 0.01, cause + clipped, f"{rate:g} rad/s")
