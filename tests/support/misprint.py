"""Equation (19) of the note as it is printed: the wrong sign where i >= j. A negative control, never to be used."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from pendbench.base.arrays import FloatArray
from pendbench.physics import dense
from pendbench.scene.scene import Scene


def coupling_matrix_as_printed(scene: Scene, theta: FloatArray) -> FloatArray:
    """The printed S, (n, n) kg m^2: right above the diagonal, of the wrong sign below it, and so symmetric."""
    right = dense.coupling_matrix(scene, theta)
    return np.triu(right) - np.tril(right)


def accelerations_as_printed(scene: Scene, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """theta'' (n,) rad/s^2 of the misprinted system. theta: (n,) rad, omega: (n,) rad/s."""  # noqa: D403
    torques = coupling_matrix_as_printed(scene, theta) @ omega**2 - dense.weight_torques(scene, theta)
    return np.asarray(cho_solve(cho_factor(dense.mass_matrix(scene, theta)), torques))
