"""Effects against what is known of them without our equations: closed forms, averages, balances and symmetries."""

from __future__ import annotations

import dataclasses
import math

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline
from scipy.linalg import eigh
from scipy.special import mathieu_a, mathieu_cem

import pendbench as pb
from pendbench.physics import acting, energy
from pendbench.physics.exact import single_pendulum
from pendbench.scene.scene import Effects
from support.effect_sets import GRAVITY, SETS, USUAL, given, under
from support.scenes import chain

TIMES = np.linspace(0.1, 3.0, 30)
# What adaptive runs of 3 s are off by at their default tolerance of 1e-14 a step: measured 4e-13 at worst.
EXACT = 1e-12


def link(angle=0.4, rate=3.0, **effects):
    """One link of 0.7 m and 1.5 kg."""
    return given(chain(1, angle=angle, rate=rate, length=0.7, mass=1.5), **effects)


INERTIA = 1.5 * 0.7**2
MOTOR = {"joint": 1, "amplitude": 5.0, "angular_frequency": 4.0}
#: Effects in joints that do nothing to speak of: kernels are compiled for each set of effects, and one set is enough.
SLIGHT = {
    "joint_damping": 1e-300,
    "joint_stiffness": 1e-300,
    "joint_torque": 1e-300,
    "drive_torque": {**MOTOR, "amplitude": 1e-300},
}


def three():
    return chain(3, angle=[0.5, 1.2, -0.3], rate=[1.0, -0.5, 2.0], length=[0.5, 0.3, 0.4], mass=0.8)


def followed(scene, times=TIMES):
    """The adaptive run: theta and omega, (k, n)."""
    run = pb.simulate(scene, times=times)
    assert run.status == "ok"
    return run.theta, run.omega


def assert_exact(found, expected, tolerance=EXACT):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)


# One link


def test_damped_link_without_gravity_slows_down_exponentially():
    theta, omega = followed(link(joint_damping=0.6))
    decay = np.exp(-0.6 / INERTIA * TIMES)
    assert_exact(omega[:, 0], 3.0 * decay)
    assert_exact(theta[:, 0], 0.4 + 3.0 * INERTIA / 0.6 * (1.0 - decay))


@pytest.mark.parametrize("stiffness", [0.05, 20.0], ids=["creeps", "swings"])
def test_damped_spring_without_gravity_is_linear_at_any_amplitude(stiffness):
    """Over several turns: a spring counts them."""
    scene = link(angle=9.0, **{**SLIGHT, "joint_stiffness": stiffness, "joint_damping": 0.6})
    half = 0.3 / INERTIA
    root = np.sqrt(complex(half**2 - stiffness / INERTIA))
    first, second = -half + root, -half - root
    share = (3.0 - second * 9.0) / (first - second)
    expected = share * np.exp(first * TIMES) + (9.0 - share) * np.exp(second * TIMES)
    assert_exact(followed(scene)[0][:, 0], expected.real)


@pytest.mark.parametrize(
    ("held", "middle"),
    [
        ({}, 0.0),
        ({"joint_rest": 2.0}, 2.0),
        ({"joint_torque": 6.0}, 0.75),
        ({"joint_rest": 2.0, "joint_torque": 6}, 2.75),
    ],
    ids=["straight", "at rest elsewhere", "pulled", "both"],
)
def test_spring_without_gravity_swings_harmonically_about_where_it_is_held(held, middle):
    theta, omega = followed(link(angle=5.0, rate=0.0, **{**SLIGHT, "joint_stiffness": 8.0, **held}))
    frequency = math.sqrt(8.0 / INERTIA)
    assert_exact(theta[:, 0], middle + (5.0 - middle) * np.cos(frequency * TIMES))
    assert_exact(omega[:, 0], -(5.0 - middle) * frequency * np.sin(frequency * TIMES))


