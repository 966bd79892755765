"""Implicit steps with two threads: those of one, wherever the two meet, and whoever else works."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from pendbench.base.errors import InputError
from pendbench.base.second_thread import both as share
from pendbench.engines.recording import simulate
from pendbench.solvers import closing, halves
from support.kernels import called
from support.scenes import chain, random_chain

METHODS = ["implicit_euler", "bdf2", "energy_momentum"]
FRAME = 1 / 240


def both(scene, method, dt, steps):
    """The angles and rates with one thread, and with two."""
    times = dt * np.arange(steps + 1)
    runs = [simulate(scene, method=method, dt=dt, times=times, threads=count) for count in (1, 2)]
    assert [run.status for run in runs] == ["ok", "ok"]
    return [np.stack([run.theta, run.omega]) for run in runs]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 40, 301])
def test_two_threads_take_the_steps_of_one(n, method):
    one, two = both(random_chain(n, seed=n, spread=1.0), method, 1e-3, 20)
    np.testing.assert_allclose(two, one, rtol=0, atol=1e-9 * np.abs(one).max())


def test_so_they_do_where_steps_are_cut_and_a_whip_cracks():
    one, two = both(chain(60, mass=1 / 60, angle=np.pi / 2), "bdf2", FRAME, 130)
    assert np.abs(np.diff(one[0], axis=0)).max() > 0.5, "nothing cracked"
    np.testing.assert_allclose(two[0, :100], one[0, :100], rtol=0, atol=1e-9)


def closing_of(scene, wanted=None, angles=None):
    """A chain, its angles before, and room with a guess."""
    rng, room = np.random.default_rng(scene.n), closing.room_for(scene.n)
    room.rows[closing.ANGLE, : scene.n] = scene.angles if angles is None else angles
    room.rows[closing.PULL, : scene.n] = rng.uniform(0.0, 0.5, scene.n)
    directions = np.stack([np.sin(scene.angles), -np.cos(scene.angles)])
    given = scene.lengths * directions + rng.uniform(-1e-3, 1e-3, (2, scene.n)) if wanted is None else wanted
    room.rows[closing.WANTED_X : closing.WANTED_Y + 1, : scene.n] = given
    return closing.chain_of(scene.masses, scene.lengths, 9.81), room


@pytest.mark.parametrize("share", [0.5, 1.0])
@pytest.mark.parametrize("far", range(9))
def test_an_iteration_is_that_of_one_thread_wherever_the_largest_turn_is(far, share):
    scene = random_chain(9, seed=1)
    angles = scene.angles.copy()
    angles[far] += 0.3
    found = []
    for iterate in (called(closing._iterate), halves._iterate):
        chain_, room = closing_of(scene, angles=angles)
        found.append((iterate(chain_, room, scene.angles.copy(), share), room.rows.copy()))
    assert found[1][0] == pytest.approx(found[0][0], rel=1e-12)
    np.testing.assert_allclose(found[1][1], found[0][1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("case", ["nan", "far", "near", "digits"])
def test_what_one_thread_closes_two_do_and_what_not_they_leave_alike(case):
    scene = random_chain(9, seed=3)
    angles = {"far": scene.angles + 3.0 * np.arange(9), "near": scene.angles + 1e-3}.get(case, scene.angles)
    tolerance = 0.0 if case == "digits" else 1e-9
    found = []
    for close in (closing.close, halves.close_halves):
        chain_, room = closing_of(scene, angles=angles)
        room.rows[closing.WANTED_X, 4] += np.nan if case == "nan" else 0.0
        found.append((close(chain_, room, scene.angles.copy(), 1.0, tolerance), room.rows.copy()))
    assert found[0][0] == found[1][0] == (case in {"near", "digits"})
    np.testing.assert_allclose(found[1][1], found[0][1], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("turns", "expected"), [((1.0, 3.0, 2.0), 3.0), ((0.0, 0.0, 0.0), 0.0)])
def test_the_largest_turn_is_that_of_any_part(turns, expected):
    assert halves.largest(*turns) == expected
    for at in range(3):
        assert math.isnan(halves.largest(*turns[:at], math.nan, *turns[at + 1 :]))


def test_newton_s_method_is_given_up_where_it_grows_or_flies():
    assert not closing.lost(1.0, 0.1, 2)
    assert closing.lost(1.0, 0.1, 3)
    assert not closing.lost(0.1, 1.0, 3)
    assert closing.lost(31.0, np.inf, 0)
    assert closing.lost(math.nan, np.inf, 0)


def test_it_ends_where_changes_are_small_or_digits_end():
    assert closing.closed(1e-9, 1.0, 1e-9)
    assert closing.closed(1e-8, 1e-8, 1e-9)
    assert not closing.closed(1e-8, 1e-7, 1e-9)
    assert not closing.closed(1e-2, 1e-3, 1e-9)
    assert not closing.closed(math.nan, 1e-8, 1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_work_is_shared_where_that_is_asked_for_and_nowhere_else(method, monkeypatch):
    scene, shared = random_chain(50, seed=1), []
    monkeypatch.setattr(halves, "both", lambda kernel, *each: shared.append(kernel) or share(kernel, *each))
    simulate(scene, method=method, dt=1e-3, times=[0.0, 0.01])
    assert not shared
    simulate(scene, method=method, dt=1e-3, times=[0.0, 0.01], threads=2)
    assert {halves._eliminate_half, halves._substitute_half} < set(shared)


def test_both_threads_run_at_the_same_time():
    kernels = [kernel for kernel in vars(halves).values() if hasattr(kernel, "targetoptions")]
    its = [kernel for kernel in kernels if kernel.py_func.__module__ == halves.__name__]
    assert len(its) == 10
    assert all(kernel.targetoptions["nogil"] for kernel in its)


def test_runs_beside_each_other_keep_to_themselves():
    scenes = [random_chain(200, seed=seed, spread=1.0) for seed in range(4)]
    times = 1e-3 * np.arange(30)

    def run(scene, threads):
        return simulate(scene, method="bdf2", dt=1e-3, times=times, threads=threads).theta

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda scene: run(scene, 2), scenes))
    for scene, theta in zip(scenes, found, strict=True):
        np.testing.assert_allclose(theta, run(scene, 1), rtol=0, atol=1e-9)


@pytest.mark.parametrize("threads", [0, 3, 1.5])
def test_other_numbers_of_threads_are_refused(threads):
    with pytest.raises(InputError, match="threads"):
        simulate("double", method="bdf2", dt=1e-3, threads=threads)


def test_a_method_that_has_no_halves_takes_no_threads():
    with pytest.raises(InputError, match="threads"):
        simulate("double", method="rk4", dt=1e-3, threads=2)
