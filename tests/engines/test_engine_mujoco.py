"""The MuJoCo adapter and its MJCF files: the same equations as ours, to rounding, and honest about what goes wrong."""

from __future__ import annotations

import dataclasses
import shutil
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest

from pendbench.base.bundled import bundled, bundled_names
from pendbench.base.errors import InputError
from pendbench.base.faults import Fault
from pendbench.engines.mujoco import mjcf
from pendbench.engines.mujoco import run as running
from pendbench.engines.mujoco.adapter import MujocoEngine
from pendbench.physics.dense import accelerations
from pendbench.scene.scene import Effects, Scene, load_scene
from support.scenes import chain, random_chain

ENGINE = MujocoEngine()
AUTORESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def after(scene: Scene, method: str, dt: float, steps: int):
    run = ENGINE.build(scene, method, dt)
    run.advance(steps)
    return run.state()


def one_step_accelerations(scene: Scene):
    """A semi-implicit Euler step of 1 s adds theta'' of the start to the rates, without a difference quotient."""
    return after(scene, "euler", 1.0, 1).omega - scene.rates


# Measured: 5e-15 (n = 5), 2e-12 (20), 2e-9 (100), 9e-7 (600): MuJoCo's mass matrix and its factors lose digits with n.
@pytest.mark.parametrize(("n", "allowed"), [(1, 1e-15), (2, 1e-14), (5, 1e-13), (20, 1e-10), (100, 1e-7), (600, 1e-4)])
def test_accelerations_are_those_of_point_masses_on_massless_rods(n, allowed):
    scene = random_chain(n, seed=n)
    exact = accelerations(scene, scene.angles, scene.rates)
    np.testing.assert_allclose(one_step_accelerations(scene), exact, rtol=0, atol=allowed * np.abs(exact).max())


def test_bodies_are_point_masses():
    model = mjcf.compile_chain(random_chain(5, seed=1))
    assert not model.body_inertia.any()


def dense_euler(scene: Scene, dt: float, steps: int):
    theta, omega = scene.angles, scene.rates
    for _ in range(steps):
        omega = omega + dt * accelerations(scene, theta, omega)
        theta = theta + dt * omega
    return theta, omega


def dense_rk4(scene: Scene, dt: float, steps: int):
    def slope(y):
        return np.concatenate([y[scene.n :], accelerations(scene, y[: scene.n], y[scene.n :])])

    y = np.concatenate([scene.angles, scene.rates])
    for _ in range(steps):
        a = slope(y)
        b = slope(y + dt / 2 * a)
        c = slope(y + dt / 2 * b)
        d = slope(y + dt * c)
        y = y + dt / 6 * (a + 2 * b + 2 * c + d)
    return y[: scene.n], y[scene.n :]


@pytest.mark.parametrize(("method", "ours"), [("euler", dense_euler), ("rk4", dense_rk4)])
def test_a_method_is_the_textbook_method_on_the_same_equations(method, ours):
    scene = random_chain(5, seed=2)
    found = after(scene, method, 2e-3, 300)
    theta, omega = ours(scene, 2e-3, 300)
    # Rounding, multiplied by the chain over 0.6 s: measured 1e-14, where the methods' own errors are above 1e-8.
    np.testing.assert_allclose(found.theta, theta, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.omega, omega, rtol=0, atol=1e-12)


def test_implicitfast_is_euler_where_nothing_is_damped():
    scene = random_chain(4, seed=3)
    fast, euler = after(scene, "implicitfast", 1e-3, 200), after(scene, "euler", 1e-3, 200)
    np.testing.assert_array_equal(fast.theta, euler.theta)
    np.testing.assert_array_equal(fast.omega, euler.omega)


def test_euler_follows_stiff_damping_with_steps_far_longer():
    """5000 N m s/rad on 1 kg at 1 m: theta from Radau with a tolerance of 1e-12. It is implicit in the damper."""
    stiff = dataclasses.replace(chain(1, length=1.0, angle=1.5), effects=Effects(gravity=9.81, joint_damping=5000.0))
    assert after(stiff, "euler", 1e-3, 1000).theta[0] == pytest.approx(1.49804344, abs=1e-8)
    assert after(stiff, "euler", 1e-3, 2000).theta[0] == pytest.approx(1.49608677, abs=1e-8)


@pytest.mark.skipif("discrete" not in ENGINE.methods, reason="new in MuJoCo 3.13")
def test_discrete_is_euler_with_the_spring_and_the_damper_of_the_end_of_the_step():
    spring, damper, h = 40.0, 3.0, 1e-2
    effects = Effects(gravity=9.81, joint_stiffness=spring, joint_damping=damper)
    scene = dataclasses.replace(chain(1, angle=0.7, rate=-1.0), effects=effects)
    theta, omega = 0.7, -1.0
    for _ in range(50):  # of a mass of 1 kg at 1 m
        torque = -9.81 * np.sin(theta) - spring * (theta + h * omega) - damper * omega
        omega += h * torque / (1.0 + h * damper + h**2 * spring)
        theta += h * omega
    found = after(scene, "discrete", h, 50)
    assert found.theta[0] == pytest.approx(theta, rel=1e-12)
    assert found.omega[0] == pytest.approx(omega, rel=1e-12)


