"""Why an engine disagrees: does it simulate another system, or the same one inexactly?"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendbench.engines.accelerations import acceleration_at_start, careful
from pendbench.engines.protocol import Engine
from pendbench.physics.kernels.recursion import accelerations
from pendbench.scene.scene import Scene

_STATES = 4


class ModelError(NamedTuple):
    """error: the largest difference of accelerations, over the largest acceleration. limit: how well that is known."""

    error: float
    limit: float


def model_error(engine: Engine, scene: Scene, method: str, settings: dict[str, float], seed: int) -> ModelError:
    """How far the engine's accelerations are from the equations', in random states of the scene's chain.

    Any angles, rates of the size of a swing. The engine's acceleration is the limit of its mean acceleration over a
    shrinking span, so it needs nothing but steps. Source: docs/measuring.md.
    """
    settings = {**settings, **careful(engine.methods[method])}
    random = np.random.default_rng(seed)
    swing = math.sqrt((scene.effects.gravity or 9.81) / scene.total_length)
    worst, limit = 0.0, 0.0
    for _ in range(_STATES):
        theta = random.uniform(-math.pi, math.pi, scene.n)
        omega = random.normal(0.0, swing, scene.n)
        exact = accelerations(scene, theta, omega)
        size = float(np.abs(exact).max()) or 1.0
        start = scene.with_start(theta, omega)
        found, change = acceleration_at_start(engine, start, method, size + swing**2, settings)
        error = float(np.abs(found - exact).max())
        worst = max(worst, error / size if math.isfinite(error) else math.inf)
        limit = max(limit, change / size)
    return ModelError(worst, limit)
