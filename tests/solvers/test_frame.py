"""RATTLE with as many steps in a frame as it asks for: ropes of many links at 1/240 s."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from pendbench.engines.analytic.adapter import AnalyticEngine
from pendbench.engines.recording import simulate
from pendbench.physics.energy import energy, energy_scale, tensions
from pendbench.physics.exact import normal_modes, single_pendulum
from pendbench.scene.scene import Scene
from pendbench.solvers.closing import chain_of
from pendbench.solvers.frame import LONGEST, MOST_SUBSTEPS, take_frames
from pendbench.solvers.multipliers import Rows, pulls_within, rows_of
from pendbench.solvers.rattle import FINEST, LAST, PARTS, begin, rattle
from support.kernels import called
from support.scenes import chain, random_chain, rope

FRAME = 1 / 240


class Run:
    """What the solvers change, for a scene at its start."""

    def __init__(self, scene: Scene) -> None:
        self.chain = chain_of(scene.masses, scene.lengths, scene.effects.gravity or 0.0)
        self.state = begin(scene.angles, scene.rates)

    def frames(self, frame: float, substeps: int, count: int) -> tuple[int, int]:
        self.state.steps[PARTS] = substeps
        return take_frames(self.chain, self.state, 0, frame, count), int(self.state.steps[PARTS])

    def steps(self, h: float, count: int) -> int:
        return rattle(self.chain, self.state, 0, h, count)

    def rows(self) -> Rows:
        return called(rows_of)(self.state.memory, self.state.room, len(self.chain.lengths))


def strays(scene: Scene, seconds: float) -> np.ndarray:
    """The error in energy over its scale at every frame; the run must be well, and its rods at their lengths."""
    run = simulate(scene, "analytic", "frame", FRAME, FRAME * np.arange(round(240 * seconds) + 1))
    assert run.status == "ok", run.reason
    assert len(run.t) == round(240 * seconds) + 1
    assert run.gap.max() < 1e-12
    return (energy(scene, run.theta, run.omega) - energy(scene, scene.angles, scene.rates)) / energy_scale(scene)


# Released horizontally, a rope of one metre cracks its whip first at 1.4 s. All measured: 0.03 % to 0.6 %.
@pytest.mark.parametrize(("n", "seconds"), [(5, 60), (10, 60), (50, 20), (100, 10), (200, 2.5), (500, 1.6)])
def test_ropes_keep_their_energy_at_the_step_of_a_picture(n: int, seconds: float) -> None:
    assert np.abs(strays(rope(n), seconds)).max() < 0.01


def test_a_kilometre_of_chain_keeps_its_energy() -> None:
    """It cracks first at 43.9 s."""
    assert np.abs(strays(chain(1000, length=1.0), 45.0)).max() < 0.01


def test_energy_has_no_slope_once_the_number_of_steps_has_settled() -> None:
    """With the number chosen anew for each frame it walks by 7 % in this time."""
    scene = rope(20)
    found = strays(scene, 60.0)[240 * 20 + 1 :]
    means = found.reshape(8, -1).mean(axis=1)  # over 5 s each
    assert np.ptp(means) < 1e-3


def test_a_frame_short_enough_is_a_step_of_rattle() -> None:
    scene = random_chain(4, seed=1)
    ours, plain = Run(scene), Run(scene)
    assert ours.frames(1e-3, 1, 500) == (500, 1)
    assert plain.steps(1e-3, 500) == 500
    np.testing.assert_array_equal(ours.state.q, plain.state.q)
    np.testing.assert_array_equal(ours.state.v, plain.state.v)


def test_a_frame_too_long_is_that_many_steps_of_rattle() -> None:
    """Nothing is left of the attempts with fewer, nor of the turns they counted."""
    scene = chain(3, length=1.0, rate=[12.0, 4.0, -9.0])
    ours, plain = Run(scene), Run(scene)
    taken, substeps = ours.frames(2.0, 1, 1)
    assert taken == 1
    assert substeps > 64
    assert plain.steps(2.0 / substeps, substeps) == substeps
    assert np.abs(plain.state.q - scene.angles).max() > 2 * np.pi
    np.testing.assert_array_equal(ours.state.q, plain.state.q)
    np.testing.assert_array_equal(ours.state.v, plain.state.v)


def test_frames_run_backwards_to_where_they_came_from() -> None:
    scene = random_chain(4, seed=4)
    there = Run(scene)
    assert there.frames(0.02, 8, 25) == (25, 8)
    assert np.abs(there.state.q - scene.angles).max() > 0.1  # it went somewhere
    back = Run(scene.with_start(there.state.q, -there.state.v))
    assert back.frames(0.02, 8, 25) == (25, 8)
    assert back.state.q == pytest.approx(scene.angles, abs=1e-10)


@pytest.mark.parametrize("n", [1, 10, 100, 300])
def test_a_hanging_rope_asks_for_the_steps_of_its_fastest_oscillation(n: int) -> None:
    run = Run(rope(n, angle=1e-6))
    fastest = 2 * n * math.sqrt(9.81)  # all its links hang on the first: equations.md, below (E30)
    if n == 1:
        fastest /= math.sqrt(2)  # no second rod
    needed = max(FRAME * fastest / LONGEST, 1.0)
    assert run.frames(FRAME, 1, 24) == (24, 2 ** math.ceil(math.log2(needed)))


def bound(scene: Scene) -> float:
    """W of the module's heading, rad/s, from tensions that are computed elsewhere."""
    couplings = np.append(0.0, 1.0 / scene.masses)
    pulls = np.pad(-tensions(scene, scene.angles, scene.rates) / scene.lengths, 1)
    squared = 2.0 * ((np.abs(pulls[1:-1]) + np.abs(pulls[2:])) / scene.masses).max()
    within = called(pulls_within)
    assert within(couplings, pulls, squared * (1 + 1e-12))
    assert not within(couplings, pulls, squared * (1 - 1e-12))
    assert not within(couplings, np.full_like(pulls, np.nan), squared)
    return math.sqrt(squared)