@pytest.mark.skipif("discrete" not in ENGINE.methods, reason="new in MuJoCo 3.13")
def test_discrete_stays_where_a_stiff_spring_throws_euler_out():
    stiff = dataclasses.replace(chain(2, angle=1.0), effects=Effects(joint_stiffness=1e5))
    calm, wild = (after(stiff, method, 1e-2, 100) for method in ("discrete", "euler"))
    assert np.abs(calm.theta).max() < 2.0
    assert not np.abs(wild.theta).max() < 100.0


@pytest.mark.parametrize("method", ENGINE.methods)
def test_long_chains_have_the_memory_they_need(method):
    run = ENGINE.build(chain(600), method, 1e-4)
    run.advance(1)
    assert run.health() is None


def test_what_is_disabled_does_not_change_a_bit():
    scene = random_chain(5, seed=4)
    bare, full = (ENGINE.build(scene, "rk4", 1e-3) for _ in range(2))
    full._model.opt.disableflags = AUTORESET
    bare.advance(200)
    full.advance(200)
    np.testing.assert_array_equal(bare.state().omega, full.state().omega)


def test_without_gravity_nothing_pulls():
    model = mjcf.compile_chain(chain(2, gravity=None))
    assert not model.opt.gravity.any()
    assert model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    absent, zero = (after(chain(3, angle=1.0, rate=[1, -2, 3], gravity=g), "rk4", 1e-3, 300) for g in (None, 0.0))
    np.testing.assert_array_equal(absent.theta, zero.theta)


def test_units_of_mass_that_are_powers_of_two_change_no_bit():
    scene = random_chain(4, seed=5)
    other = dataclasses.replace(scene, masses=scene.masses * 2.0**-40)
    np.testing.assert_array_equal(after(scene, "rk4", 1e-3, 100).omega, after(other, "rk4", 1e-3, 100).omega)


@pytest.mark.parametrize(("mass", "length"), [(1e-30, 1.0), (1e30, 1.0), (1.0, 1e12), (1.0, 1e-6), (1e-20, 1e-5)])
def test_masses_and_lengths_far_from_one_are_represented(mass, length):
    scene = chain(3, angle=[0.3, -0.2, 0.5], mass=mass, length=length)
    exact = accelerations(scene, scene.angles, scene.rates)
    # The smallest lengths are the worst (6e-15): the model keeps positions in metres.
    np.testing.assert_allclose(one_step_accelerations(scene), exact, rtol=1e-12)


def test_refuses_what_it_cannot_represent():
    assert ENGINE.refuses(chain(1023)) is None
    assert "1023" in ENGINE.refuses(chain(1024))
    assert ENGINE.refuses(chain(2, length=1e-6)) is None
    assert "1e-07 m" in ENGINE.refuses(chain(2, length=1e-7))


def test_a_rod_that_is_too_short_would_be_wrong_without_a_word():
    run = ENGINE.build(chain(1, angle=0.5, length=1e-7), "euler", 1.0)
    run.advance(1)
    assert run.health() is None
    assert run.state().omega == 0.0  # it should have fallen; if this fails, MuJoCo is better than the limit says


# What goes wrong.


