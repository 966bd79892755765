"""Model files read as scenes: the same accelerations as MuJoCo's, the same scene after a round trip."""

from __future__ import annotations

import dataclasses
import math
import pickle
import shutil
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pendbench import load_scene
from pendbench.base.bundled import bundled, bundled_names
from pendbench.base.errors import InputError
from pendbench.engines.mujoco.mjcf import fits_file, write_mjcf
from pendbench.physics.dense import accelerations
from pendbench.scene.models.check import check_forces
from pendbench.scene.models.plane import read_chain
from pendbench.scene.models.read import read_model
from pendbench.scene.models.start import start_of
from pendbench.study.plan import load_plan
from support.model_accelerations import worst_difference
from support.random_models import random_mjcf

IN_FILES = [name for name in bundled_names("models") if fits_file(load_scene(name))]


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 7))
def test_random_chains_accelerate_as_in_mujoco(seed, n, tmp_path_factory):
    path = write(tmp_path_factory.mktemp("random"), random_mjcf(seed, n))
    assert worst_difference(path, states=3, seed=seed) < 1e-9


@pytest.mark.parametrize("name", IN_FILES)
def test_the_round_trip_through_a_file_gives_the_same_scene(name, tmp_path):
    scene = load_scene(name)
    (tmp_path / f"{name}.xml").write_text(write_mjcf(scene), "utf-8")
    again = load_scene(tmp_path / f"{name}.xml")
    assert (again.name, again.title, again.duration) == (scene.name, scene.title, scene.duration)
    for array in ("masses", "lengths"):
        np.testing.assert_allclose(getattr(again, array), getattr(scene, array), rtol=1e-13)
    for array in ("angles", "rates"):
        size = abs(getattr(scene, array)).max()
        np.testing.assert_allclose(getattr(again, array), getattr(scene, array), rtol=0, atol=1e-13 * size)
    assert again.terms.keys() == scene.terms.keys()
    for effect in scene.terms:
        ours, theirs = (np.broadcast_to(getattr(s.effects, effect), scene.n) for s in (again, scene))
        np.testing.assert_allclose(ours, theirs, rtol=1e-12)


def write(folder, text):
    (folder / "model.xml").write_text(text, "utf-8")
    return folder / "model.xml"


ONE = """<mujoco><option gravity="{gravity}"/><worldbody><body{frame}>
<joint axis="{axis}" pos="0 0 0"/><inertial pos="0 0 -0.5" mass="2" diaginertia="1e-15 1e-15 1e-15"/>
</body></worldbody></mujoco>"""


def one(folder, gravity="0 0 -9.81", axis="0 -1 0", frame=""):
    return read_model(write(folder, ONE.format(gravity=gravity, axis=axis, frame=frame)))


@pytest.mark.parametrize(
    ("gravity", "angle", "strength"),
    [
        ("0 0 -9.81", 0.0, 9.81),
        ("0 0 9.81", math.pi, 9.81),
        ("3 0 -4", -math.atan2(3, 4), 5.0),  # down is where gravity points, right of the world's -z
        ("3 7 -4", -math.atan2(3, 4), 5.0),
        ("0 0 0", 0.0, None),
        ("0 -9.81 0", 0.0, None),
    ],
)
def test_angles_are_from_where_gravity_points_in_the_plane(tmp_path, gravity, angle, strength):
    scene = one(tmp_path, gravity).scene
    assert math.remainder(scene.angles[0] - angle, math.tau) == pytest.approx(0.0, abs=1e-15)
    assert scene.effects.gravity == (strength if strength is None else pytest.approx(strength, rel=1e-15))
    assert scene.masses[0] == 2.0
    assert scene.lengths[0] == pytest.approx(0.5, rel=1e-14)


def test_gravity_along_the_axes_does_nothing_and_is_said(tmp_path):
    assert "7 m/s^2 of gravity is along the axes" in one(tmp_path, "3 7 -4").notes[0]
    assert "all of gravity is along the axes" in one(tmp_path, "0 7 0").notes[0]
    assert not one(tmp_path).notes


def test_notes_go_with_the_scene_and_its_text(tmp_path):
    scene = one(tmp_path, "3 7 -4").scene
    assert scene.with_start([0.1], [0.2]).notes == scene.notes == pickle.loads(pickle.dumps(scene)).notes
    assert scene.to_toml().startswith(
        "# 7 m/s^2 of gravity is along the axes: left out, it does nothing in the plane\n"
    )
    (tmp_path / "text.toml").write_text(scene.to_toml())
    assert load_scene(tmp_path / "text.toml").digest == scene.digest


