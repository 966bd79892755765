"""The accelerations that an engine has, from its steps alone."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.protocol import Engine, Method, Simulation
from pendbench.scene.scene import Scene

# An iterative solver that starts from its last answer needs some steps to settle, and one that takes its velocities
# from where the masses went gives them a kick of the step's size at first: so many steps are taken before any count.
_STEPS = 32
_LEVELS = 6
# What a method that chooses its steps is given where its own default is looser: as its users take it, it may miss more
# than what is looked for.
_CAREFUL = 1e-10


def careful(method: Method) -> dict[str, float]:
    """The settings with which a method shows what it can: none, unless its default tolerance is a loose one."""
    tolerance = method.settings.get("tolerance")
    if tolerance is None or tolerance.default is None or tolerance.default <= _CAREFUL:
        return {}
    return {"tolerance": max(tolerance.low, _CAREFUL)}


def acceleration_at_start(
    engine: Engine, scene: Scene, method: str, pace: float, settings: Mapping[str, float], steps: int = _STEPS
) -> tuple[FloatArray, float]:
    """Theta'' (n,) rad/s^2 at the scene's start as the engine has it, and how well that is known.

    The limit of its mean acceleration over a shrinking span, so it needs nothing but steps. pace: of the motion, 1/s^2,
    as the largest acceleration with the square of the largest rate. steps: in each span.
    """
    spans = [longest_span(pace) * 2.0**-level for level in range(_LEVELS)]
    return limit([_mean_acceleration(engine, scene, method, span, settings, steps) for span in spans])


def longest_span(pace: float) -> float:
    """The longest span, s, over which accelerations are taken."""
    return 0.02 / math.sqrt(pace)


def _mean_acceleration(
    engine: Engine, scene: Scene, method: str, span: float, settings: Mapping[str, float], steps: int
) -> FloatArray:
    """(omega(2 span) - omega(span)) / span, as the engine has it; from 0 to span where it chooses its steps."""
    adaptive = engine.methods[method].adaptive
    simulation = engine.build(scene, method, None if adaptive else span / steps, **settings)
    if isinstance(simulation, Simulation):
        simulation.advance(steps)
        before = simulation.state().omega
        simulation.advance(steps)
    else:
        before = simulation.state().omega
        simulation.advance_to(span)
    return (simulation.state().omega - before) / span


def limit(values: list[FloatArray]) -> tuple[FloatArray, float]:
    """The value at span 0 of a sequence whose span halves each time, and how well it is known.

    Of all extrapolated values, the one that differs least from the two it was made of: long spans leave truncation in
    it, short ones rounding, and either shows in those differences. Source: Ridders, Advances in Engineering Software 4
    (1982), p. 75.
    """
    best, known, column = values[-1], math.inf, values
    for k in range(1, len(values)):
        pairs = list(itertools.pairwise(column))
        column = [b + (b - a) / (2**k - 1) for a, b in pairs]
        for value, pair in zip(column, pairs, strict=True):
            change = max(float(np.abs(value - other).max()) for other in pair)
            if change < known:
                best, known = value, change
    return best, known
