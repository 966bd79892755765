"""The equations of motion as matrices: easy to read and to check, O(n^3) to solve.

This is the statement of the note, with its misprints mended, and the oracle of the O(n) recursion. A solve of the
dense system loses digits where masses differ by many decades (equations.md, "Why not solve the dense system").
"""

from __future__ import annotations

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.physics import acting
from pendbench.scene.scene import Scene


def hanging_masses(masses: FloatArray) -> FloatArray:
    """M_k, the mass that hangs from rod k: (n,) kg from masses (n,) kg. equations.md (E2)."""
    return np.cumsum(masses[::-1])[::-1]


def mass_matrix(scene: Scene, theta: FloatArray) -> FloatArray:
    """C(theta), (n, n) kg m^2, symmetric and positive definite. theta: (n,) rad. equations.md (E7), (E53), (E55)."""
    return np.asarray(_pair_inertias(scene) * np.cos(np.subtract.outer(theta, theta)) + _own_inertias(scene))


def coupling_matrix(scene: Scene, theta: FloatArray) -> FloatArray:
    """S(theta), (n, n) kg m^2, antisymmetric: what the squared rates of the other rods do to rod i.

    theta: (n,) rad. equations.md (E8); the note's (19) with its sign mended.
    """
    return _pair_inertias(scene) * -np.sin(np.subtract.outer(theta, theta))


def weight_torques(scene: Scene, theta: FloatArray, t: float = 0.0) -> FloatArray:
    """h(theta), (n,) N m: minus what gravity and a driven pivot do. theta: (n,) rad; t: s. equations.md (E9), (E37)."""
    x, y = acting.pivot_acceleration(scene, t)
    torques = hanging_masses(acting.lumped_masses(scene)) * scene.lengths
    return np.asarray(torques * (y * np.sin(theta) + x * np.cos(theta)))


def accelerations(scene: Scene, theta: FloatArray, omega: FloatArray, t: float = 0.0) -> FloatArray:
    """Solve for theta'', (n,) rad/s^2: C theta'' = S omega^2 - h + Q. theta: (n,) rad, omega: (n,) rad/s, t: s.

    Raises scipy.linalg.LinAlgError where rounding has left C without its positive definiteness (masses that differ
    by many decades). equations.md (E6), (E40); the note's (14), which has no Q.
    """
    from scipy.linalg import cho_factor, cho_solve  # a quarter of a second, and most processes never come here

    torques = coupling_matrix(scene, theta) @ omega**2 - weight_torques(scene, theta, t)
    torques += acting.generalized_forces(scene, t, theta, omega)
    return np.asarray(cho_solve(cho_factor(mass_matrix(scene, theta)), torques))


@acting.once_a_scene
def _pair_inertias(scene: Scene) -> FloatArray:
    """M_max(i,j) l_i l_j, (n, n)."""
    hanging, links = hanging_masses(acting.lumped_masses(scene)), np.arange(scene.n)
    return np.asarray(hanging[np.maximum.outer(links, links)] * np.outer(scene.lengths, scene.lengths))


@acting.once_a_scene
def _own_inertias(scene: Scene) -> FloatArray:
    """What the links themselves and the rotors in the joints add to C, (n, n) kg m^2. equations.md (E53), (E55)."""
    bends = np.eye(scene.n) - np.eye(scene.n, k=-1)
    rotors = bends.T @ (acting.rotor_inertias(scene)[:, np.newaxis] * bends)
    return np.asarray(np.diag(acting.link_inertias(scene)) + rotors)
