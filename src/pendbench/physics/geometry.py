"""Where the masses are, how fast they move, and how far two chains are apart."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray

TURN: Final = 2.0 * np.pi


def positions(lengths: FloatArray, theta: FloatArray) -> FloatArray:
    """(x, y) of the masses, (..., n, 2) m. lengths: (n,) m; theta: (..., n) rad. equations.md (E1)."""
    rods = side_by_side(np.shape(theta), lengths * np.sin(theta), -lengths * np.cos(theta))
    return np.cumsum(rods, axis=-2)


def velocities(lengths: FloatArray, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """(x', y') of the masses, (..., n, 2) m/s. theta: (..., n) rad; omega: (..., n) rad/s. The rate of (E1)."""
    speeds = lengths * omega
    x, y = speeds * np.cos(theta), speeds * np.sin(theta)
    return np.cumsum(side_by_side(np.shape(x), x, y), axis=-2)


def side_by_side(shape: tuple[int, ...], x: Any, y: Any) -> FloatArray:
    """(*shape, 2) of what x and y are, arrays of this shape or numbers; np.stack() takes three times as long."""
    both = np.empty((*shape, 2))
    both[..., 0] = x
    both[..., 1] = y
    return both


def rod_vectors(places: FloatArray) -> FloatArray:
    """The vector along each rod (n, 2) m, from the masses' places (n, 2) m; of their speeds, how fast it changes."""
    rods = places.copy()
    rods[1:] -= places[:-1]
    return rods


def distance(lengths: FloatArray, theta: FloatArray, delta: FloatArray) -> FloatArray:
    """How far apart two chains are, (...,): max_i |r_i(theta + delta) - r_i(theta)| / L. equations.md (E22).

    lengths: (n,) m; theta, delta: (..., n) rad. The second chain is given by its difference from the first, because
    positions that agree to many digits leave none when they are subtracted: here each rod's end moves by the chord
    2 sin(delta/2), and a delta of 1e-20 gives an e of 1e-20.
    """
    chords = 2.0 * lengths * np.sin(0.5 * delta)
    middle = theta + 0.5 * delta
    apart = np.cumsum(np.stack([chords * np.cos(middle), chords * np.sin(middle)], axis=-1), axis=-2)
    return np.asarray(np.hypot(apart[..., 0], apart[..., 1]).max(axis=-1) / lengths.sum())


def wrapped(angle: FloatArray) -> FloatArray:
    """The same direction in (-pi, pi], rad, any shape. Angles already there come back unchanged, to the bit."""
    rest = np.fmod(angle, TURN)  # exact, unlike a shift by pi and back
    return np.asarray(np.where(rest > np.pi, rest - TURN, np.where(rest <= -np.pi, rest + TURN, rest)))
