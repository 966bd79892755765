"""Chains that are hard to compute with, and their accelerations in as many digits as wanted."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import mpmath
import numpy as np

from pendbench.scene.scene import Effects, Scene

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


def exact_by_tensions(scene: Scene) -> list[mpmath.mpf]:
    """theta'' (n,) rad/s^2 at the scene's start to 50 digits, in O(n): for chains too long for the dense form.

    The tridiagonal system for the tensions (docs/equations.md, A third form), eliminated outwards, and (E19). A pivot
    may lose as many digits as the masses are apart, so these are carried beside the fifty, twice.
    """  # noqa: D403
    decades = math.ceil(math.log10(scene.masses.max() / scene.masses.min()))
    with mpmath.workdps(50 + 2 * decades):
        m, l, a, w = (  # noqa: E741
            [mpmath.mpf(float(x)) for x in part] for part in (scene.masses, scene.lengths, scene.angles, scene.rates)
        )
        weight, bends = mpmath.mpf(scene.effects.gravity or 0.0), list(map(_bend, a, a[1:]))
        wanted = [length * rate**2 for length, rate in zip(l, w, strict=True)]
        wanted[0] += weight * mpmath.cos(a[0])
        tension = _tensions([1 / x for x in m], [c for c, _ in bends], wanted)
        outwards = [s * pull / mass for (_, s), pull, mass in zip(bends, tension[1:], m[:-1], strict=True)]
        inwards = [s * pull / mass for (_, s), pull, mass in zip(bends, tension[:-1], m[:-1], strict=True)]
        across = zip([*outwards, mpmath.mpf(0)], [weight * mpmath.sin(a[0]), *inwards], l, strict=True)
        return [(out - back) / length for out, back, length in across]


def _bend(inner: mpmath.mpf, outer: mpmath.mpf) -> tuple[mpmath.mpf, mpmath.mpf]:
    cosine, sine = mpmath.cos_sin(outer - inner)
    return cosine, sine


def _tensions(light: list[mpmath.mpf], cosines: list[mpmath.mpf], wanted: list[mpmath.mpf]) -> list[mpmath.mpf]:
    """The tensions (n,) from the masses' inverses (n,), the bends' cosines (n - 1,) and the right-hand sides (n,)."""
    pivots, right = [light[0]], [wanted[0]]
    for i, cosine in enumerate(cosines, start=1):
        coupling = cosine * light[i - 1]
        ratio = coupling / pivots[-1]
        pivots.append(light[i - 1] + light[i] - ratio * coupling)
        right.append(wanted[i] + ratio * right[-1])
    pulls = [right[-1] / pivots[-1]]
    for i in range(len(cosines) - 1, -1, -1):
        pulls.append((right[i] + cosines[i] * light[i] * pulls[-1]) / pivots[i])
    return pulls[::-1]


def relative_error(found: np.ndarray, exact: list[mpmath.mpf]) -> float:
    """The largest error of a component over the largest component."""
    with mpmath.workdps(50):
        worst = max(abs(mpmath.mpf(float(f)) - e) for f, e in zip(found, exact, strict=True))
        return float(worst / max(abs(e) for e in exact))
