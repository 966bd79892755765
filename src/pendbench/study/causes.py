"""Why an engine disagrees: does it simulate another system, or the same one inexactly?"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.engines.protocol import Engine, Simulation
from pendbench.physics.recursion import accelerations
from pendbench.scene import Scene

_STATES = 4
_STEPS = 32  # an iterative solver that starts from its last answer needs some steps to settle
_LEVELS = 6


class ModelError(NamedTuple):
    """error: the largest difference of accelerations, over the largest acceleration. limit: how well that is known."""

    error: float
    limit: float


def _mean_acceleration(
    engine: Engine, scene: Scene, method: str, span: float, settings: dict[str, float]
) -> FloatArray:
    """(omega(span) - omega(0)) / span, as the engine has it."""
    adaptive = engine.methods[method].adaptive
    simulation = engine.build(scene, method, None if adaptive else span / _STEPS, **settings)
    before = simulation.state().omega
    if isinstance(simulation, Simulation):
        simulation.advance(_STEPS)
    else:
        simulation.advance_to(span)
    return (simulation.state().omega - before) / span


def _limit(values: list[FloatArray]) -> tuple[FloatArray, float]:
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


def model_error(engine: Engine, scene: Scene, method: str, settings: dict[str, float], seed: int) -> ModelError:
    """How far the engine's accelerations are from the equations', in random states of the scene's chain.

    Any angles, rates of the size of a swing. The engine's acceleration is the limit of its mean acceleration over a
    shrinking span, so it needs nothing but steps. Source: docs/measuring.md.
    """
    random = np.random.default_rng(seed)
    swing = math.sqrt((scene.effects.gravity or 9.81) / scene.total_length)
    worst, limit = 0.0, 0.0
    for _ in range(_STATES):
        theta = random.uniform(-math.pi, math.pi, scene.n)
        omega = random.normal(0.0, swing, scene.n)
        exact = accelerations(scene, theta, omega)
        size = float(np.abs(exact).max()) or 1.0
        start = scene.with_start(theta, omega)
        shortest = 0.02 / math.sqrt(size + swing**2)
        spans = [shortest * 2.0**-level for level in range(_LEVELS)]
        found, change = _limit([_mean_acceleration(engine, start, method, span, settings) for span in spans])
        error = float(np.abs(found - exact).max())
        worst = max(worst, error / size if math.isfinite(error) else math.inf)
        limit = max(limit, change / size)
    return ModelError(worst, limit)
