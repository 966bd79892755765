"""Chains for tests, made without a file."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pendbench.scene.scene import Effects, Scene


def chain(
    n: int,
    *,
    angle: npt.ArrayLike = np.pi / 2,
    rate: npt.ArrayLike = 0.0,
    length: npt.ArrayLike | None = None,
    mass: npt.ArrayLike = 1.0,
    gravity: float | None = 9.81,
    duration: float = 1.0,
    name: str = "chain",
    title: str = "A chain",
) -> Scene:
    """A chain of n links of total length 1 m, unless each length is given; other values for all links, or for each."""

    def each(value: npt.ArrayLike) -> np.ndarray:
        return np.broadcast_to(np.asarray(value, dtype=float), (n,))

    return Scene(
        name=name,
        title=title,
        duration=duration,
        masses=each(mass),
        lengths=each(1.0 / n if length is None else length),
        angles=each(angle),
        rates=each(rate),
        effects=Effects(gravity=gravity),
    )


def rope(n: int, **start) -> Scene:
    """One metre and one kilogram in n links."""
    return chain(n, mass=1 / n, **start)


def random_chain(n: int, seed: int, spread: float = 1.0, gravity: float | None = 9.81) -> Scene:
    """A chain of n unlike links, in disorder and moving; `spread` (rad, rad/s) is how much."""
    rng = np.random.default_rng(seed)
    return chain(
        n,
        angle=rng.uniform(-spread, spread, n),
        rate=rng.uniform(-spread, spread, n),
        length=rng.uniform(0.5, 1.5, n),
        mass=rng.uniform(0.5, 2.0, n),
        gravity=gravity,
    )
