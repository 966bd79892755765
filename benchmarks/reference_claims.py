"""How far the reference is off, against solutions with 45 digits, and what it claims.

By hand: python benchmarks/reference_claims.py [scenes of each kind]. Needs heyoka, whose Taylor series work with 237
bits.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import heyoka as hy
import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.engines.heyoka import _Chain
from pendbench.physics.geometry import distance
from pendbench.scene.scene import Effects, Scene
from pendbench.truth.reference import Truth, reference

BITS = 237
TOLERANCE = 1e-45
SAMPLES = 40
EFFECTS: tuple[dict[str, Any], ...] = (
    {"gravity": 9.81, "joint_damping": 0.01},
    {"gravity": 9.81, "joint_stiffness": 1.5, "air_drag": {"linear": 0.02}},
    {"gravity": 9.81, "rod_mass": 0.5, "drive_torque": {"joint": 1, "amplitude": 3.0, "angular_frequency": 2.5}},
    {"gravity": 9.81, "driven_pivot": {"axis": "y", "amplitude": 0.1, "angular_frequency": 15.0}},
)


def plain_scene(n: int, seed: int) -> Scene:
    """A chain of unlike links, in disorder and moving, for 20 s."""
    random = np.random.default_rng(seed)
    masses, lengths = random.uniform(0.3, 3.0, n), random.uniform(0.3, 1.5, n)
    angles, rates = random.uniform(-2.5, 2.5, n), random.uniform(-2.0, 2.0, n)
    return Scene(f"chain of {n}, {seed}", "", 20.0, masses, lengths, angles, rates, Effects(gravity=9.81))


def effects_scene(which: int, seed: int) -> Scene:
    """Two links with effects, for 15 s."""
    plain, effects = plain_scene(2, seed), Effects(**EFFECTS[which])
    name = f"{', '.join(effects.named())}, {seed}"
    return Scene(name, "", 15.0, plain.masses, plain.lengths, plain.angles, plain.rates, effects)


class Exact:
    """Solves scenes of one kind with 237 bits. All numbers are parameters: heyoka folds constants in doubles."""

    def __init__(self, n: int, *, effects: bool) -> None:
        self._n, self._effects = n, effects
        equations = _two_links() if effects else _plain_links(n)
        size, count = (4, len(_NUMBERS)) if effects else (2 * n + 2, 2 * n)
        zeros = [hy.real(0.0, BITS)] * size
        self._integrator = hy.taylor_adaptive(
            equations,
            zeros,
            pars=[hy.real(1.0, BITS)] * count,
            fp_type=hy.real,
            prec=BITS,
            tol=hy.real(TOLERANCE, BITS),
            compact_mode=True,
        )

    def angles(self, scene: Scene, times: FloatArray) -> Iterator[list[Any]]:
        """The angles at each time, as numbers of 237 bits."""
        start = [hy.real(float(x), BITS) for x in (*scene.angles, *scene.rates)]
        if not self._effects:
            start += [np.cos(start[0]), np.sin(start[0])]
        numbers = _numbers(scene) if self._effects else _ratios(scene)
        integrator = self._integrator
        integrator.time = hy.real(0.0, BITS)
        integrator.state[:], integrator.pars[:] = start, numbers
        for time in times:
            integrator.propagate_until(hy.real(float(time), BITS))
            yield list(integrator.state[: self._n])


def _plain_links(n: int) -> list[Any]:
    """The adapter's recursion: lengths and gravity over the first rod's length, masses over the next one."""
    chain = _Chain(plain_scene(n, 0))
    chain._lengths = [hy.par[i] for i in range(n)]
    chain._ratios = [hy.par[n + i] for i in range(n - 1)]
    chain._gravity = hy.par[2 * n - 1]
    return chain.equations()


def _ratios(scene: Scene) -> list[Any]:
    lengths, masses = ([hy.real(float(x), BITS) for x in values] for values in (scene.lengths, scene.masses))
    outer = [m / following for m, following in pairwise(masses)]
    return [*(length / lengths[0] for length in lengths), *outer, hy.real(9.81, BITS) / lengths[0]]


_NUMBERS = ("l1", "l2", "m1", "m2", "g", "rod", "sixth", "damping", "stiffness", "drag", "torque", "pace", "size", "w")


def _numbers(scene: Scene) -> list[Any]:
    effects = scene.effects
    drive, pivot, air = effects.drive_torque, effects.driven_pivot, effects.air_drag
    rod = float(effects.rod_mass or 0.0)
    numbers = [*scene.lengths, *scene.masses, 9.81, rod, 0.0, effects.joint_damping or 0.0]
    numbers += [effects.joint_stiffness or 0.0, air.linear if air else 0.0]
    numbers += [drive.amplitude, drive.angular_frequency] if drive else [0.0, 1.0]
    numbers += [pivot.amplitude, pivot.angular_frequency] if pivot else [0.0, 1.0]
    found = [hy.real(float(x), BITS) for x in numbers]
    found[_NUMBERS.index("sixth")] = hy.real(rod, BITS) / hy.real(6.0, BITS)
    return found


def _two_links() -> list[Any]:
    """Two links with effects, from (E6) and (E36) to (E40), solved by Cramer's rule."""
    a, b, va, vb = hy.make_vars("a", "b", "va", "vb")
    l1, l2, m1, m2, g, rod, sixth, damping, stiffness, drag, torque, pace, size, w = (hy.par[i] for i in range(14))
    outer, both = m2 + 0.5 * rod, m1 + m2 + 1.5 * rod
    g = g - w * w * size * hy.sin(w * hy.time)
    joint = -damping * (vb - va) - stiffness * (b - a)
    sine, cosine = hy.sin(b - a), hy.cos(b - a)
    # What the air does: its force on each mass, -drag v, on the way that each angle moves it.
    right_a = -damping * va - stiffness * a + torque * hy.sin(pace * hy.time) - joint
    right_a = right_a - drag * (2.0 * l1 * l1 * va + l1 * l2 * cosine * vb)
    right_a = right_a + outer * l1 * l2 * sine * vb * vb - both * l1 * g * hy.sin(a)
    right_b = joint - drag * (l2 * l2 * vb + l1 * l2 * cosine * va)
    right_b = right_b - outer * l1 * l2 * sine * va * va - outer * l2 * g * hy.sin(b)
    c11, c22, c12 = (both - sixth) * l1 * l1, (outer - sixth) * l2 * l2, outer * l1 * l2 * cosine
    below = c11 * c22 - c12 * c12
    first, second = (c22 * right_a - c12 * right_b) / below, (c11 * right_b - c12 * right_a) / below
    return [(a, va), (b, vb), (va, first), (vb, second)]


