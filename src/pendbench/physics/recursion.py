"""The accelerations of the chain in O(n), from tip to pivot and back; under gravity without cancellation.

docs/equations.md derives it, and docs/effects.md says what other effects cost in digits.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from pendbench.arrays import FloatArray
from pendbench.compiled import compiled, inlined, specialise
from pendbench.errors import InputError
from pendbench.physics import acting, forces, laws, massive
from pendbench.physics.forces import FORCE_ACROSS, FORCE_ALONG
from pendbench.physics.system import RodSystem, System, system_of
from pendbench.physics.trigonometry import direction, write_bends
from pendbench.scene import Scene
from pendbench.solvers import problem
from pendbench.solvers.copying import copy

__all__ = ["accelerations", "inwards", "outwards", "system_of", "tensions", "write_accelerations"]

# The rows of a system's scratch. Outwards, each link's tension takes the place of the cosine it no longer needs.
_OWN, _PASSED, _ACROSS, _COSINE, _WHOLE, _HELD = range(6)
_TENSION = _COSINE

# The elimination's fractions are reduced where they have become large. A look at every fourth link will do: each link
# multiplies them by 1 + the ratio of two masses, and four of these make 1e200 at most, since masses end at 1e50.
_LOOK, _LARGE = 4, 1e20


@inlined
def inwards(system: System, t: float, theta: FloatArray, omega: FloatArray) -> tuple[float, float]:
    """Eliminate the chain from the tip to the pivot.

    Leaves in `system.scratch`, for each joint between rods i and i+1: the two parts of the mean
    `T_{i+1} = own_i + passed_i T_i`, and `across_i = sin / m_i`, with which T_{i+1} turns into the acceleration of mass
    i across rod i. Returns (alpha_1, beta_1), with which the tension in the first rod is `beta - alpha u.a'`.

    Where forces act on the masses, T is what is left of a rod's tension without the force along it on its own mass,
    and `held_i / m_i` the acceleration across the rod but for T_i (docs/equations.md, (E44)).
    """
    masses, lengths, ratios = system.masses, system.lengths, system.ratios
    scratch = system.scratch
    forced = len(system.joints) + len(system.drags) > 0
    write_bends(theta, scratch, _COSINE, _ACROSS)
    tip = len(masses) - 1
    # (E31): each link's division would have to wait for that of the link before it, so none is made until the end.
    whole, loose, moving = 1.0, 1.0, lengths[tip] * omega[tip] ** 2
    if forced:
        forces.write_forces(system, t, theta, omega, _COSINE, _ACROSS)
        scratch[_HELD, tip] = scratch[FORCE_ACROSS, tip]
    for last in range(tip, 0, -_LOOK):
        for i in range(last - 1, max(last - _LOOK, 0) - 1, -1):
            c, s = scratch[_COSINE, i], scratch[_ACROSS, i]
            scratch[_OWN, i], scratch[_PASSED, i] = masses[i] * moving, c * whole
            scratch[_ACROSS, i] = s * system.inverse_masses[i]
            heavier = ratios[i] * loose
            if forced:
                outer, across = scratch[FORCE_ALONG, i + 1], scratch[FORCE_ACROSS, i]
                scratch[_HELD, i] = s * (scratch[_OWN, i] + heavier * outer) + across * (c * c * whole + heavier)
                scratch[_OWN, i] -= whole * (outer + s * across)
                moving = moving + outer * loose * system.inverse_masses[i + 1]
                moving = moving - s * whole * across * system.inverse_masses[i]
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
        if forced:
            scratch[_HELD, i] *= share
    scratch[_OWN, tip], scratch[_PASSED, tip], scratch[_ACROSS, tip] = 0.0, 0.0, 0.0
    jerked = masses[0] / loose
    return jerked * whole, jerked * moving


@inlined
def outwards(system: System, t: float, theta: FloatArray, alpha: float, beta: float, out: FloatArray) -> None:
    """Carry the first rod's tension to the tip; write theta'' (n,) into `out`, and leave T (n,) in `system.scratch[3]`.

    Takes what `inwards` returned and left behind. Tensions, not accelerations, are carried: each is a mean of two with
    positive weights (but for the cosine), so a light mass between heavy ones costs no digits.
    """
    lengths, scratch = system.lengths, system.scratch
    forced = len(system.joints) + len(system.drags) > 0
    c, s = direction(theta[0])
    tension = beta + alpha * system.gravity * c
    start = system.gravity * s  # how the inner end of the rod accelerates across it
    if len(system.frames) > 0:
        x, y = laws.pivot_acceleration(system.frames, t)
        tension = tension + alpha * (c * y - s * x)
        start = start + (c * x + s * y)
    for i in range(len(lengths)):
        c = scratch[_COSINE, i]
        scratch[_TENSION, i] = tension
        following = scratch[_OWN, i] + scratch[_PASSED, i] * tension
        if forced:
            inverse = system.inverse_masses[i]
            end = scratch[_HELD, i] * inverse + scratch[_ACROSS, i] * (scratch[_PASSED, i] * tension)
            out[i] = (end - start) / lengths[i]
            start = scratch[_ACROSS, i] * tension + c * scratch[FORCE_ACROSS, i] * inverse
        else:
            out[i] = (scratch[_ACROSS, i] * following - start) / lengths[i]
            start = scratch[_ACROSS, i] * tension
        tension = following


@inlined
def write_accelerations(system: System, t: float, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write theta'' (n,) rad/s^2 at time t s, theta (n,) rad, omega (n,) rad/s into `out`."""
    alpha, beta = inwards(system, t, theta, omega)
    outwards(system, t, theta, alpha, beta, out)


@inlined
def _write_derivative(system: System, t: float, y: FloatArray, dy: FloatArray) -> None:
    n = len(system.masses)
    copy(y[n:], dy)
    write_accelerations(system, t, y[:n], y[n:], dy[n:])


@inlined
def _write_massive_derivative(system: RodSystem, t: float, y: FloatArray, dy: FloatArray) -> None:
    n = len(system.masses)
    copy(y[n:], dy)
    massive.write_accelerations(system, t, y[:n], y[n:], dy[n:])


specialise(problem.acceleration, System, write_accelerations)
specialise(problem.derivative, System, _write_derivative)
specialise(problem.acceleration, RodSystem, massive.write_accelerations)
specialise(problem.derivative, RodSystem, _write_massive_derivative)


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
    `accelerations`, which get their values from these. Raises InputError where rods have mass too: their tension is not
    the same all along.
    """
    if np.any(acting.rods(scene)):
        raise InputError("rods have mass; allowed: massless rods, whose tension is the same all along")
    system, _ = _solved(scene, theta, omega, t)
    return np.asarray(
        system.scratch[_TENSION] + (system.scratch[FORCE_ALONG] if system.joints or system.drags else 0.0)
    )


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