def test_the_plane_is_seen_from_where_the_first_axis_points(tmp_path):
    seen = one(tmp_path, "0.1 0 -9.81").scene.angles[0]
    assert one(tmp_path, "0.1 0 -9.81", axis="0 1 0").scene.angles[0] == pytest.approx(-seen, rel=1e-12)
    assert one(tmp_path, frame=' euler="0 30 0"').scene.angles[0] == pytest.approx(-math.radians(30), rel=1e-12)


def test_the_start_is_the_first_keyframe_another_by_name_or_the_reference_pose(tmp_path):
    text = ONE.format(gravity="0 0 -9.81", axis="0 -1 0", frame="")
    assert read_model(write(tmp_path, text)).keyframe is None
    keys = '<keyframe><key name="a" qpos="0.5" qvel="2"/><key name="b" qpos="1.5"/></keyframe></mujoco>'
    path = write(tmp_path, text.replace("</mujoco>", keys))
    first, other = read_model(path), read_model(path, keyframe="b")
    assert (first.keyframe, first.scene.angles[0], first.scene.rates[0]) == ("a", 0.5, 2.0)
    assert (other.keyframe, other.scene.angles[0], other.scene.rates[0]) == ("b", 1.5, 0.0)
    with pytest.raises(ValueError, match="unknown keyframe 'c'; allowed: a, b"):
        read_model(path, keyframe="c")


@pytest.mark.parametrize("seed", range(20))
def test_joint_coordinates_become_angles_and_back(seed):
    read = read_chain(mujoco.MjModel.from_xml_string(random_mjcf(seed, 5)))
    rng = np.random.default_rng(seed)
    coordinates, velocities = rng.uniform(-9, 9, (4, 5)), rng.uniform(-9, 9, (4, 5))
    joints = read.joints
    np.testing.assert_allclose(joints.coordinates(joints.angles(coordinates)), coordinates, rtol=0, atol=1e-13)
    np.testing.assert_allclose(joints.velocities(joints.rates(velocities)), velocities, rtol=0, atol=1e-13)


def test_the_file_as_it_stands_is_at_hand():
    model = read_model(bundled("models") / "mjcf" / "rods_triple.xml")
    assert (model.integrator, model.timestep, model.keyframe) == ("rk4", 1e-3, "start")
    assert {"contact", "spring", "damper"} <= set(model.disabled)
    assert model.compile().nq == 3


@pytest.mark.parametrize("file", ["arm.xml", "rope.xml", "crane.urdf", "toy.xml"])
def test_our_own_models_of_real_things(file):
    path = bundled("models") / "real" / file
    model = read_model(path)
    assert worst_difference(path, states=5, seed=1) < 1e-9
    theirs = mujoco.MjData(model.compile())
    theirs.qpos[:] = model.joints.coordinates(model.scene.angles)
    theirs.qvel[:] = model.joints.velocities(model.scene.rates)
    mujoco.mj_forward(model.compile(), theirs)
    ours = accelerations(model.scene, model.scene.angles, model.scene.rates)
    np.testing.assert_allclose(ours, model.joints.rates(theirs.qacc), rtol=1e-9, atol=1e-9 * abs(ours).max())


@pytest.mark.parametrize("wrong", ["masses", "centres", "inertias", "damping", "stiffness", "rests", "armature"])
def test_what_was_not_understood_shows_in_the_forces(wrong):
    model = mujoco.MjModel.from_xml_string(random_mjcf(3, 4))
    read, start = read_chain(model), start_of(model, None)
    check_forces(model, start, read)
    changed = dataclasses.replace(read.chain, **{wrong: getattr(read.chain, wrong) + 1e-3})
    with pytest.raises(InputError, match="MuJoCo's accelerations are not those of the chain in it, by "):
        check_forces(model, start, dataclasses.replace(read, chain=changed))


def test_a_study_takes_a_model_file_beside_it_and_one_in_place_of_its_scenes(tmp_path):
    toy = bundled("models") / "real" / "toy.xml"
    shutil.copy(toy, tmp_path / "mine.xml")
    study = tmp_path / "study.toml"
    study.write_text('kind = "chaos"\nscenes = ["mine.xml", "double"]\n')
    assert [(scene.name, scene.n) for scene in load_plan(study).scenes] == [("mine", 2), ("double", 2)]
    assert [scene.name for scene in load_plan("chaos", scenes=[load_scene(toy)]).scenes] == ["toy"]


def test_reading_a_scene_of_toml_loads_no_mujoco():
    told = "import sys; from pendbench import load_scene; load_scene('double'); print('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True).stdout == "False\n"