@pytest.mark.parametrize("rate", [3.0, 12.0], ids=["swings", "turns over"])
def test_rod_with_mass_is_the_compound_pendulum(rate):
    """A simple one of the length I / (M d), inertia over mass and distance of its centre: elliptic functions."""
    mass, rod, length = 1.5, 0.9, 0.7
    reduced = length * (mass + rod / 3) / (mass + rod / 2)
    expected = single_pendulum(chain(1, angle=0.4, rate=rate, length=reduced), TIMES)
    for found, exact in zip(followed(link(rate=rate, gravity=GRAVITY, rod_mass=rod)), expected, strict=True):
        assert_exact(found, exact)


@pytest.mark.parametrize("mass", [1e-30, 0.0])
def test_rod_alone_is_a_pendulum_of_two_thirds_its_length(mass):
    scene = dataclasses.replace(chain(1, length=0.9), masses=[mass], effects=Effects(gravity=GRAVITY, rod_mass=2.0))
    scene = scene.with_start([0.4], [3.0])
    assert_exact(followed(scene)[0], single_pendulum(chain(1, angle=0.4, rate=3.0, length=0.6), TIMES)[0])


@pytest.mark.parametrize("rate", [3.0, 12.0], ids=["swings", "turns over"])
def test_a_rotor_at_the_pivot_makes_a_link_slower(rate):
    """Of the length (m l^2 + A) / (m l), but for its place."""
    expected = single_pendulum(chain(1, angle=0.4, rate=rate, length=(INERTIA + 0.3) / (1.5 * 0.7)), TIMES)
    for found, exact in zip(followed(link(rate=rate, gravity=GRAVITY, armature=0.3)), expected, strict=True):
        assert_exact(found, exact)


def test_linear_drag_slows_a_free_link_exponentially():
    assert_exact(followed(link(air_drag={"linear": 0.9}))[1][:, 0], 3.0 * np.exp(-0.9 / 1.5 * TIMES))


def test_quadratic_drag_slows_a_free_link_hyperbolically():
    theta, omega = followed(link(air_drag={"quadratic": 0.9}))
    pace = 0.9 * 0.7 / 1.5
    assert_exact(omega[:, 0], 3.0 / (1.0 + pace * 3.0 * TIMES))
    assert_exact(theta[:, 0], 0.4 + np.log1p(pace * 3.0 * TIMES) / pace)


def test_motor_turns_a_free_link_as_its_torque_says():
    theta, omega = followed(link(drive_torque=MOTOR))
    pace = 5.0 / INERTIA / 4.0
    assert_exact(omega[:, 0], 3.0 + pace * (1.0 - np.cos(4.0 * TIMES)))
    assert_exact(theta[:, 0], 0.4 + 3.0 * TIMES + pace * (TIMES - np.sin(4.0 * TIMES) / 4.0))


def test_constant_torque_speeds_a_free_link_up_evenly():
    theta, omega = followed(link(joint_torque=-4.0))
    assert_exact(omega[:, 0], 3.0 - 4.0 / INERTIA * TIMES)
    assert_exact(theta[:, 0], 0.4 + 3.0 * TIMES - 2.0 / INERTIA * TIMES**2)


def test_torque_that_a_link_can_bear_holds_it_out():
    """Where m g l sin(theta) is the torque, it stays; the least more and it turns over, for ever faster."""
    weight = 1.5 * GRAVITY * 0.7
    out = link(angle=0.5, rate=0.0, gravity=GRAVITY, joint_torque=weight * math.sin(0.5))
    assert_exact(followed(out)[0], 0.5)
    turned, rate = followed(link(rate=0.0, gravity=GRAVITY, joint_torque=1.01 * weight), np.linspace(0.0, 30.0, 31))
    assert (np.diff(turned[:, 0]) > 0.0).all()
    # The height is that of the start after whole turns; the energy of each has become motion.
    gained = 0.5 * INERTIA * rate[:, 0] ** 2 - weight * (np.cos(turned[:, 0]) - math.cos(0.4))
    np.testing.assert_allclose(gained, 1.01 * weight * (turned[:, 0] - 0.4), rtol=1e-12, atol=1e-11)


