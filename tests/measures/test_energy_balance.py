"""The measure of energy against work that is known in closed form."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

import pendbench as pb
from pendbench.measures.energy import (
    Meter,
    balance_of,
    energy_balance,
    is_driven,
    times_to_balance,
    with_energy_checked,
)
from pendbench.physics.energy import energy, energy_scale
from pendbench.scene.scene import Effects, load_scene
from pendbench.scene.trajectory import Trajectory
from support.scenes import chain

DAMPING, SWING, RATE = 0.3, 0.4, 3.0
SCENE = dataclasses.replace(chain(1, length=2.0, mass=1.5), effects=Effects(gravity=9.81, joint_damping=DAMPING))
#: Upright less hanging.
SCALE = 2 * 1.5 * 9.81 * 2.0


def run_of(t, theta, omega):
    return Trajectory(t=t, theta=theta[:, None], omega=omega[:, None], gap=np.zeros(len(t)))


def swinging(samples, duration=4.0):
    """A pendulum moved as 0.4 sin(3 t), whatever its equations say: what its damper takes out is known."""
    t = np.linspace(0.0, duration, samples)
    return run_of(t, SWING * np.sin(RATE * t), SWING * RATE * np.cos(RATE * t))


def work(t):
    """The integral of -c omega^2, J."""
    return -DAMPING * (SWING * RATE) ** 2 * (0.5 * t + np.sin(2 * RATE * t) / (4 * RATE))


def change(run):
    """Of m l^2 omega^2 / 2 - m g l cos(theta), J."""
    value = 0.5 * 1.5 * 2.0**2 * run.omega[:, 0] ** 2 - 1.5 * 9.81 * 2.0 * np.cos(run.theta[:, 0])
    return value - value[0]


def test_error_is_the_change_less_the_work():
    run = swinging(2001)
    np.testing.assert_allclose(energy_balance(SCENE, run).error, (change(run) - work(run.t)) / SCALE, atol=1e-9)


def damped_oscillator(t, damping):
    """A light spring and no weight: theta'' + 2 d theta' + w^2 theta = 0, whose solution is known. Released at 0.5."""
    frequency = math.sqrt(4.0 - damping**2)
    decay = 0.5 * np.exp(-damping * t)
    theta = decay * (np.cos(frequency * t) + damping / frequency * np.sin(frequency * t))
    omega = -decay * 4.0 / frequency * np.sin(frequency * t)
    return run_of(t, theta, omega)


def test_damped_oscillator_loses_what_its_damper_takes():
    """Of 1 kg on 1 m, k = 4 N m/rad, c = 0.4 N m s/rad: it ends with 2 % of its energy, and the balance is kept."""
    effects = Effects(joint_stiffness=4.0, joint_damping=0.4)
    scene = dataclasses.replace(chain(1, angle=0.5, gravity=None), effects=effects)
    run = damped_oscillator(np.linspace(0.0, 10.0, 4001), damping=0.2)
    values, found = energy(scene, run.theta, run.omega), energy_balance(scene, run)
    assert values[-1] < 0.03 * values[0]
    assert np.abs(found.error).max() <= max(1e-12, 2 * found.known_to)
    assert found.known_to < 1e-9


@pytest.mark.parametrize("wrong", [0.9, 1.1])
def test_damper_that_is_wrong_by_a_tenth_is_noticed(wrong):
    """A motion with another damper than the scene's: a tenth of the energy lost, which was all of it, is missing."""
    effects = Effects(joint_stiffness=4.0, joint_damping=0.4 * wrong)
    scene = dataclasses.replace(chain(1, angle=0.5, gravity=None), effects=effects)
    run = damped_oscillator(np.linspace(0.0, 10.0, 4001), damping=0.2)
    lost = 0.5 * 4.0 * 0.5**2
    expected = (0.1 if wrong > 1 else -0.1) * lost / max(lost, wrong * lost)
    assert energy_balance(scene, run).error[-1] == pytest.approx(expected, rel=0.03)


def test_driven_oscillator_gains_what_its_motor_gives():
    """Theta = a t sin(w t) answers a torque of 2 m l^2 a w cos(w t), which a sine a quarter later is."""
    t = np.linspace(0.0, 6.0, 6001)
    run = run_of(t, 0.1 * np.sin(2 * t) * t, 0.1 * (np.sin(2 * t) + 2 * t * np.cos(2 * t)))
    values = 0.5 * run.omega[:, 0] ** 2 + 0.5 * 4.0 * run.theta[:, 0] ** 2
    given = 0.4 * np.cos(2 * t) * run.omega[:, 0]  # the torque that this motion needs, times its rate
    found = balance_of(t, values, given, 0.0)
    assert found.scale == pytest.approx(values[-1] - values[0], rel=0.1)
    assert np.abs(found.error).max() < 1e-10


def by_simpson(t, values):
    """The integral of the cubic spline through some values, which Simpson's rule has exactly."""
    middle = make_interp_spline(t, values, k=3)(0.5 * (t[1:] + t[:-1]))
    return np.append(0.0, np.cumsum(np.diff(t) / 6.0 * (values[:-1] + 4.0 * middle + values[1:])))


@pytest.mark.parametrize("samples", [41, 81, 161])
def test_floor_is_how_well_the_work_is_known(samples):
    """Half the samples give a work that is off by some 16 times as much as that of all: the difference is 15 times."""
    run = swinging(samples)
    given = -DAMPING * run.omega[:, 0] ** 2
    fine, rough = by_simpson(run.t, given), by_simpson(run.t[::2], given[::2])
    found = energy_balance(SCENE, run).known_to
    assert found == pytest.approx(np.abs(fine[::2] - rough).max() / 15 / SCALE, rel=1e-5)
    true = np.abs(fine - work(run.t)).max() / SCALE
    assert 0.5 * true < found < 2.0 * true


