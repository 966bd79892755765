"""The chain in canonical variables, angles and momenta, each in O(n): what symplectic methods need."""

from __future__ import annotations

from typing import Any

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.physics.kernels import laws
from pendbench.physics.kernels.scratch import CARRIED, COSINE, PUSHED, SINE, SPEED_X, SPEED_Y
from pendbench.physics.kernels.system import LinkSystem, System
from pendbench.solvers.trigonometry import write_bends, write_directions


@inlined
def _write_speeds(system: Any, theta: FloatArray, omega: FloatArray) -> None:
    """Leave the rods' directions and the masses' velocities in the scratch."""
    lengths, scratch = system.lengths, system.scratch
    write_directions(theta, scratch[COSINE], scratch[SINE])
    x, y = 0.0, 0.0
    for i in range(len(lengths)):
        speed = lengths[i] * omega[i]
        x += speed * scratch[COSINE, i]
        y += speed * scratch[SINE, i]
        scratch[SPEED_X, i], scratch[SPEED_Y, i] = x, y


@inlined
def write_momenta(system: Any, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write p = C(theta) omega (n,) kg m^2/s into `out`: the momentum of the masses outside each rod, across it."""
    masses, lengths, scratch = system.masses, system.lengths, system.scratch
    _write_speeds(system, theta, omega)
    x, y = 0.0, 0.0
    for i in range(len(masses) - 1, -1, -1):
        x += masses[i] * scratch[SPEED_X, i]
        y += masses[i] * scratch[SPEED_Y, i]
        out[i] = lengths[i] * (scratch[COSINE, i] * x + scratch[SINE, i] * y)


@inlined
def write_forces(system: Any, t: float, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write dL/dtheta (n,) N m into `out`, and what effects without a Lagrangian do.

    dL/dtheta is minus the outer momentum along each moving rod, and the weight's torque.
    """
    masses, lengths, scratch = system.masses, system.lengths, system.scratch
    _write_speeds(system, theta, omega)
    x, y, hanging = 0.0, 0.0, 0.0
    for i in range(len(masses) - 1, -1, -1):
        x += masses[i] * scratch[SPEED_X, i]
        y += masses[i] * scratch[SPEED_Y, i]
        hanging += masses[i]
        s, c = scratch[SINE, i], scratch[COSINE, i]
        out[i] = -lengths[i] * (omega[i] * (s * x - c * y) + hanging * system.gravity * s)
    if len(system.pivots) + len(system.joints) + len(system.drags) > 0:
        _add_effects(system, t, theta, omega, out)


@inlined
def _add_effects(system: Any, t: float, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Add what effects other than gravity do; the scratch holds the rods' directions and the masses' velocities."""
    masses, lengths, scratch = system.masses, system.lengths, system.scratch
    air_x, air_y = laws.pivot_velocity(system.pivots, t)
    shaken_x, shaken_y = laws.pivot_acceleration(system.pivots, t)
    drives = laws.drives(system.joints, t)
    x, y, outer = 0.0, 0.0, 0.0
    for i in range(len(masses) - 1, -1, -1):
        drag_x, drag_y = laws.drag(system.drags, i, scratch[SPEED_X, i] + air_x, scratch[SPEED_Y, i] + air_y)
        x += drag_x - masses[i] * shaken_x
        y += drag_y - masses[i] * shaken_y
        bend, rate = theta[i], omega[i]
        if i > 0:
            bend, rate = bend - theta[i - 1], rate - omega[i - 1]
        torque = laws.joint_torque(system.joints, drives, i, bend, rate)
        out[i] += torque - outer + lengths[i] * (scratch[COSINE, i] * x + scratch[SINE, i] * y)
        outer = torque


@inlined
def write_massive_momenta(system: LinkSystem, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """The same where links have a mass along them."""
    write_momenta(system, theta, omega, out)
    for i in range(len(out)):
        out[i] += system.inertias[i] * omega[i]


@inlined
def write_rates(system: System, theta: FloatArray, momenta: FloatArray, out: FloatArray) -> None:
    """Write omega = C(theta)^-1 p (n,) rad/s into `out`.

    The recursion for a chain at rest, without weight, under torques p: a torque on a rod is a pair of forces across
    it at its ends (docs/equations.md).
    """
    masses, lengths, scratch = system.masses, system.lengths, system.scratch
    write_bends(theta, scratch, COSINE, SINE)
    tip = len(masses) - 1
    alpha, beta = masses[tip], 0.0
    outer = momenta[tip] / lengths[tip]
    scratch[COSINE, tip], scratch[SINE, tip] = 1.0, 0.0
    scratch[PUSHED, tip], scratch[CARRIED, tip] = outer / masses[tip], 0.0
    for i in range(tip - 1, -1, -1):
        m = masses[i]
        c, s = scratch[COSINE, i], scratch[SINE, i]
        inverse = 1.0 / (m + alpha * s * s)
        own = momenta[i] / lengths[i]
        across = own - c * outer
        passed = s * c * alpha * inverse
        scratch[PUSHED, i] = (across + s * beta) * inverse
        scratch[CARRIED, i] = passed
        beta = m * c * beta * inverse + s * outer - passed * across
        alpha = m * (m + alpha) * inverse
        outer = own
    radial, transverse = 0.0, 0.0
    for i in range(tip + 1):
        q = scratch[PUSHED, i] - scratch[CARRIED, i] * radial
        out[i] = (q - transverse) / lengths[i]
        c, s = scratch[COSINE, i], scratch[SINE, i]
        radial, transverse = c * radial + s * q, c * q - s * radial