def test_cosine_on_a_damped_spring_is_the_textbook_s_oscillator():
    """I x'' + c x' + k x = F cos(w t), at any amplitude: what answers the force, and what rings on."""
    stiffness, damping, force, w = 8.0, 0.6, 5.0, 4.0
    motor = {"joint": 1, "amplitude": force, "angular_frequency": w, "phase": math.pi / 2}
    scene = link(**{**SLIGHT, "joint_stiffness": stiffness, "joint_damping": damping, "drive_torque": motor})
    answer = force / (stiffness - INERTIA * w * w + 1j * damping * w)
    decay = damping / (2.0 * INERTIA)
    ringing = math.sqrt(stiffness / INERTIA - decay * decay)
    left, speed = 0.4 - answer.real, 3.0 - (1j * w * answer).real
    free = left * np.cos(ringing * TIMES) + (speed + decay * left) / ringing * np.sin(ringing * TIMES)
    assert_exact(followed(scene)[0][:, 0], (answer * np.exp(1j * w * TIMES)).real + np.exp(-decay * TIMES) * free)


def test_pendulum_driven_by_a_cosine_is_the_textbook_s():
    """The chaotic one of Baker and Gollub (Chaotic Dynamics, chapter 3): x'' + x' / 2 + sin x = 1.15 cos(2 t / 3)."""
    scene = chain(1, angle=0.4, rate=3.0, length=1.0, mass=1.0)
    motor = {"joint": 1, "amplitude": 1.15, "angular_frequency": 2.0 / 3.0, "phase": math.pi / 2}

    def slope(t, y):
        return [y[1], 1.15 * math.cos(2.0 * t / 3.0) - 0.5 * y[1] - math.sin(y[0])]

    times = 4.0 * TIMES
    expected = solve_ivp(slope, (0.0, 12.0), [0.4, 3.0], method="DOP853", t_eval=times, rtol=1e-13, atol=1e-13).y[0]
    driven = given(scene, gravity=1.0, **{**SLIGHT, "joint_damping": 0.5, "drive_torque": motor})
    assert_exact(followed(driven, times)[0][:, 0], expected, 1e-10)


@pytest.mark.parametrize("phase", [0.0, 1.3])
def test_mass_stays_where_it_is_when_the_pivot_is_shaken_beside_it(phase):
    """Without gravity, to the third power of amplitude over length, if it was at rest in the ground's frame."""
    lean = 1e-5
    pivot = {"axis": "x", "amplitude": 0.7 * lean, "angular_frequency": 6.0, "phase": phase}
    start = {"angle": -lean * math.sin(phase), "rate": -6.0 * lean * math.cos(phase)}
    theta, omega = followed(link(**start, driven_pivot=pivot))
    assert_exact(theta[:, 0], -lean * np.sin(6.0 * TIMES + phase), 1e-14)
    assert_exact(omega[:, 0], -6.0 * lean * np.cos(6.0 * TIMES + phase), 1e-13)


def test_air_takes_a_moving_pivot_s_speed_from_its_phase():
    """A heavy drag holds the mass in the air, so that the link leans against the pivot's own place."""
    lean = 1e-5
    pivot = {"axis": "x", "amplitude": 0.7 * lean, "angular_frequency": 6.0, "phase": 1.3}
    theta, _ = followed(link(angle=-lean * math.sin(1.3), rate=0.0, driven_pivot=pivot, air_drag={"linear": 3000.0}))
    assert_exact(theta[:, 0], -lean * np.sin(6.0 * TIMES + 1.3), 1e-7)


