"""Chains that are hard to compute with, and their accelerations in as many digits as wanted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import mpmath
import numpy as np

from pendbench.scene import Effects, Scene

GRAVITY = 9.81
SIZES = (5, 8, 13, 20)

Maker = Callable[[np.random.Generator, int], tuple[Any, Any, Any]]


def _anyhow(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.uniform(-np.pi, np.pi, n)


def _alike(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.uniform(0.5, 2.0, n)


def _nearly_straight(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.uniform(-np.pi, np.pi) + 1e-4 * rng.standard_normal(n)


#: What makes a chain hard: (masses, lengths, angles) of it, each (n,), from a generator and n.
HARD: dict[str, Maker] = {
    "random, ratio below 4": lambda rng, n: (_alike(rng, n), _alike(rng, n), _anyhow(rng, n)),
    "random over sixteen decades": lambda rng, n: (10 ** rng.uniform(-8, 8, n), _alike(rng, n), _anyhow(rng, n)),
    "graded 1e-8 to 1e8 towards the tip": lambda rng, n: (np.logspace(-8, 8, n), _alike(rng, n), _anyhow(rng, n)),
    "graded 1e8 to 1e-8 towards the tip": lambda rng, n: (np.logspace(8, -8, n), _alike(rng, n), _anyhow(rng, n)),
    "alternating 1 and 1e8": lambda rng, n: (1e8 ** (np.arange(n) % 2), _alike(rng, n), _anyhow(rng, n)),
    "tip 1e8, nearly straight": lambda rng, n: (
        np.append(np.ones(n - 1), 1e8),
        _alike(rng, n),
        _nearly_straight(rng, n),
    ),
    "lengths over six decades": lambda rng, n: (_alike(rng, n), 10 ** rng.uniform(-3, 3, n), _anyhow(rng, n)),
}


def hard_chains(kind: str, seeds: range) -> Iterator[Scene]:
    """Scenes of that kind, of every size for each seed."""
    for seed in seeds:
        for n in SIZES:
            rng = np.random.default_rng([seed, n])
            masses, lengths, angles = HARD[kind](rng, n)
            yield Scene(kind, "", 1.0, masses, lengths, angles, rng.uniform(-5.0, 5.0, n), Effects(gravity=GRAVITY))


def exact_accelerations(scene: Scene, digits: int = 50) -> list[mpmath.mpf]:
    """theta'' (n,) rad/s^2 at the scene's start: (E6) element by element, solved with that many digits."""  # noqa: D403
    with mpmath.workdps(digits):
        m, l, a, w = (  # noqa: E741
            [mpmath.mpf(float(x)) for x in part] for part in (scene.masses, scene.lengths, scene.angles, scene.rates)
        )
        n, gravity = scene.n, mpmath.mpf(scene.effects.gravity or 0.0)
        hanging = [mpmath.fsum(m[i:]) for i in range(n)]
        left, right = mpmath.matrix(n, n), mpmath.matrix(n, 1)
        for i in range(n):
            right[i] = -hanging[i] * gravity * l[i] * mpmath.sin(a[i])
            for j in range(n):
                cosine, sine = mpmath.cos_sin(a[j] - a[i])
                weight = hanging[max(i, j)] * l[i] * l[j]
                left[i, j] = weight * cosine
                right[i] += weight * sine * w[j] ** 2
        return list(mpmath.lu_solve(left, right))


def relative_error(found: np.ndarray, exact: list[mpmath.mpf]) -> float:
    """The largest error of a component over the largest component."""
    with mpmath.workdps(50):
        worst = max(abs(mpmath.mpf(float(f)) - e) for f, e in zip(found, exact, strict=True))
        return float(worst / max(abs(e) for e in exact))
