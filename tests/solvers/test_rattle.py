"""RATTLE against one that is written out with dense matrices, and where it cuts its steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendbench.base.arrays import FloatArray
from pendbench.physics.energy import energy, energy_scale
from pendbench.physics.geometry import positions, rod_vectors, velocities
from pendbench.scene.scene import Scene
from pendbench.solvers.closing import chain_of
from pendbench.solvers.rattle import PARTS, PATIENCE, State, begin, rattle
from support.scenes import chain, random_chain


class Run:
    """A scene at its start, and what becomes of it."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.chain = chain_of(scene.masses, scene.lengths, scene.effects.gravity or 0.0)
        self.state: State = begin(scene.angles, scene.rates)

    def steps(self, h: float, count: int) -> int:
        return rattle(self.chain, self.state, 0, h, count)

    @property
    def strays(self) -> float:
        """The error in energy, in its scale."""
        scene, state = self.scene, self.state
        found = energy(scene, state.q, state.v) - energy(scene, scene.angles, scene.rates)
        return float(found / energy_scale(scene))


def dense_rattle(scene: Scene, h: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) and their velocities after steps of h s: Andersen's two stages, each with a dense matrix."""
    n, inverse = scene.n, np.repeat(1.0 / scene.masses, 2)
    differences = np.kron(np.eye(n) - np.eye(n, k=-1), np.eye(2))  # rods of points
    x = positions(scene.lengths, scene.angles).ravel()
    v = velocities(scene.lengths, scene.angles, scene.rates).ravel()
    fall = np.tile([0.0, -(scene.effects.gravity or 0.0)], n)

    def pulls(points: FloatArray) -> FloatArray:
        rods = (differences @ points).reshape(n, 2)
        return differences.T @ np.einsum("ij,ik->ijk", np.eye(n), rods).reshape(n, 2 * n).T

    for _ in range(count):
        along, half = pulls(x), v + 0.5 * h * fall
        multipliers = np.zeros(n)
        for _ in range(50):
            new = x + h * (half + inverse * (along @ multipliers))
            off = ((differences @ new).reshape(n, 2) ** 2).sum(axis=1) - scene.lengths**2
            multipliers -= np.linalg.solve(2.0 * h * pulls(new).T @ (inverse[:, None] * along), off)
        v = half + inverse * (along @ multipliers) + 0.5 * h * fall
        along = pulls(new)
        stretching = along.T @ v
        v = v - inverse * (along @ np.linalg.solve(along.T @ (inverse[:, None] * along), stretching))
        x = new
    return x.reshape(n, 2), v.reshape(n, 2)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8, 13])
def test_it_is_rattle(n: int) -> None:
    scene, h, count = random_chain(n, seed=n), 5e-4, 100
    run = Run(scene)
    assert run.steps(h, count) == count
    assert run.state.steps[PARTS] == 1.0
    points, speeds = dense_rattle(scene, h, count)
    rods = rod_vectors(points)
    assert np.sin(run.state.q) == pytest.approx(rods[:, 0] / scene.lengths, abs=1e-9)
    assert -np.cos(run.state.q) == pytest.approx(rods[:, 1] / scene.lengths, abs=1e-9)
    found = velocities(scene.lengths, run.state.q, run.state.v)
    assert found == pytest.approx(speeds, abs=1e-8 * np.abs(speeds).max())


def test_masses_over_eight_decades_close() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        scene = random_chain(12, seed=seed)
        scene = chain(12, mass=list(10.0 ** rng.uniform(-4, 4, 12)), angle=list(scene.angles))
        run = Run(scene)
        assert run.steps(1e-5, 200) == 200
        assert run.state.gap[0] < 1e-12
        assert abs(run.strays) < 1e-6