@pytest.mark.parametrize("upright", [False, True], ids=["hanging", "inverted"])
def test_small_swings_on_a_shaken_pivot_are_mathieu_s(upright):
    """At the border of stability the motion repeats itself, and is a Mathieu function: DLMF 28.2(vi).

    For the inverted link this is where Kapitza's pivot begins to hold it up.
    """
    q, frequency, length, small = 0.4, 20.0, 0.7, 1e-5
    order_, sign = (0, -1.0) if upright else (1, 1.0)
    gravity = sign * mathieu_a(order_, q) * length * frequency**2 / 4.0
    pivot = {"axis": "y", "amplitude": q * length / 2.0, "angular_frequency": frequency}
    phase = np.degrees(frequency * np.array([0.0, *TIMES]) / 2.0 - sign * np.pi / 4.0)
    value, slope = mathieu_cem(order_, q, phase)
    top = np.pi if upright else 0.0
    scene = link(
        angle=top + small * value[0], rate=small * slope[0] * frequency / 2.0, gravity=gravity, driven_pivot=pivot
    )
    theta, omega = followed(scene)
    # The sine's third power, 1e-10 of it, and what rounding near pi starts as: 1e-15, which grows with the time.
    assert_exact((theta[:, 0] - top) / small, value[1:], 1e-7)
    assert_exact(omega[:, 0] / small, slope[1:] * frequency / 2.0, 1e-6)


# Kapitza's pendulum, averaged over its fast pivot


def inverted(strength, frequency=200.0, length=0.5, lean=0.01):
    """A link near the top; its pivot's amplitude makes (a w)^2 `strength` times 2 g l."""
    amplitude = math.sqrt(strength * 2.0 * GRAVITY * length) / frequency
    pivot = {"axis": "y", "amplitude": amplitude, "angular_frequency": frequency}
    return given(chain(1, angle=np.pi - lean, length=length), gravity=GRAVITY, driven_pivot=pivot)


def test_fast_pivot_holds_a_link_up_and_a_slow_one_lets_it_fall():
    times = np.linspace(0.0, 10.0, 2001)
    for strength, up in ((1.5, True), (0.5, False)):
        theta, _ = followed(inverted(strength), times)
        assert (np.abs(theta - np.pi).max() < 0.1) == up
    assert np.abs(followed(inverted(0.5), times)[0] - np.pi).max() > np.pi


def slow_frequency(frequency, length):
    """With which the link swings about the top, rad/s."""
    scene = inverted(1.5, frequency, length, lean=0.001)
    lean = followed(scene, 2 * np.pi / frequency * np.arange(400))[0][:, 0] - np.pi
    # Once a period of the pivot: x_(k+1) + x_(k-1) = 2 cos(slow period) x_k.
    cosine = ((lean[2:] + lean[:-2]) @ lean[1:-1]) / (2.0 * lean[1:-1] @ lean[1:-1])
    return math.acos(cosine) * frequency / (2 * np.pi)


def test_inverted_link_swings_at_the_averaged_frequency():
    """sqrt((a w)^2 / (2 l^2) - g / l), with an error that falls with the square of w."""
    length = 0.5
    averaged = math.sqrt(0.5 * GRAVITY / length)
    coarse, fine = (slow_frequency(w, length) / averaged - 1.0 for w in (200.0, 400.0))
    assert abs(coarse) < 1e-3
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


# Chains without gravity


@pytest.mark.parametrize("masses", [[0.8, 0.8, 0.8], [0.8, 0.3, 1.2]], ids=["alike", "unlike"])
def test_linear_drag_is_a_clock_that_runs_down(masses):
    """Where every mass has the same drag for its weight, a free chain takes the same way, ever more slowly."""
    scene, pace = dataclasses.replace(three(), masses=masses), 0.9 / 0.8
    theta, omega = followed(given(scene, air_drag={"linear": [pace * mass for mass in masses]}))
    slowed = np.exp(-pace * TIMES)
    free, free_omega = followed(given(scene), (1.0 - slowed) / pace)
    assert np.ptp(free, axis=0).min() > 0.2
    assert_exact(theta, free)
    assert_exact(omega, free_omega * slowed[:, np.newaxis])


