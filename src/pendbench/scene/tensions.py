"""How hard the links of a run pull: Newton's second law for all that hangs on a joint, together."""

from __future__ import annotations

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.physics import acting
from pendbench.physics.kernels import recursion
from pendbench.scene.scene import Scene


def tensions(scene: Scene, t: FloatArray, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """How hard each link is pulled at its joint, along itself, (k, n) N; negative where it is pushed.

    t: (k,) s; theta, omega: (k, n) rad, rad/s. On massless rods this is the rod's tension, from the recursion, the same
    all along. equations.md (E20).
    """
    states = [(theta[j], omega[j], float(t[j])) for j in range(len(t))]
    if not acting.has_links(scene):
        return np.array([recursion.tensions(scene, *state) for state in states]).reshape(theta.shape)
    angular = np.array([recursion.accelerations(scene, *state) for state in states]).reshape(theta.shape)
    along = np.stack([np.sin(theta), -np.cos(theta)], axis=-1)
    across = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    whirl = (omega**2)[..., np.newaxis] * along
    rods = scene.lengths[:, np.newaxis] * (angular[..., np.newaxis] * across - whirl)
    ends = np.cumsum(rods, axis=1) + acting.pivot_acceleration(scene, t)[:, np.newaxis]
    its = acting.links(scene)
    centres = ends + (its.centre / scene.lengths - 1.0)[:, np.newaxis] * rods
    needed = scene.masses[:, np.newaxis] * ends + its.mass[:, np.newaxis] * centres
    needed = needed - acting.drag_forces(scene, t, theta, omega)
    return np.asarray(-np.sum(along * np.cumsum(needed[:, ::-1], axis=1)[:, ::-1], axis=-1))
