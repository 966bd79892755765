"""The accelerations of the chain in O(n), from tip to pivot and back, without cancellation (docs/equations.md)."""

from __future__ import annotations

import math

import numpy as np

from pendbench.compiled import compiled, specialise
from pendbench.physics.system import System
from pendbench.scene import Scene
from pendbench.solvers import problem
from pendbench.trajectory import FloatArray


@compiled
def inwards(system: System, theta: FloatArray, omega: FloatArray) -> tuple[float, float]:
    """Eliminate the chain from the tip to the pivot.

    Leaves in `system.scratch`, for each joint between rods i and i+1: cos and sin of their angle, and the p and k of
    `q_i = p_i - k_i r_i`. Returns (alpha_1, beta_1), with which the tension in the first rod is `beta - alpha u.a'`.
    """
    masses, lengths = system.masses, system.lengths
    cosine, sine, p, k = system.scratch[0], system.scratch[1], system.scratch[2], system.scratch[3]
    tip = len(masses) - 1
    cosine[tip], sine[tip], p[tip], k[tip] = 1.0, 0.0, 0.0, 0.0
    alpha = masses[tip]
    beta = alpha * lengths[tip] * omega[tip] ** 2
    for i in range(tip - 1, -1, -1):
        m = masses[i]
        bend = theta[i + 1] - theta[i]
        c, s = math.cos(bend), math.sin(bend)
        inverse = 1.0 / (m + alpha * s * s)
        cosine[i], sine[i] = c, s
        p[i] = s * beta * inverse
        k[i] = s * c * alpha * inverse
        beta *= m * c * inverse
        alpha = m * (m + alpha) * inverse
        beta += alpha * lengths[i] * omega[i] ** 2
    return alpha, beta


@compiled
def outwards(system: System, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Carry the pivot's acceleration to the tip; write theta'' (n,) into `out`. Needs `inwards` before it."""
    lengths = system.lengths
    cosine, sine, p, k = system.scratch[0], system.scratch[1], system.scratch[2], system.scratch[3]
    radial = -system.gravity * math.cos(theta[0])
    transverse = system.gravity * math.sin(theta[0])
    for i in range(len(lengths)):
        radial -= lengths[i] * omega[i] ** 2
        q = p[i] - k[i] * radial
        out[i] = (q - transverse) / lengths[i]
        c, s = cosine[i], sine[i]
        radial, transverse = c * radial + s * q, c * q - s * radial


@compiled
def write_accelerations(system: System, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write theta'' (n,) rad/s^2 at theta (n,) rad, omega (n,) rad/s into `out`."""
    inwards(system, theta, omega)
    outwards(system, theta, omega, out)


@compiled
def _write_acceleration(system: System, t: float, q: FloatArray, v: FloatArray, a: FloatArray) -> None:  # noqa: ARG001
    write_accelerations(system, q, v, a)


@compiled
def _write_derivative(system: System, t: float, y: FloatArray, dy: FloatArray) -> None:  # noqa: ARG001
    n = len(system.masses)
    dy[:n] = y[n:]
    write_accelerations(system, y[:n], y[n:], dy[n:])


specialise(problem.acceleration, System, _write_acceleration)
specialise(problem.derivative, System, _write_derivative)


def system_of(scene: Scene) -> System:
    """The scene's chain and effects, ready for the kernels."""
    gravity = scene.effects.gravity
    return System(
        masses=np.array(scene.masses),
        lengths=np.array(scene.lengths),
        gravity=0.0 if gravity is None else float(gravity),
        scratch=np.empty((4, scene.n)),
    )


def accelerations(scene: Scene, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """theta'' (n,) rad/s^2 at theta (n,) rad and omega (n,) rad/s, in O(n).

    Source: docs/equations.md, the recursion; the same system as `dense.accelerations`.
    """
    out = np.empty(scene.n)
    write_accelerations(system_of(scene), np.asarray(theta, float), np.asarray(omega, float), out)
    return out


def tensions(scene: Scene, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """The tension (n,) N in each rod at theta (n,) rad, omega (n,) rad/s; negative where the rod is compressed.

    Newton's law on the masses from the tip inwards, with the recursion's accelerations: along rod i,
    `T_i = T_{i+1} cos(theta_{i+1} - theta_i) - m_i u_i . a'_i` (docs/equations.md).
    """
    theta, omega = np.asarray(theta, float), np.asarray(omega, float)
    angular = accelerations(scene, theta, omega)
    along = np.stack([np.sin(theta), -np.cos(theta)], axis=-1)
    across = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    steps = scene.lengths[:, None] * (angular[:, None] * across - (omega**2)[:, None] * along)
    gravity = scene.effects.gravity or 0.0
    felt = np.cumsum(steps, axis=0) + np.array([0.0, gravity])
    pull = np.zeros(2)
    out = np.empty(scene.n)
    for i in range(scene.n - 1, -1, -1):
        pull = pull - scene.masses[i] * felt[i]
        out[i] = pull @ along[i]
    return out
