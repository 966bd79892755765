"""pymunk's `tuned` finds its settings from the masses: it is never worse than the default, or says so."""

from __future__ import annotations

import math

import numpy as np
import pymunk
import pytest

import pendbench as pb
from pendbench.base.faults import Fault
from pendbench.engines.pymunk.adapter import PymunkEngine, _Run
from pendbench.engines.pymunk.tuning import AFFORDED, MOST_ITERATIONS, Tuning, left_by_an_iteration, tuning
from pendbench.physics.geometry import distance
from pendbench.scene.scene import Scene, load_scene
from support.scenes import chain


def masses(n: int, decades: float, seed: int) -> np.ndarray:
    return 10.0 ** np.random.default_rng(seed).uniform(-decades / 2, decades / 2, n)


def gauss_and_seidel(mass: np.ndarray) -> float:
    """The spectral radius of the iteration for the impulses of a straight chain, written out as matrices."""
    inverse = np.diag(1.0 / mass)
    joints = np.eye(len(mass)) - np.eye(len(mass), k=-1)  # each joint takes one mass from the mass before
    system = joints @ inverse @ joints.T
    lower = np.tril(system)
    return float(np.abs(np.linalg.eigvals(-np.linalg.solve(lower, system - lower))).max())


@pytest.mark.parametrize("decades", [0.0, 1.0, 4.0])
@pytest.mark.parametrize("n", [1, 2, 3, 8, 30])
def test_what_an_iteration_leaves(n, decades):
    mass = masses(n, decades, seed=n)
    assert 1.0 - left_by_an_iteration(mass) == pytest.approx(1.0 - gauss_and_seidel(mass), rel=1e-4, abs=1e-12)


@pytest.mark.parametrize("n", [2, 5, 50, 100, 547])
def test_equal_links_want_a_third_of_their_square(n):
    assert left_by_an_iteration(np.ones(n)) == pytest.approx(math.cos(math.pi / (2 * n)) ** 2, rel=1e-6)
    assert tuning(np.ones(n), 1e-3).iterations == pytest.approx(10 + n**2 / 3, abs=1)


def test_no_more_iterations_than_are_afforded():
    assert tuning(np.ones(600), 1e-3).iterations == MOST_ITERATIONS
    assert tuning(np.array([1.0, 1.0, 1e6]), 1e-3).iterations == AFFORDED
    assert tuning(np.array([1e-50, 1e50]), 1e-3).iterations <= AFFORDED


@pytest.mark.parametrize("iterations", [None, 1, 3, 10, 100])
@pytest.mark.parametrize("tip", [1e-6, 1.0, 1e2, 1e4])
def test_no_error_of_the_joints_grows_from_step_to_step(tip, iterations):
    found = tuning(np.array([1.0, 1.0, 1.0, tip]), 1e-3, iterations)
    c, q = found.corrected, found.left
    assert 1.0 - found.error_bias**1e-3 == pytest.approx(c)
    # (gap, velocity, impulse) of one mode, a step later.
    step = np.array([[1, 1, 0], [-c * (1 - q), q * (1 + c) - c, q], [-c * (1 - q), -(1 - q) * (1 + c), q]])
    growth = np.abs(np.linalg.eigvals(step)).max()
    its_own = pymunk.PinJoint(pymunk.Body(1, 1), pymunk.Body(1, 1)).error_bias  # which `tuned` never goes below
    assert growth < 1.0 or found.error_bias == pytest.approx(its_own, rel=1e-5)


def error(scene: Scene, method: str, dt: float, times: np.ndarray, **settings: float) -> float:
    """The worst e of a run over the total length; infinite for one that says that it went wrong."""
    run = pb.simulate(scene, "pymunk", method, dt, times, **settings)
    exact = pb.simulate(scene, times=times)
    if run.status != "ok":
        return math.inf
    return float(np.max(distance(scene.lengths, exact.theta, run.theta - exact.theta)))


@pytest.mark.parametrize("dt", [1e-3, 2e-4])
@pytest.mark.parametrize("name", ["heavy_tip", "tip_1e2"])
def test_a_heavy_tip_is_not_lost(name, dt):
    times = np.linspace(0.0, 0.6, 7)
    default, tuned = (error(load_scene(name), method, dt, times) for method in ("default", "tuned"))
    assert tuned < 0.2 * default


@pytest.mark.parametrize("seed", range(8))
def test_never_worse_than_the_default(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 15))
    mass = masses(n, rng.uniform(0.0, 5.0), seed)
    scene = chain(n, mass=mass, length=rng.uniform(0.5, 1.5, n) / n, angle=rng.uniform(-1.5, 1.5, n))
    for dt in (2e-3, 5e-4):
        times = dt * np.array([100, 200])
        default, tuned = (error(scene, method, dt, times) for method in ("default", "tuned"))
        # Where the masses want more than is afforded the two make about the same error.
        assert tuned <= 1.02 * default or math.isinf(tuned)


def test_a_full_correction_after_too_few_iterations_is_told():
    scene, few = load_scene("heavy_tip"), 44
    run = _Run(scene, 2e-4, few, Tuning(few, 0.0, 1.0, left=0.4))
    faults = []
    for _ in range(100):
        run.advance(50)
        faults.append(run.health())
    told = next(fault for fault in faults if fault is not None)
    assert told.status == "not converged"
    assert told.reason.startswith("44 iterations are too few: a joint is open by ")


@pytest.mark.parametrize("name", ["chain10", "fast_spin", "tip_1e4", "graded_lengths", "folded", "rods_triple"])
def test_what_converges_is_not_called_otherwise(name):
    run = PymunkEngine().build(load_scene(name), "tuned", 2e-4)
    found: set[Fault | None] = set()
    for _ in range(25):
        run.advance(100)
        found.add(run.health())
    assert found == {None}