@pytest.mark.parametrize(
    ("effect", "gained"),
    [
        ({"joint_damping": [0.3, 0.5, 0.7]}, lambda theta, _: -0.3 * (theta[:, 0] - 0.5)),
        ({"joint_damping": [0.0, 0.5, 0.7]}, lambda *_: 0.0),
        ({"joint_stiffness": [0.0, 5.0, 7.0]}, lambda *_: 0.0),
        ({"joint_stiffness": [0.0, 5.0, 7.0], "joint_rest": [1.0, 0.5, -0.4]}, lambda *_: 0.0),
        ({"joint_torque": [0.0, 5.0, -3.0]}, lambda *_: 0.0),
        ({"joint_torque": [2.0, 5.0, -3.0]}, lambda *_: 2.0 * TIMES),
        ({"rod_mass": [0.5, 0.0, 1.0]}, lambda *_: 0.0),
        ({"armature": [0.2, 0.0, 0.5]}, lambda *_: 0.0),
        ({"drive_torque": {**MOTOR, "joint": 2}}, lambda *_: 0.0),
        ({"drive_torque": MOTOR}, lambda *_: 5.0 / 4.0 * (1.0 - np.cos(4.0 * TIMES))),
        ({"air_drag": {"linear": 0.9}}, lambda _, start: start * np.expm1(-0.9 / 0.8 * TIMES)),
    ],
    ids=[
        "damped pivot",
        "damped joints",
        "sprung joints",
        "bent joints",
        "torques inside",
        "torque at the pivot",
        "rods",
        "rotors",
        "motor inside",
        "motor at the pivot",
        "drag",
    ],
)
def test_angular_momentum_changes_by_what_the_ground_and_the_air_do(effect, gained):
    scene = given(three(), **effect)
    theta, omega = followed(scene)
    start = energy.angular_momentum(scene, scene.angles, scene.rates)
    found, expected = energy.angular_momentum(scene, theta, omega) - start, gained(theta, start)
    # Measured over 25 random starts under torques: 1e-12 of what is gained, all of it rounding.
    assert_exact(found, expected, 2.0 * EXACT * max(1.0, float(np.abs(expected).max())))


# Small oscillations


def test_small_swings_of_a_sprung_chain_are_its_normal_modes():
    masses, lengths = np.array([1.0, 0.5, 0.8]), np.array([0.5, 0.3, 0.4])
    springs = np.array([2.0, 3.0, 1.0])
    hanging = np.array([2.3, 1.3, 0.8])
    inertia = np.minimum.outer(hanging, hanging) * np.outer(lengths, lengths)
    bends = np.eye(3) - np.eye(3, k=-1)
    pull = np.diag(hanging * GRAVITY * lengths) + bends.T @ np.diag(springs) @ bends
    rotors = np.array([0.1, 0.0, 0.05])
    inertia = inertia + bends.T @ np.diag(rotors) @ bends
    squares, shapes = eigh(pull, inertia)
    start = 1e-5 * np.array([1.0, -0.5, 2.0])
    share = shapes.T @ inertia @ start
    expected = np.cos(np.sqrt(squares) * TIMES[:, np.newaxis]) @ (share[:, np.newaxis] * shapes.T)
    scene = given(chain(3, angle=start, length=lengths, mass=masses), gravity=GRAVITY, joint_stiffness=springs.tolist())
    others = {"armature": rotors.tolist(), "joint_damping": SLIGHT["joint_damping"]}
    scene = dataclasses.replace(scene, effects=dataclasses.replace(scene.effects, **others))
    # Sines leave 1e-10 of 1e-5; the rest is the method's.
    assert_exact(followed(scene)[0], expected)


# Balance of power


def gauss_panels(end, panels, nodes=8):
    """Times (panels * nodes,) s and weights of Gauss-Legendre quadrature from 0 to `end`."""
    places, weights = np.polynomial.legendre.leggauss(nodes)
    width = end / panels
    return (width * (np.arange(panels)[:, None] + 0.5 + 0.5 * places)).ravel(), np.tile(0.5 * width * weights, panels)


