"""Runs in files come back as they were, and a file that is damaged or somebody else's is one line."""

from __future__ import annotations

import dataclasses
import gc
import json
import os
import pickle
import zipfile
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import pendbench as pb
from pendbench.base.errors import InputError
from pendbench.scene.trajectory import Trajectory

LINKS = {"mass": [1.2, 0.8], "centre": [0.25, 0.18], "inertia": [0.02, 0.006]}
SCENES = {
    "everything": lambda: pb.load_scene("everything"),
    "rigid links": lambda: pb.Scene.chain(
        length=[0.5, 0.4], links=LINKS, angles=1.0, gravity=9.81, air_drag={"linear": 0.1}
    ),
    "nothing acts": lambda: pb.Scene.chain(n=3, length=0.1, mass=1.0, angles=[0.1, 0.2, 0.3], rates=1.0),
}


@pytest.fixture
def saved(tmp_path):
    run = pb.simulate("double", engine="mujoco", method="rk4", dt=1e-3, times=np.linspace(0.0, 0.1, 11))
    run.save(tmp_path / "run.npz")
    return tmp_path / "run.npz"


def assert_same(found: Trajectory, run: Trajectory) -> None:
    for name in ("t", "theta", "omega", "gap"):
        np.testing.assert_array_equal(getattr(found, name), getattr(run, name))
    assert (found.status, found.reason, found.steps) == (run.status, run.reason, run.steps)
    assert found.maker == run.maker
    assert repr(found) == repr(run)


@pytest.mark.parametrize("name", SCENES)
def test_a_run_comes_back_with_its_scene(tmp_path, name):
    scene = SCENES[name]()
    run = pb.simulate(scene, engine="pymunk", method="tuned", dt=1e-2, times=[0.0, 0.05], iterations=20)
    run.save(tmp_path / "a" / "run.npz")
    found = pb.load_run(tmp_path / "a" / "run.npz")
    assert_same(found, run)
    assert (found.scene.digest, found.scene.name, found.scene.title) == (scene.digest, scene.name, scene.title)
    assert found.scene.effects == scene.effects
    assert found.maker.settings == (("iterations", 20.0),)
    assert dict(found.maker.versions).keys() == {"pendbench", "pymunk"}
    np.testing.assert_array_equal(found.energy, run.energy)


def test_a_run_that_failed_and_one_without_a_scene(tmp_path):
    empty = np.empty((0, 2))
    for run in (
        pb.simulate("damped_double", engine="pymunk", method="tuned", dt=1e-2, times=[0.0]),
        Trajectory(np.empty(0), empty, empty, np.empty(0), "refused", "why\nnot", None),
    ):
        run.save(tmp_path / "run.npz")
        assert_same(pb.load_run(tmp_path / "run.npz"), run)
    with pytest.raises(InputError, match="does not say which scene"):
        _ = pb.load_run(tmp_path / "run.npz").positions


def test_the_file_is_plain_numpy_and_text(saved):
    with np.load(saved, allow_pickle=False) as arrays:
        assert {*arrays} > {"t", "theta", "omega", "gap", "about", "scene_masses"}
        about = json.loads(str(arrays["about"]))
    assert (about["format"], about["maker"]["engine"], about["scene"]["effects"]) == (
        "pendbench run", "mujoco", {"gravity": 9.81},
    )  # fmt: skip


def refusal(path: object) -> str:
    with pytest.raises(InputError) as caught:
        pb.load_run(path)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def changed(path, **arrays):
    """The file with some of its arrays changed, or without those that are None."""
    with np.load(path) as found:
        kept = {key: found[key] for key in found} | arrays
    np.savez(path, **{key: value for key, value in kept.items() if value is not None})


def about(path, **changes) -> np.ndarray:
    with np.load(path) as found:
        return np.array(json.dumps(json.loads(str(found["about"])) | changes))