@pytest.mark.parametrize("n", [2, 9, 10, 1000])
@pytest.mark.parametrize(("mass", "length"), [(1e50, 1.0), (1e-50, 1.0), (1e50, 1e-50), (1e-50, 1e50)])
def test_units_do_not_matter(n: int, mass: float, length: float) -> None:
    small, large = Run(chain(n, mass=1.0, length=1.0)), Run(chain(n, mass=mass, length=length))
    h = 1e-3 / n
    assert small.steps(h, 20) == 20
    assert large.steps(h * math.sqrt(length), 20) == 20
    assert large.state.q == pytest.approx(small.state.q, abs=1e-9)


def test_changes_of_the_step_become_rare() -> None:
    """Steps of 8 ms are too long for five links. With changes every few hundred steps they lose 41 % in this time."""
    run = Run(chain(5, length=0.2, angle=2.0))
    assert run.steps(8e-3, 20_000) == 20_000
    assert run.state.steps[PATIENCE] > 200.0
    assert -0.1 < run.strays < 0.01


def test_steps_are_the_same_however_they_are_asked_for() -> None:
    scene = random_chain(6, seed=3)
    once, singly = Run(scene), Run(scene)
    assert once.steps(2e-3, 300) == 300
    assert all(singly.steps(2e-3, 1) == 1 for _ in range(300))
    np.testing.assert_array_equal(once.state.q, singly.state.q)
    np.testing.assert_array_equal(once.state.v, singly.state.v)


def test_a_whip_s_crack_is_taken_in_parts_and_nothing_else() -> None:
    """A rope of 200 links released horizontally cracks first at 1.4 s."""
    run, parts = Run(chain(200, mass=1 / 200)), []
    for _ in range(800):
        assert run.steps(1.25e-4, 20) == 20
        parts.append(run.state.steps[PARTS])
    assert max(parts[:500]) == 1.0
    assert max(parts) > 1.0
    assert parts.count(1.0) > 700
    assert abs(run.strays) < 0.005


def test_a_cut_step_is_its_parts() -> None:
    """A rod that turns by 0.6 rad in a step, with h W of 0.85: two parts of 0.3, and never again a whole step."""
    scene = chain(1, length=1.0, rate=6.0, gravity=None)
    cut, parts = Run(scene), Run(scene)
    assert cut.steps(0.1, 80) == 80
    assert cut.state.steps[PARTS] == 2.0
    assert parts.steps(0.05, 160) == 160
    np.testing.assert_array_equal(cut.state.q, parts.state.q)
    assert cut.state.q[0] > 10 * np.pi


@pytest.mark.parametrize("seed", range(30))
def test_no_step_is_so_long_that_the_energy_grows(seed: int) -> None:
    """Stormer-Verlet is unstable where h times the fastest oscillation is above 2: uncut for that, nine of 200 such
    chains more than doubled their energy. What is lost is the error of long parts, in this time a sixth at most.
    """
    rng = np.random.default_rng(seed)
    n, decades = int(rng.integers(2, 20)), rng.uniform(0, 4)
    masses, lengths = 10.0 ** rng.uniform(-decades, decades, n), 10.0 ** rng.uniform(-1, 0.3, n)
    rates = rng.normal(0, 10, n) * rng.random()
    run = Run(chain(n, mass=list(masses), length=list(lengths), angle=list(rng.uniform(-3, 3, n)), rate=list(rates)))
    for _ in range(30):
        if run.steps(5e-3, 4) < 4:
            break  # masses too unlike
        assert -0.2 < run.strays < 0.01


def test_what_cannot_be_taken_leaves_the_step_before() -> None:
    """Rods that are spun faster and faster: from some rate on, not even the finest parts of a step close."""
    scene = chain(4, length=1.0, rate=[1e3, -2e3, 4e3, -3e3], gravity=None)
    run = Run(scene)
    assert run.steps(1e-3, 3) == 3
    kept = [array.copy() for array in run.state[:5]]
    assert run.steps(20.0, 3) == 0
    for array, before in zip(run.state[:5], kept, strict=True):
        np.testing.assert_allclose(array, before, rtol=1e-12, atol=1e-12)
