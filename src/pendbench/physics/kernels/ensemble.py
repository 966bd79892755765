"""The recursion for many chains at once, alike but for their states: the innermost loops run over the chains.

One chain's links wait for each other, and so does each step of its arithmetic. Different chains do not, so a
processor's vector units work on several of them in the time of one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.physics.acting import check_plain
from pendbench.scene.scene import Scene
from pendbench.solvers.copying import copy_rows
from pendbench.solvers.trigonometry import FAR, cosine_sine, direction, rounded_bend


class EnsembleSystem(NamedTuple):
    """Chains that differ in their states alone, `lanes` of them side by side.

    masses, inverse_masses, lengths, inverse_lengths (n,); ratios (n - 1,) of each mass to the next; gravity m/s^2;
    own, cosine, sine (n, lanes) and room (4, lanes): room for the recursion. One thread, one system.
    """

    masses: FloatArray
    inverse_masses: FloatArray
    lengths: FloatArray
    inverse_lengths: FloatArray
    ratios: FloatArray
    gravity: float
    own: FloatArray
    cosine: FloatArray
    sine: FloatArray
    room: FloatArray


def ensemble_system_of(scene: Scene, lanes: int) -> EnsembleSystem:
    """The scene's chain and effects, ready for the kernels, `lanes` states at a time.

    Raises InputError where more than gravity acts.
    """
    check_plain(scene, "an ensemble")
    gravity = scene.effects.gravity
    return EnsembleSystem(
        masses=np.array(scene.masses),
        inverse_masses=1.0 / scene.masses,
        lengths=np.array(scene.lengths),
        inverse_lengths=1.0 / scene.lengths,
        ratios=scene.masses[:-1] / scene.masses[1:],
        gravity=0.0 if gravity is None else float(gravity),
        own=np.empty((scene.n, lanes)),
        cosine=np.empty((scene.n, lanes)),
        sine=np.empty((scene.n, lanes)),
        room=np.empty((4, lanes)),
    )


@inlined
def _write_bends(inner: FloatArray, outer: FloatArray, cosine: FloatArray, sine: FloatArray) -> None:
    """Cosine and sine of outer - inner, each (lanes,)."""
    far = 0
    for b in range(len(cosine)):
        bend, lost = rounded_bend(inner[b], outer[b])
        cosine[b], sine[b] = cosine_sine(bend, lost)
        far += int(not abs(bend) <= FAR)
    if far:
        for b in range(len(cosine)):
            bend, lost = rounded_bend(inner[b], outer[b])
            c, s = direction(bend)
            cosine[b], sine[b] = c - s * lost, s + c * lost


@inlined
def _fold(
    rate: FloatArray,
    mass: float,
    inverse_mass: float,
    ratio: float,
    length: float,
    own: FloatArray,
    cosine: FloatArray,
    sine: FloatArray,
    loose: FloatArray,
    moving: FloatArray,
) -> None:
    """Eliminate one link of each chain, (E32) and (E33): leaves own, and in place of the cosine passed, of the mean
    T_{i+1} = own + passed T_i.
    """
    for b in range(len(rate)):
        heavier = ratio * loose[b]
        share = 1.0 / (1.0 + heavier)
        passed = cosine[b] * share
        own[b] = mass * moving[b] * share
        loose[b] = (heavier + sine[b] * sine[b]) * share
        moving[b] = passed * moving[b] + length * rate[b] * rate[b]
        cosine[b] = passed
        sine[b] = sine[b] * inverse_mass


@inlined
def _first_rod(
    theta: FloatArray,
    gravity: float,
    mass: float,
    loose: FloatArray,
    moving: FloatArray,
    tension: FloatArray,
    start: FloatArray,
) -> None:
    far = 0
    for b in range(len(theta)):
        c, s = cosine_sine(theta[b], 0.0)
        tension[b] = mass * (moving[b] + gravity * c) / loose[b]
        start[b] = gravity * s
        far += int(not abs(theta[b]) <= FAR)
    if far:
        for b in range(len(theta)):
            c, s = direction(theta[b])
            tension[b] = mass * (moving[b] + gravity * c) / loose[b]
            start[b] = gravity * s


@inlined
def _carry_on(
    own: FloatArray,
    passed: FloatArray,
    across: FloatArray,
    tension: FloatArray,
    start: FloatArray,
    inverse: float,
    out: FloatArray,
) -> None:
    """One link outwards: its angular acceleration, and the next rod's tension."""
    for b in range(len(out)):
        following = own[b] + passed[b] * tension[b]
        out[b] = (across[b] * following - start[b]) * inverse
        start[b] = across[b] * tension[b]
        tension[b] = following


@inlined
def write_ensemble_accelerations(s: EnsembleSystem, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write theta'' (n, lanes) rad/s^2 at theta, omega (n, lanes) into `out`. docs/equations.md, (E32), (E33)."""
    loose, moving, tension, start = s.room[0], s.room[1], s.room[2], s.room[3]
    tip = len(s.masses) - 1
    for b in range(len(loose)):
        loose[b], moving[b] = 1.0, s.lengths[tip] * omega[tip, b] * omega[tip, b]
    for i in range(tip - 1, -1, -1):
        _write_bends(theta[i], theta[i + 1], s.cosine[i], s.sine[i])
        mass, inverse_mass, ratio, length = s.masses[i], s.inverse_masses[i], s.ratios[i], s.lengths[i]
        _fold(omega[i], mass, inverse_mass, ratio, length, s.own[i], s.cosine[i], s.sine[i], loose, moving)
    _first_rod(theta[0], s.gravity, s.masses[0], loose, moving, tension, start)
    for i in range(tip):
        _carry_on(s.own[i], s.cosine[i], s.sine[i], tension, start, s.inverse_lengths[i], out[i])
    for b in range(len(start)):
        out[tip, b] = -start[b] * s.inverse_lengths[tip]


@inlined
def write_derivatives(s: EnsembleSystem, y: FloatArray, dy: FloatArray) -> None:
    """Write the rates and their accelerations (2 n, lanes) at y = theta, omega (2 n, lanes) into dy."""
    n = len(s.masses)
    copy_rows(y[n:], dy[:n])
    write_ensemble_accelerations(s, y[:n], y[n:], dy[n:])