ARRAYS = {
    "no samples": {"theta": None},
    "samples that do not agree": {"t": np.arange(3.0)},
    "angles in the wrong shape": {"theta": np.zeros(11), "omega": np.zeros(11)},
    "another chain's": {"theta": np.zeros((11, 3)), "omega": np.zeros((11, 3))},
    "whole numbers": {"gap": np.arange(11)},
    "text for numbers": {"gap": np.array(["x"] * 11)},
    "no text": {"about": None},
    "text that is no JSON": {"about": np.array("{")},
    "JSON that is no table": {"about": np.array("[1]")},
}
ABOUT = {
    "somebody else's": {"format": "other"},
    "a status there is not": {"status": "fine"},
    "half a step": {"steps": 0.5},
    "no maker's name": {"maker": {"method": "rk4"}},
    "a step of text": {"maker": {"engine": "a", "method": "b", "dt": "x", "settings": [], "versions": []}},
    "a scene of text": {"scene": "double"},
    "a scene with more": {"scene": {"name": "a", "more": 1}},
}


@pytest.mark.parametrize("case", [*ARRAYS, *ABOUT])
def test_what_is_damaged_is_one_line(saved, case):
    changed(saved, **(ARRAYS[case] if case in ARRAYS else {"about": about(saved, **ABOUT[case])}))
    assert refusal(saved) == f"{saved}: damaged, or not a run that Trajectory.save wrote"


def test_a_file_that_cannot_be_used_is_one_line(saved, tmp_path):
    damaged = f"{saved}: damaged, or not a run that Trajectory.save wrote"
    content = saved.read_bytes()
    for other in (b"", b"PK\x03\x04", content[: len(content) // 2], b"t,theta\n0,1\n", pickle.dumps(os.getcwd)):
        saved.write_bytes(other)
        assert refusal(saved) == damaged
    gc.collect()  # a file that was left open would be told of here
    np.save(tmp_path / "run.npy", np.zeros(3))
    (tmp_path / "run.npy").rename(saved)
    assert refusal(saved) == damaged
    with zipfile.ZipFile(saved, "w") as file:
        file.writestr("t.npy", pickle.dumps(3))
    assert refusal(saved) == damaged
    assert refusal(tmp_path / "nosuch.npz") == f"{tmp_path / 'nosuch.npz'}: no such file"
    assert refusal(tmp_path) == f"{tmp_path}: not a regular file"
    assert refusal(5) == "5 is not a path"


def test_a_run_of_a_format_to_come_says_so(saved):
    changed(saved, about=about(saved, version=2))
    assert refusal(saved) == f"{saved}: a run of version 2 of the format; this pendbench reads 1"


def test_a_scene_that_cannot_be_is_said(saved):
    changed(saved, scene_masses=np.array([1.0, -1.0]))
    assert "scene 'double': masses, entry 2, is -1.0; allowed: " in refusal(saved)


@pytest.mark.parametrize(
    ("entry", "time", "said"),
    [(3, 0.01, "4, is 0.01"), (10, 0.09, "11, is 0.09"), (0, np.nan, "1, is nan"), (10, np.inf, "11, is inf")],
)
def test_times_that_fall_or_stand_are_said(saved, entry, time, said):
    run = pb.load_run(saved)
    times = run.t.copy()
    times[entry] = time
    wanted = f"t, entry {said}; allowed: finite times, each later than the one before, s"
    changed(saved, t=times)
    assert refusal(saved) == f"{saved}: {wanted}"
    with pytest.raises(InputError) as caught:
        dataclasses.replace(run, t=times).save(saved)
    assert str(caught.value) == wanted


@given(st.data())
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damage_anywhere_is_one_line_or_the_same_run(saved, data):
    content = bytearray(saved.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    other = saved.with_name("other.npz")
    other.write_bytes(content)
    with suppress(InputError):
        assert_same(pb.load_run(other), pb.load_run(saved))


def test_where_a_run_cannot_be_written_is_one_line(saved, tmp_path):
    run = pb.load_run(saved)
    with pytest.raises(InputError, match=r"allowed: a name that ends in \.npz"):
        run.save(tmp_path / "run.csv")
    with pytest.raises(InputError, match="cannot be written: "):
        run.save(saved / "run.npz")
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]


def test_a_reference_is_saved_as_the_run_that_it_is(tmp_path):
    truth = pb.reference("double", [0.0, 0.5])
    truth.save(tmp_path / "truth.npz")
    found = pb.load_run(tmp_path / "truth.npz")
    assert type(found) is Trajectory
    assert str(found.maker) == "reference 32 digits"
    assert dataclasses.replace(found, maker=None).scene.digest == truth.scene.digest
