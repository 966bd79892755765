"""The chain in canonical variables, angles and momenta, each in O(n): what symplectic methods need."""

from __future__ import annotations

import math

from pendbench.arrays import FloatArray
from pendbench.compiled import inlined, specialise
from pendbench.physics.system import System
from pendbench.solvers import problem


@inlined
def write_momenta(system: System, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write p = C(theta) omega (n,) kg m^2/s into `out`: the momentum of the masses outside each rod, across it."""
    masses, lengths = system.masses, system.lengths
    vx, vy = system.scratch[0], system.scratch[1]
    x, y = 0.0, 0.0
    for i in range(len(masses)):
        speed = lengths[i] * omega[i]
        x += speed * math.cos(theta[i])
        y += speed * math.sin(theta[i])
        vx[i], vy[i] = x, y
    x, y = 0.0, 0.0
    for i in range(len(masses) - 1, -1, -1):
        x += masses[i] * vx[i]
        y += masses[i] * vy[i]
        out[i] = lengths[i] * (math.cos(theta[i]) * x + math.sin(theta[i]) * y)


@inlined
def write_forces(system: System, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write dL/dtheta (n,) N m into `out`: minus the outer momentum along each moving rod, and the weight's torque."""
    masses, lengths = system.masses, system.lengths
    vx, vy = system.scratch[0], system.scratch[1]
    x, y = 0.0, 0.0
    for i in range(len(masses)):
        speed = lengths[i] * omega[i]
        x += speed * math.cos(theta[i])
        y += speed * math.sin(theta[i])
        vx[i], vy[i] = x, y
    x, y, hanging = 0.0, 0.0, 0.0
    for i in range(len(masses) - 1, -1, -1):
        x += masses[i] * vx[i]
        y += masses[i] * vy[i]
        hanging += masses[i]
        s, c = math.sin(theta[i]), math.cos(theta[i])
        out[i] = -lengths[i] * (omega[i] * (s * x - c * y) + hanging * system.gravity * s)


@inlined
def write_rates(system: System, theta: FloatArray, momenta: FloatArray, out: FloatArray) -> None:
    """Write omega = C(theta)^-1 p (n,) rad/s into `out`.

    The recursion for a chain at rest, without weight, under torques p: a torque on a rod is a pair of forces across
    it at its ends (docs/equations.md).
    """
    masses, lengths = system.masses, system.lengths
    cosine, sine, p, k = system.scratch[0], system.scratch[1], system.scratch[2], system.scratch[3]
    tip = len(masses) - 1
    alpha, beta = masses[tip], 0.0
    outer = momenta[tip] / lengths[tip]
    cosine[tip], sine[tip], p[tip], k[tip] = 1.0, 0.0, outer / masses[tip], 0.0
    for i in range(tip - 1, -1, -1):
        m = masses[i]
        bend = theta[i + 1] - theta[i]
        c, s = math.cos(bend), math.sin(bend)
        inverse = 1.0 / (m + alpha * s * s)
        own = momenta[i] / lengths[i]
        across = own - c * outer
        cosine[i], sine[i] = c, s
        p[i] = (across + s * beta) * inverse
        k[i] = s * c * alpha * inverse
        beta = m * c * beta * inverse + s * outer - k[i] * across
        alpha = m * (m + alpha) * inverse
        outer = own
    radial, transverse = 0.0, 0.0
    for i in range(tip + 1):
        q = p[i] - k[i] * radial
        out[i] = (q - transverse) / lengths[i]
        c, s = cosine[i], sine[i]
        radial, transverse = c * radial + s * q, c * q - s * radial


@inlined
def _write_force(system: System, t: float, q: FloatArray, v: FloatArray, f: FloatArray) -> None:  # noqa: ARG001
    write_forces(system, q, v, f)


specialise(problem.momentum, System, write_momenta)
specialise(problem.velocity, System, write_rates)
specialise(problem.generalized_force, System, _write_force)