def test_what_is_below_the_floor_is_not_astray():
    """The true motion, looked at rarely: the work is off by what it is not known to, and nothing is astray."""
    scene = load_scene("damped_double")
    run = pb.simulate(scene, times=np.linspace(0.0, 5.0, 51))
    found = energy_balance(scene, run)
    assert np.abs(found.error).max() > 1e-5
    assert np.all(found.excess <= 2.0 * found.floor)
    assert with_energy_checked(run, found).status == "ok"


def test_where_energy_is_conserved_it_is_the_energy_itself():
    scene = chain(2)
    run = pb.simulate(scene, times=np.linspace(0.0, 1.0, 41))
    found = energy_balance(scene, run)
    values = energy(scene, run.theta, run.omega)
    np.testing.assert_array_equal(found.kept, values)
    np.testing.assert_array_equal(found.error, (values - values[0]) / energy_scale(scene))
    np.testing.assert_array_equal(found.excess, np.abs(found.error))
    assert math.isnan(found.known_to)
    times = np.linspace(0.0, 1.0, 3)
    assert times_to_balance(scene, 1e-3, times) is times


def test_work_is_the_unit_where_it_is_larger_than_the_scene():
    run = swinging(2001)
    fast = dataclasses.replace(run, omega=run.omega * np.linspace(1.0, 40.0, 2001)[:, None])
    taken = by_simpson(fast.t, -DAMPING * fast.omega[:, 0] ** 2)
    assert -taken[-1] > SCALE
    assert energy_balance(SCENE, fast).scale == pytest.approx(-taken[-1])


@pytest.mark.parametrize("blows_up", ["at once", "at last"])
def test_run_that_blows_up_has_lost_its_balance(blows_up):
    run = swinging(41)
    run.omega[1 if blows_up == "at once" else 35 :] = 1e200
    found = with_energy_checked(run, energy_balance(SCENE, run))
    assert found.status == "energy lost"
    assert "the balance of its energy is off by inf" in found.reason


def test_numbers_too_large_to_integrate_have_lost_their_balance():
    run = swinging(41)
    run.omega[30:] = 1e153  # whose power is finite, and the spline's sums are not
    assert with_energy_checked(run, energy_balance(SCENE, run)).status == "energy lost"


def test_damping_that_is_too_stiff_for_a_step_is_energy_lost():
    """Explicit steps of 2.5 over the rate of decay: the rate grows by -1.5 in each, and the damper takes in vain."""
    t = 0.5 * np.arange(40)
    omega = 0.1 * (-1.5) ** np.arange(40)
    effects = Effects(joint_damping=5.0)
    scene = dataclasses.replace(chain(1, angle=0.0, rate=0.1, gravity=None), effects=effects)
    run = run_of(t, np.cumsum(np.append(0.0, 0.5 * omega[:-1])), omega)
    assert with_energy_checked(run, energy_balance(scene, run)).status == "energy lost"


def test_too_few_samples_tell_nothing():
    found = energy_balance(SCENE, swinging(3))
    assert math.isinf(found.known_to)
    assert np.all(found.excess == 0.0)

    np.testing.assert_array_equal(found.floor, [0.0, math.inf, math.inf])


@pytest.mark.parametrize("count", [8, 9])
def test_floor_never_falls_and_ends_with_what_all_samples_tell(count):
    """The difference between the integrals of all samples and of half of them, over 15; the work is the unit."""
    t = np.linspace(0.0, 2.0, count)
    given = np.exp(2.0 * t)
    found = balance_of(t, 0.0 * t, given, 1.0)
    apart = np.abs(by_simpson(t, given)[::2] - by_simpson(t[::2], given[::2])) / 15 / by_simpson(t, given)[-1]
    assert found.floor[-1] == pytest.approx(apart.max(), rel=1e-9)
    assert found.floor[0] == 0.0
    assert np.all(np.diff(found.floor) >= 0.0)


@pytest.mark.parametrize("dt", [None, 1e-3, 1e-5])
def test_samples_are_dense_where_work_is_integrated(dt):
    times = np.array([0.0, 0.1, 0.5])
    dense = times_to_balance(SCENE, dt, times)
    assert np.all(np.isin(times, dense) if dt is None else np.isin(np.rint(times / dt), np.rint(dense / dt)))
    assert np.all(np.diff(dense) > 1e-9)
    assert 501 <= len(dense) <= 25_000


def test_meter_says_what_the_whole_run_does():
    for name in ("double", "damped_double", "driven_triple"):
        scene = load_scene(name)
        run = pb.simulate(scene, method="euler", dt=1e-3, times=np.linspace(0.0, 1.0, 201))
        meter = Meter(scene)
        last = [meter.add(*sample) for sample in zip(run.t[1:], run.theta[1:], run.omega[1:], strict=True)][-1]
        assert last == pytest.approx(energy_balance(scene, run).excess[-1], rel=1e-12)
        assert last > 1e-5


def test_what_depends_on_the_time_is_driven():
    driven = {name for name in ("double", "damped_double", "drag_chain10", "kapitza", "rods_triple", "driven_triple")
              if is_driven(load_scene(name))}  # fmt: skip
    assert driven == {"kapitza", "driven_triple"}
