"""Chains that are hard to compute with, and their accelerations in as many digits as wanted."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx

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


def exact_accelerations(scene: Scene) -> list[arb]:
    """theta'' (n,) rad/s^2 at the scene's start to fifty digits: (E6), element by element.

    In ball arithmetic, which knows how far off it is: where digits are lost, more are carried.
    """  # noqa: D403
    for digits in range(60, 3000, 60):
        exact = _solved(scene, digits)
        if largest(number.rad() for number in exact) <= 1e-50 * largest(exact):
            return exact
    raise AssertionError("no number of digits is enough")


def _solved(scene: Scene, digits: int) -> list[arb]:
    """(E6), with that many digits carried."""
    with ctx.workdps(digits):
        m, l, a, w = _parts(scene)  # noqa: E741
        n, gravity = scene.n, arb(scene.effects.gravity or 0.0)
        hanging = [sum(m[i:], arb(0)) for i in range(n)]
        left, right = arb_mat(n, n), arb_mat(n, 1)
        for i in range(n):
            right[i, 0] = -hanging[i] * gravity * l[i] * a[i].sin()
            for j in range(n):
                sine, cosine = (a[j] - a[i]).sin_cos()
                weight = hanging[max(i, j)] * l[i] * l[j]
                left[i, j] = weight * cosine
                right[i, 0] += weight * sine * w[j] ** 2
        return list(left.solve(right).entries())


def exact_by_tensions(scene: Scene) -> list[arb]:
    """theta'' (n,) rad/s^2 at the scene's start to 50 digits, in O(n): for chains too long for the dense form.

    The tridiagonal system for the tensions (docs/equations.md, A third form), eliminated outwards, and (E19). A pivot
    may lose as many digits as the masses are apart, so these are carried beside the fifty, twice.
    """  # noqa: D403
    decades = math.ceil(math.log10(scene.masses.max() / scene.masses.min()))
    with ctx.workdps(50 + 2 * decades):
        m, l, a, w = _parts(scene)  # noqa: E741
        weight = arb(scene.effects.gravity or 0.0)
        bends = [(outer - inner).sin_cos() for inner, outer in itertools.pairwise(a)]
        wanted = [length * rate**2 for length, rate in zip(l, w, strict=True)]
        wanted[0] += weight * a[0].cos()
        tension = _tensions([1 / x for x in m], [c for _, c in bends], wanted)
        outwards = [s * pull / mass for (s, _), pull, mass in zip(bends, tension[1:], m[:-1], strict=True)]
        inwards = [s * pull / mass for (s, _), pull, mass in zip(bends, tension[:-1], m[:-1], strict=True)]
        across = zip([*outwards, arb(0)], [weight * a[0].sin(), *inwards], l, strict=True)
        return [(out - back) / length for out, back, length in across]


def _parts(scene: Scene) -> list[list[arb]]:
    """Masses, lengths, angles and rates."""
    return [list(map(arb, part.tolist())) for part in (scene.masses, scene.lengths, scene.angles, scene.rates)]


def _tensions(light: list[arb], cosines: list[arb], wanted: list[arb]) -> list[arb]:
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


def largest(numbers: Iterable[arb]) -> float:
    """The largest size that any of them can have."""
    return max(float(number.abs_upper()) for number in numbers)


def relative_error(found: np.ndarray, exact: list[arb]) -> float:
    """The largest error of a component over the largest component."""
    with ctx.workdps(50):
        return largest(arb(float(f)) - e for f, e in zip(found, exact, strict=True)) / largest(exact)
