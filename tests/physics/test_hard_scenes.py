"""The hard scenes: our own equations and accurate methods have to hold where engines are tried."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from flint import ctx

import pendbench as pb
from pendbench.base.bundled import bundled
from pendbench.physics.energy import energy, energy_scale
from pendbench.physics.exact import normal_modes
from pendbench.physics.kernels.recursion import accelerations
from support.hard_chains import HARD, exact_accelerations, exact_by_tensions, hard_chains, largest, relative_error
from support.scenes import chain

SCENES = (
    *("graded_down", "graded_up", "tip_1e2", "tip_1e4", "tip_1e6", "tip_light", "alternating", "graded_lengths"),
    *("inverted", "inverted_nudged", "folded", "straight", "fast_spin", "fast_spin_free", "whip"),
    *("rope100", "rope200", "rope500", "chain1000", "many_turns", "long_single", "long_double"),
)
#: How long a scene is run here, s, where its own duration would take twice as long as any other's.
SHORTER = {"rope100": 2.0}
METHODS = ("adaptive", "taylor")
EPS = np.finfo(float).eps
PI_BEYOND = math.sin(math.pi)  # what pi is more than the nearest double


@cache
def run_of(name: str, method: str) -> pb.Trajectory:
    scene = pb.load_scene(name)
    times = np.linspace(0.0, SHORTER.get(name, scene.duration), 1001)
    return pb.simulate(scene, engine="analytic", method=method, times=times)


@pytest.mark.parametrize("kind", HARD)
def test_the_oracle_of_long_chains_agrees_with_the_dense_one(kind):
    for scene in hard_chains(kind, range(1)):
        exact = exact_accelerations(scene)
        with ctx.workdps(82):
            worst = largest(a - b for a, b in zip(exact_by_tensions(scene), exact, strict=True))
            assert worst < 1e-47 * largest(exact)


@pytest.mark.parametrize("name", SCENES)
def test_accelerations_keep_their_digits_all_along_the_run(name):
    """At the start and at 100 states of the run. Measured: 5e-15 at worst."""
    scene, run = pb.load_scene(name), run_of(name, "taylor")
    for theta, omega in zip(run.theta[::10], run.omega[::10], strict=True):
        exact = exact_by_tensions(scene.with_start(theta, omega))
        assert relative_error(accelerations(scene, theta, omega), exact) < 1e-12


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", SCENES)
def test_accurate_methods_keep_the_energy(name, method):
    """Measured: 2e-11 at worst, but for the rounding of a million turns, which is worth 2e-9."""
    scene, run = pb.load_scene(name), run_of(name, method)
    assert (run.status, run.t[-1]) == ("ok", SHORTER.get(name, scene.duration))
    found = energy(scene, run.theta, run.omega)
    assert np.abs(found - found[0]).max() / energy_scale(scene) < 1e-8


@pytest.mark.parametrize("name", sorted(set(SCENES) - {"long_double"}))
def test_accurate_methods_go_the_same_way(name):
    """The energy of the light links is lost beside that of heavy ones, their way is not.

    A quarter of the run lies before the horizon of every scene but the long chaotic one.
    """
    adaptive, taylor = (run_of(name, method) for method in METHODS)
    assert np.abs(adaptive.theta[:251] - taylor.theta[:251]).max() < 1e-6


@pytest.mark.parametrize("method", METHODS)
def test_a_chain_without_gravity_keeps_its_angular_momentum(method):
    scene, run = pb.load_scene("fast_spin_free"), run_of("fast_spin_free", method)
    found = pb.physics.energy.angular_momentum(scene, run.theta, run.omega)
    assert np.abs(found / found[0] - 1).max() < 1e-12


@pytest.mark.parametrize("method", METHODS)
def test_balanced_chain_stands_until_rounding_has_grown(method):
    """Upside down, small oscillations grow at the rates that are their frequencies otherwise, (E28) with -g for g.

    A rounding of pi, 2 eps, takes 0.79 of ln(1/eps) over the fastest rate to reach 1e-3 rad. Measured: Taylor's method
    0.94 and the adaptive one 1.03, the fastest mode being only a part of what they round.
    """
    scene = pb.load_scene("inverted")
    fastest = normal_modes(scene)[0][-1]
    run = run_of("inverted", method)
    moved = np.abs(run.theta - math.pi).max(axis=1)
    assert run.t[moved > 1e-3][0] > 0.79 * math.log(1 / EPS) / fastest
    assert moved[-1] > 1.0


@pytest.mark.parametrize("method", METHODS)
def test_nudged_chain_falls_as_small_oscillations_grow(method):
    """(E28) with -g for g, up to 1e-4 rad, where what it leaves out is 1e-8 of it.

    Measured: 1e-6. The first roundings of pi are a few parts in ten million of the nudge.
    """
    scene, run = pb.load_scene("inverted_nudged"), run_of("inverted_nudged", method)
    rates, shapes = normal_modes(scene)
    parts = np.linalg.solve(shapes, (scene.angles - math.pi) - PI_BEYOND)
    early = run.t < 0.65
    expected = (np.cosh(run.t[early, None] * rates) * parts) @ shapes.T
    moved = (run.theta[early] - math.pi) - PI_BEYOND
    largest = np.abs(expected).max(axis=1)
    assert 1e-4 < largest[-1] < 2e-4
    assert (np.abs(moved - expected).max(axis=1) < 5e-6 * largest).all()


def test_error_that_is_rounding_alone_does_not_shorten_the_steps():
    """Angles of a million turns have lost half their digits. Trying for 1e-14 all the same took seven million steps."""
    turns = 2e6 * math.pi * np.array([1.0, -1.0, 1.0])
    runs = [pb.simulate(chain(3, angle=a), engine="analytic", times=[1.0]) for a in (math.pi / 2, turns + math.pi / 2)]
    assert [run.status for run in runs] == ["ok", "ok"]
    assert runs[1].steps <= runs[0].steps
    assert np.abs((runs[1].theta - turns) - runs[0].theta).max() < 1e-7  # measured: 2e-8


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_begins_with_what_makes_it_hard(name):
    lines = (bundled("models") / f"{name}.toml").read_text(encoding="utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    assert 1 <= len(comments) <= 2
    assert lines[: len(comments)] == comments
    assert lines[len(comments)].startswith("title ")
