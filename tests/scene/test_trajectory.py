"""What a run tells of itself: where its masses are, its energy, a table, a picture, one line."""

from __future__ import annotations

import numpy as np
import pytest

import pendbench as pb
from pendbench.physics.energy import energy_scale


@pytest.fixture(scope="module")
def run():
    return pb.simulate("triple", engine="mujoco", method="rk4", dt=1e-3, times=np.linspace(0.0, 0.2, 21))


def test_positions_are_those_of_the_rods_ends(run):
    place = run.positions
    assert place.shape == (21, 3, 2)
    rods = np.diff(np.concatenate([np.zeros((21, 1, 2)), place], axis=1), axis=1)
    np.testing.assert_allclose(np.hypot(*np.moveaxis(rods, -1, 0)), np.tile(run.scene.lengths, (21, 1)), rtol=1e-14)
    np.testing.assert_allclose(np.arctan2(rods[..., 0], -rods[..., 1]), run.theta, atol=1e-14)


def test_energy_is_that_of_the_public_function(run):
    np.testing.assert_array_equal(run.energy, pb.energy("triple", run.theta, run.omega))
    assert np.ptp(run.energy) < 1e-9 * energy_scale(run.scene)


def test_a_table_has_a_row_for_each_sample(run):
    table = run.to_frame()
    assert [*table] == [
        "t", *(f"{name}_{i}" for name in ("theta", "omega", "x", "y") for i in (1, 2, 3)), "energy", "gap",
    ]  # fmt: skip
    assert len(table) == 21
    np.testing.assert_array_equal(table["y_3"], run.positions[:, 2, 1])
    np.testing.assert_array_equal(table["omega_2"], run.omega[:, 1])


def test_a_picture_shows_angles_and_the_path(run, tmp_path):
    figure = run.plot()
    angles, plane = figure.axes
    assert len(angles.lines) == 3
    np.testing.assert_array_equal(angles.lines[1].get_ydata(), run.theta[:, 1])
    np.testing.assert_array_equal(plane.lines[0].get_xdata(), run.positions[:, -1, 0])
    assert figure.get_suptitle() == "triple, mujoco rk4 dt=0.001: ok"
    figure.savefig(tmp_path / "run.png")


def test_a_run_without_samples_has_a_picture_too():
    empty = np.empty((0, 2))
    run = pb.Trajectory(np.empty(0), empty, empty, np.empty(0), "refused", "it cannot", scene=pb.load_scene("double"))
    assert len(run.plot().axes) == 2
    assert len(run.to_frame()) == 0


def test_a_run_is_one_line_however_long_it_is():
    scene = pb.Scene.chain(n=1000, length=1e-3, mass=1e-3, angles=np.linspace(0.0, 1.0, 1000), gravity=9.81)
    assert repr(scene) == "<Scene 'chain': 1000 links, 1 m, 10 s, gravity>"
    run = pb.simulate(scene, engine="analytic", method="rk4", dt=1e-5, times=[0.0, 1e-5])
    said = "<Trajectory of 'chain' by analytic rk4 dt=1e-05: 2 samples of 1000 links, 0 to 1e-05 s, ok>"
    assert repr(run) == said
    truth = pb.reference("single", [0.0, 1.0])
    assert repr(truth) == "<Truth of 'single' by reference 32 digits: 2 samples of 1 link, 0 to 1 s, ok>"


def test_what_made_a_run_is_what_was_asked_for(run):
    maker = run.maker
    assert (maker.engine, maker.method, maker.dt, maker.settings) == ("mujoco", "rk4", 1e-3, ())
    assert dict(maker.versions)["pendbench"] == pb.__version__
    tuned = pb.simulate("single", "pymunk", "tuned", 1e-3, [0.0], iterations=7)
    assert str(tuned.maker) == "pymunk tuned dt=0.001 iterations=7"