def test_a_run_that_blows_up_is_not_finite_and_leaves_no_trace(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    heard: list[str] = []
    mujoco.set_mju_user_warning(heard.append)
    try:
        run = ENGINE.build(chain(5, rate=100.0), "euler", 10.0)
        run.advance(100)
        assert mujoco.get_mju_user_warning() == heard.append
    finally:
        mujoco.set_mju_user_warning(None)
    assert run.health() == Fault("not finite", "a joint's angle or rate is not finite")
    assert heard == []
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_the_trace_is_there_where_warnings_are_heard(tmp_path, monkeypatch, capfd):
    """The control of the test above: this is what MuJoCo does by itself."""
    monkeypatch.chdir(tmp_path)
    run = ENGINE.build(chain(5, rate=100.0), "euler", 10.0)
    mujoco.mj_step(run._model, run._data, nstep=100)
    assert [file.name for file in tmp_path.iterdir()] == ["MUJOCO_LOG.TXT"]
    assert "unstable" in "".join(capfd.readouterr())


def test_a_run_that_starts_again_is_found_out():
    run = ENGINE.build(chain(5, rate=100.0), "euler", 10.0)
    run._model.opt.disableflags &= ~AUTORESET
    run.advance(10)
    assert np.all(np.isfinite(run.state().theta))
    assert run.health().status == "reset"


def test_a_warning_is_passed_on():
    run = ENGINE.build(chain(2, rate=[1e6, 2e6]), "euler", 1e-2)
    run.advance(2)
    fault = run.health()
    assert fault.status == "warned"
    assert "QACC" in fault.reason


def test_more_steps_than_a_native_call_counts_are_taken_in_several(monkeypatch):
    scene = random_chain(3, seed=6)
    monkeypatch.setattr(running, "_MOST_STEPS_A_CALL", 7)
    parts = after(scene, "rk4", 1e-3, 50)
    monkeypatch.undo()
    np.testing.assert_array_equal(parts.theta, after(scene, "rk4", 1e-3, 50).theta)


# The files.


def loaded(text: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    return model, data


IN_FILES = [name for name in bundled_names("models") if mjcf.fits_file(load_scene(name))]


def test_bundled_files_are_in_step_with_the_scenes():
    folder = bundled("models") / "mjcf"
    assert {file.stem for file in folder.glob("*.xml")} == set(IN_FILES)
    for name in IN_FILES:
        assert (folder / f"{name}.xml").read_text(encoding="utf-8") == mjcf.write_mjcf(load_scene(name)), (
            "run python -m pendbench.engines.mujoco.mjcf"
        )


@pytest.mark.parametrize("name", IN_FILES)
def test_a_bundled_file_moves_as_the_built_model_does(name):
    model = mujoco.MjModel.from_xml_path(str(bundled("models") / "mjcf" / f"{name}.xml"))
    model.body_inertia[1:] = mjcf.compile_chain(load_scene(name)).body_inertia[1:]  # 0, but for rods with mass
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, nstep=100)
    built = after(load_scene(name), "rk4", model.opt.timestep, 100)
    np.testing.assert_array_equal(np.cumsum(data.qpos), built.theta)
    np.testing.assert_array_equal(np.cumsum(data.qvel), built.omega)


def test_the_inertia_that_a_file_must_have_biases_by_rounding_only():
    scene = random_chain(5, seed=7)
    model, data = loaded(mjcf.write_mjcf(scene))
    assert np.all(model.body_inertia[1:] == mjcf.INERTIA)
    mujoco.mj_step(model, data, nstep=200)
    built = after(scene, "rk4", model.opt.timestep, 200)
    # I / (m l^2) is at most 1e-15 in each acceleration; the chain multiplies that over 0.2 s.
    np.testing.assert_allclose(np.cumsum(data.qvel), built.omega, rtol=0, atol=1e-12)


def test_a_file_of_the_greatest_depth_opens_and_a_deeper_one_is_refused(monkeypatch):
    model, _ = loaded(mjcf.write_mjcf(chain(mjcf.DEEPEST_FILE)))
    assert model.nv == mjcf.DEEPEST_FILE
    with pytest.raises(InputError, match="496"):
        mjcf.write_mjcf(chain(mjcf.DEEPEST_FILE + 1))
    monkeypatch.setattr(mjcf, "DEEPEST_FILE", 1000)
    with pytest.raises(ValueError, match="DEPTH"):
        loaded(mjcf.write_mjcf(chain(497)))


def test_names_are_escaped_and_the_file_has_no_line_of_theirs():
    odd = "a<b>&\"c' --> ]]>\n\x00\x1b\ud800é"
    text = mjcf.write_mjcf(chain(2, name=odd, title=odd))
    model, _ = loaded(text)
    assert ET.fromstring(text).get("model").startswith("a<b>&\"c' --> ]]>")
    assert model.names.startswith(b"a<b>&\"c' --> ]]>")
    assert text.encode() == mjcf.write_mjcf(chain(2, name=odd, title=odd)).encode()


def test_the_command_writes_the_files_of_all_scenes(tmp_path, monkeypatch):
    models = tmp_path / "models"
    models.mkdir()
    for name in ("single", "double"):
        shutil.copy(bundled("models") / f"{name}.toml", models)
    monkeypatch.setattr("pendbench.base.bundled.bundled", lambda kind: tmp_path / kind)
    mjcf.main()
    assert sorted(file.name for file in (models / "mjcf").iterdir()) == ["double.xml", "single.xml"]
    assert (models / "mjcf" / "double.xml").read_text(encoding="utf-8") == mjcf.write_mjcf(load_scene("double"))


def test_a_release_without_todays_editing_reads_the_same_model_as_a_file(monkeypatch):
    """To the last digit, with effects that a file holds and one that it does not."""
    scene = Scene.chain(
        n=3, length=0.4, mass=0.3, angles=1.0, gravity=9.81, joint_damping=0.1, air_drag={"linear": 0.2}
    )
    edited = mjcf.compile_chain(scene)
    monkeypatch.setattr(mjcf, "_EDITS", False)
    read = mjcf.compile_chain(scene)
    for name in ("body_mass", "body_inertia", "body_pos", "body_ipos", "jnt_axis", "dof_damping", "dof_armature"):
        assert np.array_equal(getattr(edited, name), getattr(read, name)), name
    assert read.opt.disableflags == edited.opt.disableflags
    assert read.ngeom == 0