@pytest.mark.parametrize("names", SETS.values(), ids=SETS)
def test_energy_changes_by_the_power_of_the_effects(names):
    scene, end = under(names, three()), 2.0
    times, weights = gauss_panels(end, 120)
    theta, omega = followed(scene, np.append(times, end))
    work = weights @ acting.power(scene, times, theta[:-1], omega[:-1])
    gained = energy.energy(scene, theta[-1], omega[-1]) - energy.energy(scene, scene.angles, scene.rates)
    scale = energy.energy_scale(scene)
    # Measured: 3e-16, and 1e-11 with quadratic drag, whose power is not smooth where a mass turns back.
    assert abs(gained - work) < (1e-10 if "air_drag" in names else 1e-13) * scale
    if names in [SETS[name] for name in ("joint_stiffness", "joint_rest", "joint_torque", "rod_mass", "armature")]:
        assert work == 0.0
    else:
        assert abs(work) > 1e-3 * scale


@pytest.mark.parametrize("which", ["joint_damping", "all"])
def test_imbalance_of_a_fixed_step_falls_with_its_order(which):
    effects = {name: USUAL[name] for name in SETS[which]}
    if which == "all":
        effects["air_drag"] = {"linear": 0.05}
    scene, found = given(three().with_start([0.5, 0.8, -0.2], [1.0, -0.5, 0.5]), **effects), []
    steps = np.array([0.00125, 0.000625, 0.0003125])
    for dt in steps:
        run = pb.simulate(scene, method="rk4", dt=dt, times=dt * np.arange(round(1.0 / dt) + 1))
        power = acting.power(scene, run.t, run.theta, run.omega)
        work = make_interp_spline(run.t, power, k=7).integrate(0.0, 1.0)
        gained = np.diff(energy.energy(scene, run.theta[[0, -1]], run.omega[[0, -1]]))[0]
        found.append(abs(gained - work))
    assert abs(np.polyfit(np.log(steps), np.log(found), 1)[0] - 4.0) < 0.2


# Symmetries, to the last bit


def mirrored(effects):
    """What the effects are in a mirror that swaps left and right."""
    motor = {**effects["drive_torque"], "amplitude": -effects["drive_torque"]["amplitude"]}
    pivot = dict(effects["driven_pivot"])
    if pivot["axis"] == "x":
        pivot["amplitude"] *= -1.0
    joints = {name: -effects[name] for name in ("joint_rest", "joint_torque")}
    return {**effects, **joints, "drive_torque": motor, "driven_pivot": pivot}


@pytest.mark.parametrize("axis", ["x", "y"])
def test_mirror_image_moves_as_the_mirror_image(axis):
    effects = {**USUAL, "driven_pivot": {**USUAL["driven_pivot"], "axis": axis}}
    scene = three()
    one, other = given(scene, **effects), given(scene.with_start(-scene.angles, -scene.rates), **mirrored(effects))
    runs = [pb.simulate(each, method="rk4", dt=0.01, times=[1.0]) for each in (one, other)]
    np.testing.assert_array_equal(runs[0].theta, -runs[1].theta)


def test_another_unit_of_mass_changes_no_bit():
    """Whatever is measured in kilograms, newtons or joules is so many times as much."""
    times, scene = 2.0**20, three()
    air = {name: times * value for name, value in USUAL["air_drag"].items()}
    motor = {**USUAL["drive_torque"], "amplitude": times * USUAL["drive_torque"]["amplitude"]}
    each = {
        name: times * USUAL[name]
        for name in ("joint_damping", "joint_stiffness", "joint_torque", "rod_mass", "armature")
    }
    heavy = chain(3, angle=scene.angles, rate=scene.rates, length=scene.lengths, mass=times * scene.masses)
    heavy = given(heavy, **{**USUAL, **each, "air_drag": air, "drive_torque": motor})
    runs = [pb.simulate(s, method="rk4", dt=0.01, times=[1.0]) for s in (under(tuple(USUAL), scene), heavy)]
    np.testing.assert_array_equal(runs[0].theta, runs[1].theta)


