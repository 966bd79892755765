"""What all motions of a scene have in common, whatever their start: found by trying random states."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.physics import acting, dense
from pendbench.scene.scene import Scene

_STATES: Final = 16
_SEED: Final = 1
_ALIKE: Final = 1e-9


def has_mirror_images(scene: Scene) -> bool:
    """Whether the mirror image of every motion is one: a drive that pushes to a side ends that."""
    return all(
        np.allclose(dense.accelerations(scene, -theta, -omega, t), -dense.accelerations(scene, theta, omega, t), _ALIKE)
        for theta, omega, t in _states(scene)
    )


def only_loses_energy(scene: Scene) -> bool:
    """Whether no motion has ever more energy than at its start, all of it in weight and motion: nothing springs."""
    return all(
        float(acting.power(scene, t, theta, omega)) <= 0.0 and float(acting.joint_potential(scene, theta)) == 0.0
        for theta, omega, t in _states(scene)
    )


def _states(scene: Scene) -> list[tuple[FloatArray, FloatArray, float]]:
    """Angles and rates (n,), any of them, and times, s, over some swings."""
    rng, n = np.random.default_rng(_SEED), scene.n
    swing = math.sqrt((scene.effects.gravity or 1.0) / scene.total_length)
    return [
        (rng.uniform(-math.pi, math.pi, n), rng.normal(0.0, swing, n), rng.uniform(0.0, 10.0 / swing))
        for _ in range(_STATES)
    ]
