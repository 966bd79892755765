"""Implicit steps with two threads: those of one, wherever the two meet, and whoever else works."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from pendbench.base.errors import InputError
from pendbench.engines.recording import simulate
from pendbench.solvers import closing, halves
from support.scenes import chain, random_chain

METHODS = ["implicit_euler", "bdf2", "energy_momentum"]
FRAME = 1 / 240

# A process that used its second thread, and another that came from it by a fork.
FORKED = """
import os, sys
import numpy as np
import pendbench as pb

def run():
    return pb.simulate("rope1000", method="bdf2", dt=1 / 240, times=[0.0, 1 / 240], threads=2).theta

before = run()
child = os.fork()
if child == 0:
    os._exit(0 if np.array_equal(run(), before) else 1)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


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


def test_what_one_thread_does_not_close_two_do_not():
    scene = random_chain(9, seed=3)
    its = closing.chain_of(scene.masses, scene.lengths, 9.81)
    for close in (closing.close, halves.close_halves):
        room = closing.room_for(scene.n)
        room.rows[closing.ANGLE, : scene.n] = scene.angles
        room.rows[closing.WANTED_X, 4] = np.nan
        assert not close(its, room, scene.angles.copy(), 1.0, 1e-9)


def test_runs_beside_each_other_keep_to_themselves():
    scenes = [random_chain(200, seed=seed, spread=1.0) for seed in range(4)]
    times = 1e-3 * np.arange(30)

    def run(scene, threads):
        return simulate(scene, method="bdf2", dt=1e-3, times=times, threads=threads).theta

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda scene: run(scene, 2), scenes))
    for scene, theta in zip(scenes, found, strict=True):
        np.testing.assert_allclose(theta, run(scene, 1), rtol=0, atol=1e-9)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_forked_process_has_a_second_thread_of_its_own():
    done = subprocess.run([sys.executable, "-c", FORKED], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("threads", [0, 3, 1.5])
def test_other_numbers_of_threads_are_refused(threads):
    with pytest.raises(InputError, match="threads"):
        simulate("double", method="bdf2", dt=1e-3, threads=threads)


def test_a_method_that_has_no_halves_takes_no_threads():
    with pytest.raises(InputError, match="threads"):
        simulate("double", method="rk4", dt=1e-3, threads=2)
