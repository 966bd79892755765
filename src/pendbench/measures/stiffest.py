"""The fastest small oscillation of a chain: what limits the steps of many methods."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.physics import acting, dense
from pendbench.physics.exact import normal_modes
from pendbench.scene.scene import Scene

_APART: Final = 1e-4  # rad, of a central difference


def stiffest(scene: Scene) -> float:
    """The fastest small oscillation about the hanging chain, rad/s, without what damps or drives.

    nan where nothing pulls the chain back, so that there is none.
    """
    if acting.is_plain(scene):
        return float(normal_modes(scene)[0][-1]) if scene.effects.gravity else math.nan
    from scipy.linalg import eigh

    largest = float(eigh(_stiffness(scene), dense.mass_matrix(scene, np.zeros(scene.n)), eigvals_only=True)[-1])
    return math.sqrt(largest) if largest > 0.0 else math.nan


def _stiffness(scene: Scene) -> FloatArray:
    """How the torques of weight and springs change with the angles about the hanging chain, (n, n) N m/rad."""
    still = np.zeros(scene.n)

    def pull(theta: FloatArray) -> FloatArray:
        return dense.weight_torques(scene, theta) - acting.generalized_forces(scene, 0.0, theta, still)

    changes = np.array([pull(row) - pull(-row) for row in _APART * np.eye(scene.n)]) / (2.0 * _APART)
    return np.asarray(0.5 * (changes + changes.T))
