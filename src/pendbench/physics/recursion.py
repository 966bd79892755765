"""The accelerations of the chain in O(n), from tip to pivot and back, without cancellation (docs/equations.md)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pendbench.arrays import FloatArray
from pendbench.compiled import inlined, specialise
from pendbench.errors import InputError
from pendbench.physics.system import System
from pendbench.physics.trigonometry import direction, write_bends
from pendbench.scene import Scene
from pendbench.solvers import problem
from pendbench.solvers.copying import copy

# The rows of a system's scratch. Outwards, each link's tension takes the place of the cosine it no longer needs.
_OWN, _PASSED, _ACROSS, _COSINE, _WHOLE = range(5)
_TENSION = _COSINE

# The elimination's fractions are reduced where they have become large. A look at every fourth link will do: each link
# multiplies them by 1 + the ratio of two masses, and four of these make 1e200 at most, since masses end at 1e50.
_LOOK, _LARGE = 4, 1e20


@inlined
def inwards(system: System, theta: FloatArray, omega: FloatArray) -> tuple[float, float]:
    """Eliminate the chain from the tip to the pivot.

    Leaves in `system.scratch`, for each joint between rods i and i+1: the two parts of the mean
    `T_{i+1} = own_i + passed_i T_i`, and `across_i = sin / m_i`, with which T_{i+1} turns into the acceleration of mass
    i across rod i. Returns (alpha_1, beta_1), with which the tension in the first rod is `beta - alpha u.a'`.
    """
    masses, lengths, ratios = system.masses, system.lengths, system.ratios
    scratch = system.scratch
    write_bends(theta, scratch, _COSINE, _ACROSS)
    tip = len(masses) - 1
    # (E31): each link's division would have to wait for that of the link before it, so none is made until the end.
    whole, loose, moving = 1.0, 1.0, lengths[tip] * omega[tip] ** 2
    for last in range(tip, 0, -_LOOK):
        for i in range(last - 1, max(last - _LOOK, 0) - 1, -1):
            c, s = scratch[_COSINE, i], scratch[_ACROSS, i]
            scratch[_OWN, i], scratch[_PASSED, i] = masses[i] * moving, c * whole
            scratch[_ACROSS, i] = s * system.inverse_masses[i]
            heavier = ratios[i] * loose
            loose = heavier + s * s * whole
            whole = whole + heavier
            moving = c * moving + lengths[i] * omega[i] ** 2 * whole
            scratch[_WHOLE, i] = whole
        if whole > _LARGE:
            share = 1.0 / whole
            whole, loose, moving = 1.0, loose * share, moving * share
    for i in range(tip):
        share = 1.0 / scratch[_WHOLE, i]
        scratch[_OWN, i] *= share
        scratch[_PASSED, i] *= share
    scratch[_OWN, tip], scratch[_PASSED, tip], scratch[_ACROSS, tip] = 0.0, 0.0, 0.0
    jerked = masses[0] / loose
    return jerked * whole, jerked * moving


@inlined
def outwards(system: System, theta: FloatArray, alpha: float, beta: float, out: FloatArray) -> None:
    """Carry the first rod's tension to the tip; write theta'' (n,) into `out`, and leave T (n,) in `system.scratch[3]`.

    Takes what `inwards` returned and left behind. Tensions, not accelerations, are carried: each is a mean of two with
    positive weights (but for the cosine), so a light mass between heavy ones costs no digits.
    """
    lengths, scratch = system.lengths, system.scratch
    c, s = direction(theta[0])
    tension = beta + alpha * system.gravity * c
    start = system.gravity * s  # how the inner end of the rod accelerates across it
    for i in range(len(lengths)):
        scratch[_TENSION, i] = tension
        following = scratch[_OWN, i] + scratch[_PASSED, i] * tension
        out[i] = (scratch[_ACROSS, i] * following - start) / lengths[i]
        start = scratch[_ACROSS, i] * tension
        tension = following


@inlined
def write_accelerations(system: System, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write theta'' (n,) rad/s^2 at theta (n,) rad, omega (n,) rad/s into `out`."""
    alpha, beta = inwards(system, theta, omega)
    outwards(system, theta, alpha, beta, out)


@inlined
def _write_acceleration(system: System, t: float, q: FloatArray, v: FloatArray, a: FloatArray) -> None:  # noqa: ARG001
    write_accelerations(system, q, v, a)


@inlined
def _write_derivative(system: System, t: float, y: FloatArray, dy: FloatArray) -> None:  # noqa: ARG001
    n = len(system.masses)
    copy(y[n:], dy)
    write_accelerations(system, y[:n], y[n:], dy[n:])


specialise(problem.acceleration, System, _write_acceleration)
specialise(problem.derivative, System, _write_derivative)


def system_of(scene: Scene) -> System:
    """The scene's chain and effects, ready for the kernels."""
    gravity = scene.effects.gravity
    return System(
        masses=np.array(scene.masses),
        lengths=np.array(scene.lengths),
        inverse_masses=1.0 / scene.masses,
        ratios=scene.masses[:-1] / scene.masses[1:],
        gravity=0.0 if gravity is None else float(gravity),
        scratch=np.empty((5, scene.n)),
    )


def accelerations(scene: Scene, theta: npt.ArrayLike, omega: npt.ArrayLike) -> FloatArray:
    """The angular accelerations theta'' (n,) rad/s^2 at theta (n,) rad and omega (n,) rad/s, in O(n).

    Source: docs/equations.md, the recursion; the same system as `dense.accelerations`. Raises InputError where theta or
    omega does not have one number for each link.
    """
    return _solved(scene, theta, omega)[0]


def tensions(scene: Scene, theta: npt.ArrayLike, omega: npt.ArrayLike) -> FloatArray:
    """The tension (n,) N in each rod at theta (n,) rad, omega (n,) rad/s; negative where the rod is compressed.

    Source and errors as for `accelerations`, which get their values from these.
    """
    return _solved(scene, theta, omega)[1]


def _solved(scene: Scene, theta: npt.ArrayLike, omega: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    system, out = system_of(scene), np.empty(scene.n)
    write_accelerations(system, _each_link("theta", theta, scene.n), _each_link("omega", omega, scene.n), out)
    return out, system.scratch[3]


def _each_link(name: str, values: npt.ArrayLike, n: int) -> FloatArray:
    """The values as a new array: kernels check no bounds, and are compiled for one layout of memory."""
    array = np.array(values, dtype=np.float64, order="C")
    if array.shape != (n,):
        raise InputError(f"{name} has shape {array.shape}; allowed: ({n},), one number for each link")
    return array