# The reference


@pytest.mark.parametrize("names", SETS.values(), ids=SETS)
def test_reference_of_ten_links_reaches_its_end_and_the_adaptive_method_agrees(names):
    scene = under(names, chain(10, angle=1.0, mass=0.3))
    truth = pb.reference(scene, [0.5, 1.0, 1.5, 2.0])
    assert (truth.horizon, truth.reason) == (2.0, "")
    smooth = "air_drag" not in names
    # Measured: 2e-27 and 6e-15. Quadratic drag is not smooth where a mass turns back: 2e-17 and 2e-12.
    assert truth.disagreement.max() < (1e-24 if smooth else 1e-9)
    theta, _ = followed(scene, truth.t)
    assert np.abs(truth.offset(theta)).max() < (1e-13 if smooth else 1e-10)


@pytest.mark.parametrize("phase", [0.0, 1.3])
def test_reference_of_a_driven_link_has_all_its_digits(phase):
    """The time is one of its variables, and the drive's law is computed in 32 digits too."""
    scene = link(drive_torque={**MOTOR, "phase": phase})
    truth = pb.reference(scene, [0.3, 1.0, 2.0])
    with mpmath.workdps(40):
        mass, length, angle = (mpmath.mpf(float(x[0])) for x in (scene.masses, scene.lengths, scene.angles))
        for t, high, low in zip(truth.t, truth.theta[:, 0], truth.theta_low[:, 0], strict=True):
            time, begun = mpmath.mpf(float(t)), mpmath.mpf(phase)
            swung = mpmath.cos(begun) * time - (mpmath.sin(4 * time + begun) - mpmath.sin(begun)) / 4
            expected = angle + 3 * time + 5 / (mass * length**2 * 4) * swung
            assert abs(mpmath.mpf(float(high)) + mpmath.mpf(float(low)) - expected) < 1e-25


def test_reference_of_a_held_spring_has_all_its_digits():
    scene = link(joint_stiffness=8.1, joint_rest=0.3, joint_torque=0.7)
    truth = pb.reference(scene, [0.3, 1.0, 2.0])
    with mpmath.workdps(40):
        mass, length, angle = (mpmath.mpf(float(x[0])) for x in (scene.masses, scene.lengths, scene.angles))
        w = mpmath.sqrt(mpmath.mpf(8.1) / (mass * length**2))
        middle = mpmath.mpf(0.3) + mpmath.mpf(0.7) / mpmath.mpf(8.1)
        for t, high, low in zip(truth.t, truth.theta[:, 0], truth.theta_low[:, 0], strict=True):
            time = mpmath.mpf(float(t))
            expected = middle + (angle - middle) * mpmath.cos(w * time) + 3 / w * mpmath.sin(w * time)
            assert abs(mpmath.mpf(float(high)) + mpmath.mpf(float(low)) - expected) < 1e-25


def test_reference_of_a_damped_link_has_all_its_digits():
    scene = link(joint_damping=0.5)
    truth = pb.reference(scene, [0.3, 1.0, 2.0])
    with mpmath.workdps(40):
        mass, length, angle = (mpmath.mpf(float(x[0])) for x in (scene.masses, scene.lengths, scene.angles))
        pace = mpmath.mpf(0.5) / (mass * length**2)
        for t, high, low in zip(truth.t, truth.theta[:, 0], truth.theta_low[:, 0], strict=True):
            expected = angle - 3 * mpmath.expm1(-pace * mpmath.mpf(float(t))) / pace
            assert abs(mpmath.mpf(float(high)) + mpmath.mpf(float(low)) - expected) < 1e-25
