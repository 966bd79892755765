"""The accelerations of a scene's chain, and its rods' tensions, by the recursions in O(n)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled
from pendbench.base.errors import InputError
from pendbench.physics import acting
from pendbench.physics.kernels.scratch import FORCE_ALONG, TENSION
from pendbench.physics.kernels.table import system_of
from pendbench.scene.scene import Scene
from pendbench.solvers import problem


@compiled
def _accelerations(system: Any, t: float, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    problem.acceleration(system, t, theta, omega, out)


def accelerations(scene: Scene, theta: npt.ArrayLike, omega: npt.ArrayLike, t: float = 0.0) -> FloatArray:
    """The angular accelerations theta'' (n,) rad/s^2 at theta (n,) rad, omega (n,) rad/s and t s, in O(n).

    Source: docs/equations.md, the recursion; the same system as `dense.accelerations`. Raises InputError where theta or
    omega does not have one number for each link.
    """
    return _solved(scene, theta, omega, t)[1]


def tensions(scene: Scene, theta: npt.ArrayLike, omega: npt.ArrayLike, t: float = 0.0) -> FloatArray:
    """The tension (n,) N in each rod at theta (n,) rad, omega (n,) rad/s; negative where the rod is compressed.

    A joint's torque counts as the pair of forces that does the same (docs/equations.md). Source and errors as for
    `accelerations`, which get their values from these. Raises InputError where rods have mass too, since their tension
    is not the same all along, and where joints have rotors.
    """
    if acting.has_links(scene):
        raise InputError("rods have mass; allowed: massless rods, whose tension is the same all along")
    if acting.rotor_inertias(scene).any():
        raise InputError("joints have rotors; allowed: joints without, whose torque does not depend on what it causes")
    system, _ = _solved(scene, theta, omega, t)
    return np.asarray(system.scratch[TENSION] + (system.scratch[FORCE_ALONG] if system.joints or system.drags else 0.0))


def _solved(scene: Scene, theta: npt.ArrayLike, omega: npt.ArrayLike, t: float) -> tuple[Any, FloatArray]:
    system, out = system_of(scene), np.empty(scene.n)
    angles, rates = _each_link("theta", theta, scene.n), _each_link("omega", omega, scene.n)
    _accelerations(system, float(t), angles, rates, out)
    return system, out


def _each_link(name: str, values: npt.ArrayLike, n: int) -> FloatArray:
    """The values as a new array: kernels check no bounds, and are compiled for one layout of memory."""
    array = np.array(values, dtype=np.float64, order="C")
    if array.shape != (n,):
        raise InputError(f"{name} has shape {array.shape}; allowed: ({n},), one number for each link")
    return array
