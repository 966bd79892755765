"""A run that has lost its energy is told, and none that has not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import pendbench as pb
from pendbench.effects import Effects, examples
from pendbench.measures.energy import Meter, balance_against, conserves_energy, energy_balance, with_energy_checked
from pendbench.scene.scene import Scene
from pendbench.scene.trajectory import Trajectory
from support.scenes import chain

#: One link of 1 m and 1 kg, released from horizontal: its scale is 2 g l = 19.62 J. Turning there, it has w^2 / 2.
SCENE = chain(1)
SCALE = 19.62


def checked(scene: Scene, run: Trajectory) -> Trajectory:
    return with_energy_checked(run, energy_balance(scene, run))


def spinning(energies: list[float], scene: Scene = SCENE, **given: str) -> Trajectory:
    """A horizontal link whose rates are those of these energies, J: at 0 s, 1 s, and so on."""
    omega = np.sqrt(2.0 * np.array(energies))[:, np.newaxis]
    k = len(energies)
    return Trajectory(np.arange(k) * 1.0, np.full((k, scene.n), np.pi / 2), omega, np.zeros(k), **given)


@pytest.mark.parametrize(("share", "status"), [(0.99, "ok"), (1.01, "energy lost")])
def test_the_limit_is_the_energy_scale(share, status):
    assert checked(SCENE, spinning([0.0, share * SCALE])).status == status


def test_it_counts_from_the_first_sample_and_says_when_first():
    found = checked(SCENE, spinning([30.0, 30.0 + 0.5 * SCALE, 30.0 + 1.5 * SCALE, 30.0, 500.0]))
    assert found.status == "energy lost"
    assert found.reason == "at t = 2 s its energy is off by 1.5 of the energy scale"
    assert len(found.t) == 5


def test_a_loss_counts_as_a_gain_does():
    assert checked(SCENE, spinning([30.0, 0.0])).status == "energy lost"


def test_an_energy_that_is_not_finite_is_lost():
    run = dataclasses.replace(spinning([0.0, 0.0]), omega=np.array([[0.0], [1e200]]))
    assert checked(SCENE, run).status == "energy lost"


@pytest.mark.parametrize("status", ["torn", "not finite"])
def test_another_fault_stays(status):
    run = spinning([0.0, 10 * SCALE], status=status, reason="apart")
    assert checked(SCENE, run) is run


@pytest.mark.parametrize(
    ("effect", "conserves"),
    [
        ("gravity", True),
        ("joint_stiffness", True),
        ("joint_rest", True),
        ("joint_torque", True),
        ("rod_mass", True),
        ("joint_damping", False),
        ("air_drag", False),
        ("driven_pivot", False),
        ("drive_torque", False),
    ],
)
def test_scenes_that_gain_or_lose_energy_by_right_are_exempt(effect, conserves):
    scene = dataclasses.replace(chain(2), effects=Effects(**examples()).only(effect))
    assert conserves_energy(scene) == conserves
    run = spinning([1e-6, 1e9], scene)
    run = dataclasses.replace(run, omega=np.repeat(run.omega, 2, axis=1))
    lost = checked(scene, run).status == "energy lost"
    assert lost == (conserves and effect != "rod_mass")  # without gravity and at rest there is no scale


def test_a_run_of_a_good_engine_is_ok_and_of_one_that_explodes_is_not():
    times = np.linspace(0.0, 1.0, 11)
    scene = chain(3)
    assert checked(scene, pb.simulate(scene, times=times)).status == "ok"
    wild = pb.simulate(chain(3, rate=30.0), "mujoco", "euler", 0.05, times=0.05 * np.arange(40))
    assert checked(chain(3, rate=30.0), wild).status != "ok"


@pytest.mark.parametrize(
    ("run", "truth", "error"),
    [
        ([30.0, 20.0, 12.0], [30.0, 22.0, 12.0], [0.0, -2.0 / SCALE, 0.0]),
        ([30.0, 69.0, 31.0], [30.0, 70.0, 30.0], [0.0, -1.0 / 40.0, 1.0 / 40.0]),  # the truth gains more than the scale
        ([31.0, 23.0], [30.0, 22.0], [0.0, 0.0]),  # its own first energy is what it starts from
    ],
)
def test_against_the_truth_what_counts_is_how_much_more_it_gains(run, truth, error):
    balance = balance_against(SCENE, spinning(run), spinning(truth))
    np.testing.assert_allclose(balance.error, error, atol=1e-15)
    assert not balance.floor.any()


def test_where_there_is_no_scale_a_meter_counts_in_joules():
    """A link of 1 m and 1 kg that nothing pulls at, at rest; then at 2 rad/s it has 2 J."""
    free = dataclasses.replace(SCENE, effects=Effects())
    assert Meter(free).add(1.0, free.angles, np.array([2.0])) == pytest.approx(2.0, rel=1e-15)