@pytest.mark.parametrize("seed", range(8))
def test_no_small_oscillation_is_faster_than_the_bound(seed: int) -> None:
    unlike = random_chain(12, seed=seed)
    hanging = unlike.with_start(np.zeros(12), np.zeros(12))
    assert normal_modes(hanging)[0].max() <= bound(hanging)


def test_the_bound_is_close_for_a_rope() -> None:
    scene = rope(100, angle=0.0)
    assert 0.9 * bound(scene) < normal_modes(scene)[0].max() <= bound(scene)


@pytest.mark.parametrize("seed", range(20))
def test_no_rod_of_a_rope_turns_faster_than_the_bound(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = rope(10, angle=rng.uniform(-4, 4, 10), rate=rng.normal(0, 30, 10) * rng.random(10) ** 3, gravity=None)
    assert np.abs(scene.rates).max() <= bound(scene)


def test_the_multipliers_are_the_tensions() -> None:
    scene, h = random_chain(6, seed=6, spread=1.5), 1e-5
    run = Run(scene)
    assert run.steps(h, 1) == 1
    found = -run.rows().force[1:-1] * scene.lengths
    expected = tensions(scene, scene.angles, scene.rates)
    assert found == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())  # they change by h W a step


def test_turns_are_counted_where_a_frame_holds_more_than_one() -> None:
    scene = chain(1, rate=100.0)
    times = 0.1 * np.arange(11)
    run = simulate(scene, "analytic", "frame", 0.1, times)
    theta, _ = single_pendulum(scene, times)
    assert np.diff(theta[:, 0]).min() > 2 * np.pi
    # A frequency is off by its (h W)^2 / 24.
    assert run.theta == pytest.approx(theta, abs=1.0)


@pytest.mark.parametrize(
    ("method", "most"),
    [("frame", f"{MOST_SUBSTEPS} steps"), ("rattle", f"{FINEST} parts"), ("adaptive_rattle", f"{FINEST} parts")],
)
def test_a_motion_that_asks_for_too_many_steps_is_a_status(method: str, most: str) -> None:
    scene = dataclasses.replace(rope(10), rates=np.linspace(-1e7, 1e7, 10))
    run = AnalyticEngine().build(scene, method, FRAME)
    run.advance(3)
    status, reason = run.health()
    assert status == "not converged"
    assert most in reason
    np.testing.assert_array_equal(run.state().theta, scene.angles)  # it stays where it was well
    run.advance(1)
    assert run.health() == (status, reason)


def test_what_a_failed_frame_leaves_is_the_start_of_it() -> None:
    run = Run(random_chain(3, seed=3))
    assert run.frames(1e-3, 1, 10) == (10, 1)
    run.rows().speed_x[:] *= 1e9
    kept, length = run.state.memory.copy(), run.state.steps[LAST]
    assert run.frames(1e-3, 1, 10) == (0, MOST_SUBSTEPS)
    np.testing.assert_array_equal(run.state.memory, kept)
    assert run.state.steps[LAST] == length