def true_errors(exact: Exact, scene: Scene, truth: Truth) -> FloatArray:
    """How far it is off at each of its times, in lengths of the chain."""
    offset = np.zeros_like(truth.theta)
    for k, angles in enumerate(exact.angles(scene, truth.t)):
        for i, angle in enumerate(angles):
            offset[k, i] = float(angle - float(truth.theta[k, i]) - float(truth.theta_low[k, i]))
    return distance(scene.lengths, truth.theta, offset)


def main(count: int) -> None:
    """A line for each scene, and the worst of all."""
    exact = Exact(2, effects=True)
    found = [measure(exact, effects_scene(which, seed)) for which in range(len(EFFECTS)) for seed in range(count)]
    for n in (2, 3, 4):
        exact = Exact(n, effects=False)
        found += [measure(exact, plain_scene(n, seed)) for seed in range(count)]
    claims, differences = zip(*found, strict=True)
    print(f"{len(found)} scenes: at worst {max(claims):.2g} of the claim")
    print(
        "times the difference: median, 90 %, worst:", *(f"{np.nanquantile(differences, q):.2g}" for q in (0.5, 0.9, 1))
    )


def measure(exact: Exact, scene: Scene) -> tuple[float, float]:
    """The largest error over the claim, and over the largest difference of the two solves up to then."""
    truth = reference(scene, np.linspace(0.0, scene.duration, SAMPLES + 1)[1:])
    errors = true_errors(exact, scene, truth)
    claim = float((errors / truth.bound).max())
    # Early on the two solves differ by the rounding of a few steps, and the claim is what steps are allowed.
    late = truth.disagreement > 1e-20
    seen = np.maximum.accumulate(truth.disagreement)
    difference = float((errors / seen)[late].max()) if late.any() else float("nan")
    print(
        f"{scene.name}: until {truth.horizon:g} s, off by {errors[-1]:.1e}, claims {truth.error:.1e}; "
        f"at worst {claim:.1e} of the claim, {difference:.2g} times the difference",
        flush=True,
    )
    return claim, difference


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
