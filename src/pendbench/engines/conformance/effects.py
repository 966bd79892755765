"""Does a method simulate what its engine says it does: each effect alone, with its order, and all together?"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.effects import examples
from pendbench.engines.conformance.chains import after, calm
from pendbench.engines.conformance.check import Reading, SkippedError, Subject, check
from pendbench.engines.conformance.convergence import SAME, climb, seen_order, state_error
from pendbench.engines.conformance.truth import names_of_effects, truth
from pendbench.engines.protocol import State, mapped_effects, refusal
from pendbench.scene.links import EXAMPLE, LINKS, Links
from pendbench.scene.scene import Effects, Scene

# By order (2 and more): how much of what effects change a method may miss at this step. Measured: up to 0.011 of order
# 1, and up to 3e-5 of the others.
_MISSED: Final = {1: 0.04, 2: 0.005}
_BELOW: Final = 0.3
_LADDER: Final = (32, 64, 128, 256, 512, 1024)
# In place of examples whose law has a kink: drag by the speed's square has one where a mass stands still.
_SMOOTH: Final = {"air_drag": {"linear": 0.2}}
# A mistake has to explain all but so much of what is missed.
_EXPLAINED: Final = 0.1


@check(
    asks="Does each effect, and do all together, change the motion as the equations say?",
    unit="of the change in half a second",
    limit_from="its step's error: 4 % of order 1, 0.5 % of the others; measured 1.1 % and 0.003 %",
    needs=SAME,
)
def simulates_the_effects_it_maps(its: Subject) -> Iterator[Reading]:
    """In a calm chain."""
    names = known_effects(its)
    allowed = _MISSED[min(2, its.order)]
    off = {name: _misses(its, [name]) for name in names}
    for name in names:
        why = "" if off[name] <= allowed else _why(its, name)
        cause = f"what it changes in half a second is off by {off[name]:.2g} of it{why}"
        yield Reading(off[name], allowed, cause, name)
    if len(names) > 1 and all(each <= allowed for each in off.values()):
        together = max(_misses(its, group) for group in _that_fit(names))
        cause = f"{', '.join(names)}: each alone is right, together they are not"
        yield Reading(together, allowed, cause, "all together")


@check(
    asks="Has it its order with each effect, too?",
    unit="orders below",
    limit_from="0.3 of an order: effects have terms of the next order of their own",
    needs=(*SAME, "converges", "simulates the effects it maps"),
)
def converges_with_each_effect(its: Subject) -> Iterator[Reading]:
    """With the order that the engine leaves the method with that effect."""
    if its.adaptive:
        raise SkippedError("it chooses its steps")
    mapped = mapped_effects(its.engine)
    for name in known_effects(its):
        scene = with_effects([name], _SMOOTH)
        found = climb(its, scene, _LADDER)
        order = seen_order(its, found.steps, found.errors(state_error(scene)))
        claimed = mapped[name].orders.get(its.method, its.order)
        if order is None:
            continue  # too exact at every step
        below = max(0.0, claimed - order.order)
        yield Reading(
            below, its.slack(_BELOW), f"its order is {order.order:.2f} with it, and it claims {claimed}", name
        )


def known_effects(its: Subject) -> list[str]:
    """What the method simulates beside gravity. Raises SkippedError where that is nothing."""
    own = its.engine.methods[its.method].effects
    means = mapped_effects(its.engine)
    names = [name for name in names_of_effects() if name in means and not means[name].refused]
    found = [name for name in names if name != "gravity" and (own is None or name in own)]
    if not found:
        raise SkippedError("it knows no effect beside gravity")
    return found


def _that_fit(names: list[str]) -> list[list[str]]:
    """The effects in groups that one chain can have: its links are rigid, or rods of some mass, but not both."""
    if LINKS not in names or "rod_mass" not in names:
        return [names]
    return [[name for name in names if name != other] for other in (LINKS, "rod_mass")]


def with_effects(names: list[str], changed: dict[str, Any] | None = None) -> Scene:
    """The calm chain with these effects; changed: others than the examples' values."""
    others = {name: its for name, its in (changed or {}).items() if name != LINKS}
    chosen = Effects(**{**examples(), **others}).only("gravity", *(name for name in names if name != LINKS))
    scene = dataclasses.replace(calm(), effects=chosen)
    if LINKS in names:
        return dataclasses.replace(scene, masses=np.zeros(scene.n), links=Links(**(changed or {}).get(LINKS, EXAMPLE)))
    return scene


def _misses(its: Subject, names: list[str]) -> float:
    """How far what effects change in the engine is from what they change in truth, as a share of it."""
    scene = with_effects(names)
    if (refused := refusal(its.engine, its.method, scene)) is not None:
        raise ValueError(f"refused {', '.join(names)}: {refused}")
    off = float(np.abs(_change(after(its, scene), after(its, calm())) - _right(scene)).max())
    share = off / float(np.abs(_right(scene)).max())
    return share if np.isfinite(share) else np.inf


def _change(now: State, before: State) -> FloatArray:
    return np.concatenate([now.theta - before.theta, now.omega - before.omega])


def _right(scene: Scene) -> FloatArray:
    return _change(truth(scene)[1], truth(calm())[1])


def _why(its: Subject, name: str) -> str:
    """Which mistake would have changed the motion as the engine did."""
    found = _change(after(its, with_effects([name])), after(its, calm()))
    whole = float(np.abs(found - _right(with_effects([name]))).max())
    best, why = _EXPLAINED, ""
    for said, scene in _mistakes(name):
        left = float(np.abs(found - _right(scene)).max()) / whole
        if left < best:
            best, why = left, f"; {said}"
    return why


def _mistakes(name: str) -> Iterator[tuple[str, Scene]]:
    yield "it is ignored", calm()
    value = EXAMPLE if name == LINKS else examples()[name]
    for said, factor in (("it counts twice", 2.0), ("it counts half", 0.5), ("it has the wrong sign", -1.0)):
        try:
            yield said, with_effects([name], {name: _scaled(value, factor)})
        except InputError:
            continue  # there is no such thing
    if name == LINKS:
        turned = {**EXAMPLE, "inertia": _about_joint()}
        yield "its inertia is taken about the wrong point", with_effects([name], {name: turned})
    yield "its list is in the reverse order", with_effects([name], {name: _reversed(value)})


def _about_joint() -> list[float]:
    return [i + m * c**2 for m, c, i in zip(EXAMPLE["mass"], EXAMPLE["centre"], EXAMPLE["inertia"], strict=True)]


def _scaled(value: Any, factor: float) -> Any:
    """A value so many times as strong: of a drive its amplitude, of drag its coefficients."""
    strengths = ("amplitude", "linear", "quadratic", "mass", "inertia")
    if isinstance(value, dict):
        return {key: _scaled(each, factor) if key in strengths else each for key, each in value.items()}
    return [factor * each for each in value] if isinstance(value, list | tuple) else factor * value


def _reversed(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _reversed(each) for key, each in value.items()}
    return list(value)[::-1] if isinstance(value, list | tuple) else value
