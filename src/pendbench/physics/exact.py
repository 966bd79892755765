"""What is known in closed form: the single pendulum at any amplitude, and small oscillations of any chain."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ellipj, ellipkm1, elliprf

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.physics.acting import check_plain
from pendbench.physics.dense import hanging_masses
from pendbench.physics.geometry import TURN
from pendbench.scene.scene import Scene

# scipy's am(u) is off by 2e-9 rad at worst (1 - m near 1e-17); Newton's method then needs three rounds for all digits.
_NEWTON_ROUNDS = 3


def single_pendulum(scene: Scene, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The motion of a chain with one link: theta (k, 1) rad, continuous over full turns, and omega (k, 1) rad/s.

    times: (k,) s. Swinging, turning over the top, resting on the border between them, or turning freely where the
    scene has no gravity. The error grows like the rounding of t sqrt(g/l) and is below 1e-11 rad after 2000 s
    at l = 1 m; a start with a rate that takes it close to the border is known less well, as (E27) says.
    Raises InputError where the scene has more than one link, or an effect other than gravity.
    equations.md (E23) to (E27); DLMF 22.19(i).
    """
    _check_single(scene)
    times = np.asarray(times, dtype=np.float64)
    start, rate = float(scene.angles[0]), float(scene.rates[0])
    if not scene.effects.gravity:
        theta, omega = start + rate * times, np.full_like(times, rate)
    else:
        theta, omega = _under_gravity(start, rate, math.sqrt(scene.effects.gravity / scene.lengths[0]), times)
    return theta[:, np.newaxis], omega[:, np.newaxis]


def normal_modes(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Small oscillations about the hanging chain: angular frequencies (n,) rad/s, rising, and shapes (n, n).

    Column k of the shapes holds the angles of mode k, the largest of them 1. The frequencies are reciprocal singular
    values, which keeps them accurate to n rounding errors where an eigenvalue solver would keep n^2.
    Raises InputError where the scene has an effect other than gravity, or not that. equations.md (E28) to (E30).
    """
    check_plain(scene, "the closed form")
    if not scene.effects.gravity:
        raise InputError(f"scene {scene.name!r}: no gravity, so the chain has no small oscillations")
    stiffness = np.sqrt(scene.effects.gravity * hanging_masses(scene.masses) * scene.lengths)
    moves = np.tril(np.sqrt(scene.masses)[:, np.newaxis] * (scene.lengths / stiffness))
    _, singular_values, rows = np.linalg.svd(moves)
    shapes = rows.T / stiffness[:, np.newaxis]
    largest = np.take_along_axis(shapes, np.abs(shapes).argmax(axis=0)[np.newaxis], axis=0)
    return 1.0 / singular_values, shapes / largest


def _check_single(scene: Scene) -> None:
    if scene.n != 1:
        raise InputError(f"scene {scene.name!r}: {scene.n} links; a closed form is known for 1")
    check_plain(scene, "the closed form")


def _under_gravity(start: float, rate: float, frequency: float, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Theta and omega, (k,), with `frequency` = sqrt(g/l); which of three cases it is. equations.md (E23)."""
    if rate < 0.0:  # the mirror image turns the other way
        theta, omega = _under_gravity(-start, -rate, frequency, times)
        return -theta, -omega
    near = math.remainder(start, TURN)
    sin, cos, speed = math.sin(near / 2), math.cos(near / 2), rate / (2 * frequency)
    m, complement = sin * sin + speed * speed, (cos - speed) * (cos + speed)
    if complement > 0.0:
        theta, omega = _swinging(complement, (sin, speed), frequency, times)
    elif complement < 0.0:
        theta, omega = _turning(-complement / m, (sin, cos), frequency * math.sqrt(m), times)
    else:
        theta, omega = _on_the_border(near / 2, frequency, times)
    return theta + (start - near), omega


def _swinging(
    complement: float, k_sn_cn: tuple[float, float], frequency: float, times: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Back and forth: sin(theta/2) = k sn, cos(theta/2) = dn, omega = 2 k sqrt(g/l) cn. equations.md (E24)."""
    k = math.hypot(*k_sn_cn)
    start = (k_sn_cn[0] / k, k_sn_cn[1] / k) if k > 0.0 else (0.0, 1.0)
    phi, half_turns = _amplitude(frequency * times, start, complement)
    sign = 1.0 - 2.0 * (half_turns % 2.0)
    # An arctangent of two, because the arcsine of k sn has no digits left near the top.
    theta = 2.0 * np.arctan2(sign * k * np.sin(phi), _dn(phi, complement))
    return theta, 2.0 * k * frequency * sign * np.cos(phi)


def _turning(
    complement: float, start: tuple[float, float], frequency: float, times: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Over the top, counter-clockwise: theta/2 = am, omega = 2 frequency dn. equations.md (E25)."""
    phi, half_turns = _amplitude(frequency * times, start, complement)
    return 2.0 * phi + TURN * half_turns, 2.0 * frequency * _dn(phi, complement)


def _on_the_border(half_start: float, frequency: float, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Towards the top, never reaching it: tan(theta/2) = sinh. equations.md (E26)."""
    argument = math.asinh(math.tan(half_start)) + frequency * times
    half_angle = 2.0 * np.arctan(np.tanh(0.5 * argument))
    return 2.0 * half_angle, 2.0 * frequency * np.cos(half_angle)


def _amplitude(elapsed: FloatArray, start: tuple[float, float], complement: float) -> tuple[FloatArray, FloatArray]:
    """The Jacobi amplitude `elapsed` after its sine and cosine were `start` (cosine not negative).

    Returned as phi in [-pi/2, pi/2] and a number of half turns to add to it, both (k,). The argument is taken modulo
    2K first, so neither scipy's am nor the sine that follows sees a large number.
    """
    half_period = 2.0 * float(ellipkm1(complement))
    argument = _integral(np.array(start[0]), np.array(start[1]), complement) + elapsed
    half_turns = np.round(argument / half_period)
    u = argument - half_period * half_turns
    # scipy cannot be told all digits of 1 - m: start from its am and mend it.
    phi = np.asarray(ellipj(u, 1.0 - complement)[3], dtype=np.float64)
    for _ in range(_NEWTON_ROUNDS):
        excess = _integral(np.sin(phi), np.cos(phi), complement) - u
        phi = np.clip(phi - excess * _dn(phi, complement), -np.pi / 2, np.pi / 2)
    return phi, half_turns


def _integral(sin: FloatArray, cos: FloatArray, complement: float) -> FloatArray:
    """F(phi | m) from sin(phi) and cos(phi) >= 0: Carlson's form, a sum of positive terms. DLMF (19.25.5).

    The angle itself would not do: close to pi/2 it has lost the digits of its cosine.
    """
    return np.asarray(sin * elliprf(cos * cos, cos * cos + complement * sin * sin, 1.0))


def _dn(phi: FloatArray, complement: float) -> FloatArray:
    """Dn = sqrt(1 - m sin^2 phi), written without the subtraction. DLMF 22.6(i)."""
    return np.hypot(np.cos(phi), math.sqrt(complement) * np.sin(phi))
