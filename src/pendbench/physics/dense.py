"""The equations of motion as matrices: easy to read and to check, O(n^3) to solve.

This is the statement of the note, with its misprints mended, and the oracle of the O(n) recursion. A solve of the
dense system loses digits where masses differ by many decades (equations.md, "Why not solve the dense system").
"""

from __future__ import annotations

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.physics import acting
from pendbench.scene.scene import Scene


class _Fixed(NamedTuple):
    """What depends on the scene alone: M_k l_k, (n,) kg m; M_max(i,j) l_i l_j, and what links and the rotors in their
    joints add to C, (n, n) kg m^2. equations.md (E7), (E53), (E55).
    """

    levers: FloatArray
    pairs: FloatArray
    own: FloatArray


_known: WeakKeyDictionary[Scene, _Fixed] = WeakKeyDictionary()


def hanging_masses(masses: FloatArray) -> FloatArray:
    """M_k, the mass that hangs from rod k: (n,) kg from masses (n,) kg. equations.md (E2)."""
    return np.cumsum(masses[::-1])[::-1]


def mass_matrix(scene: Scene, theta: FloatArray) -> FloatArray:
    """C(theta), (n, n) kg m^2, symmetric and positive definite. theta: (n,) rad. equations.md (E7), (E53), (E55)."""
    fixed = _fixed(scene)
    return np.asarray(fixed.pairs * np.cos(np.subtract.outer(theta, theta)) + fixed.own)


def coupling_matrix(scene: Scene, theta: FloatArray) -> FloatArray:
    """S(theta), (n, n) kg m^2, antisymmetric: what the squared rates of the other rods do to rod i.

    theta: (n,) rad. equations.md (E8); the note's (19) with its sign mended.
    """
    return _fixed(scene).pairs * -np.sin(np.subtract.outer(theta, theta))


def weight_torques(scene: Scene, theta: FloatArray, t: float = 0.0) -> FloatArray:
    """h(theta), (n,) N m: minus what gravity and a driven pivot do. theta: (n,) rad; t: s. equations.md (E9), (E37)."""
    x, y = acting.pivot_acceleration(scene, t)
    return np.asarray(_fixed(scene).levers * (y * np.sin(theta) + x * np.cos(theta)))


def accelerations(scene: Scene, theta: FloatArray, omega: FloatArray, t: float = 0.0) -> FloatArray:
    """Solve for theta'', (n,) rad/s^2: C theta'' = S omega^2 - h + Q. theta: (n,) rad, omega: (n,) rad/s, t: s.

    Raises numpy.linalg.LinAlgError where rounding has left C without its positive definiteness (masses that differ
    by many decades); what is not finite gives nan or that error. equations.md (E6), (E40); the note's (14), which has
    no Q.
    """
    from scipy.linalg.lapack import dposv  # a quarter of a second, and most processes never come here

    torques = coupling_matrix(scene, theta) @ omega**2 - weight_torques(scene, theta, t)
    torques += acting.generalized_forces(scene, t, theta, omega)
    _, solution, not_definite = dposv(mass_matrix(scene, theta), torques)
    if not_definite:
        raise np.linalg.LinAlgError(f"the leading {not_definite} rows of C are not positive definite")
    return np.asarray(solution)


def _fixed(scene: Scene) -> _Fixed:
    """Worked out once for each scene, as nothing should change one."""
    if (found := _known.get(scene)) is None:
        found = _known[scene] = _work_out(scene)
    return found


def _work_out(scene: Scene) -> _Fixed:
    hanging, index = hanging_masses(acting.lumped_masses(scene)), np.arange(scene.n)
    pairs = hanging[np.maximum.outer(index, index)] * np.outer(scene.lengths, scene.lengths)
    return _Fixed(hanging * scene.lengths, pairs, _own_inertias(scene))


def _own_inertias(scene: Scene) -> FloatArray:
    links, rotors = acting.link_inertias(scene), acting.rotor_inertias(scene)
    if not links.any() and not rotors.any():
        return np.broadcast_to(0.0, (scene.n, scene.n))
    bends = np.eye(scene.n) - np.eye(scene.n, k=-1)
    return np.asarray(np.diag(links) + bends.T @ (rotors[:, np.newaxis] * bends))
