"""The Lagrangian of three links with every effect, by computer algebra, and the forms of it that the project has.

Written in the frame of the ground, with rods integrated along their length and forces by virtual work: nothing of the
effects' laws is used.
"""

from __future__ import annotations

from functools import cache

import mpmath
import numpy as np
import pytest
import sympy as sp

from pendbench.base.compiled import compiled
from pendbench.physics import acting, dense
from pendbench.physics.extended.inertias import inertia_form
from pendbench.physics.extended.matrices import matrix_form
from pendbench.physics.extended.mobilities import mobility_form
from pendbench.physics.extended.rotors import rotor_form
from pendbench.physics.kernels import recursion
from pendbench.scene.scene import Effects, Scene
from pendbench.solvers.extended.extrapolation import extended_derivative
from support.effect_sets import GRAVITY, MIXED, SETS, given
from support.hard_chains import hard_chains
from support.scenes import random_chain

N = 3
LINKS = range(N)
ANGLE = sp.symbols(f"theta1:{N + 1}")
RATE = sp.symbols(f"omega1:{N + 1}")
EACH = ("m", "l", "mu", "k", "rest", "c", "held", "dl", "dq", "A")
MASS, LENGTH, ROD, SPRING, REST, DAMPER, HELD, LINEAR, QUADRATIC, ROTOR = (
    sp.symbols(f"{name}1:{N + 1}") for name in EACH
)
G, TIME = sp.symbols("g t")
SHAKE = sp.symbols("ax ay")  # the pivot's amplitudes
SHAKE_FREQUENCY, SHAKE_PHASE, MOTOR_FREQUENCY, MOTOR_PHASE = sp.symbols("w phi wm phim")
MOTOR = sp.symbols(f"tau1:{N + 1}")
PARAMETERS = (
    *MASS,
    *LENGTH,
    *ROD,
    *SPRING,
    *REST,
    *DAMPER,
    *HELD,
    *LINEAR,
    *QUADRATIC,
    *ROTOR,
    G,
    *SHAKE,
    SHAKE_FREQUENCY,
    SHAKE_PHASE,
    *MOTOR,
    MOTOR_FREQUENCY,
    MOTOR_PHASE,
)


def in_motion(expression):
    """How fast an expression in time and angles changes."""
    return sum((sp.diff(expression, ANGLE[j]) * RATE[j] for j in LINKS), sp.diff(expression, TIME))


@cache
def joints():
    """Where the pivot and the masses are, in the frame of the ground."""
    places = [sp.Matrix(SHAKE) * sp.sin(SHAKE_FREQUENCY * TIME + SHAKE_PHASE)]
    for angle, length in zip(ANGLE, LENGTH, strict=True):
        places.append(places[-1] + length * sp.Matrix([sp.sin(angle), -sp.cos(angle)]))
    return places


def bend(i):
    return ANGLE[i] - (ANGLE[i - 1] if i else 0)


@cache
def lagrangian():
    along = sp.Symbol("s")
    total = 0
    for i in LINKS:
        point = joints()[i + 1]
        piece = joints()[i] + along * (joints()[i + 1] - joints()[i])
        for mass, place in ((MASS[i], point), (ROD[i], piece)):
            speed = in_motion(place)
            density = sp.expand(mass * (speed.dot(speed) / 2 - G * place[1]))
            total += sp.integrate(density, (along, 0, 1)) if mass is ROD[i] else density
        total += ROTOR[i] * in_motion(bend(i)) ** 2 / 2 - SPRING[i] * (bend(i) - REST[i]) ** 2 / 2
    return total


@cache
def forces(i):
    """What has no potential, as a force on angle i, by virtual work."""
    total = 0
    for k in LINKS:
        place = joints()[k + 1]
        speed = in_motion(place)
        drag = -(LINEAR[k] + QUADRATIC[k] * sp.sqrt(speed.dot(speed))) * speed
        total += drag.dot(sp.diff(place, ANGLE[i]))
        torque = MOTOR[k] * sp.sin(MOTOR_FREQUENCY * TIME + MOTOR_PHASE) - DAMPER[k] * in_motion(bend(k)) + HELD[k]
        total += torque * sp.diff(bend(k), ANGLE[i])
    return total


@cache
def equations(numbers="numpy"):
    """A function that gives the matrix and the right side of the equations for the accelerations."""
    momenta = [sp.diff(lagrangian(), rate) for rate in RATE]
    matrix = sp.Matrix(N, N, lambda i, j: sp.diff(momenta[i], RATE[j]))
    right = [forces(i) + sp.diff(lagrangian(), ANGLE[i]) - in_motion(momenta[i]) for i in LINKS]
    return sp.lambdify((*PARAMETERS, *ANGLE, *RATE, TIME), [matrix, right], numbers, cse=True)


def arguments(scene, values, theta, omega, t):
    """What `equations` want: the numbers of the chain, of its effects, and of its state."""

    def each(name, of=values):
        return np.broadcast_to(of.get(name, 0.0), N)

    air = values.get("air_drag", {})
    still = {"amplitude": 0.0, "angular_frequency": 1.0, "phase": 0.0}
    shaken = {"axis": "x", **still, **values.get("driven_pivot", {})}
    shake = np.where(np.array(["x", "y"]) == shaken["axis"], shaken["amplitude"], 0.0)
    motor = {"joint": 1, **still, **values.get("drive_torque", {})}
    joints = [each(name) for name in ("joint_stiffness", "joint_rest", "joint_damping", "joint_torque")]
    numbers = [scene.masses, scene.lengths, each("rod_mass"), *joints, each("linear", air), each("quadratic", air)]
    numbers.append(each("armature"))
    torques = motor["amplitude"] * np.eye(N)[motor["joint"] - 1]
    driven = (*shake, shaken["angular_frequency"], shaken["phase"], *torques, motor["angular_frequency"])
    return (*np.concatenate(numbers), values.get("gravity", 0.0), *driven, motor["phase"], *theta, *omega, t)


def derived(scene, values, state):
    """The accelerations (n,) that follow from the Lagrangian."""
    matrix, right = equations()(*arguments(scene, values, *state))
    return np.linalg.solve(np.array(matrix, dtype=float), np.array(right, dtype=float))


def drawn(names, n, rng):
    """Values of these effects for n links: lists where there may be one, with a massless rod or a free joint in it."""

    def each():
        numbers = rng.uniform(0.1, 2.0, n)
        numbers[rng.integers(n)] *= float(n == 1)
        return numbers.tolist()

    quick, slow = {"amplitude": 0.3, "angular_frequency": 4.0}, {"amplitude": 3.0, "angular_frequency": 2.0}
    values = {
        "gravity": GRAVITY,
        "joint_damping": each(),
        "joint_stiffness": each(),
        "joint_rest": each(),
        "joint_torque": each(),
        "air_drag": {"linear": each(), "quadratic": each()},
        "rod_mass": each(),
        "armature": each(),
        "driven_pivot": {"axis": rng.choice(["x", "y"]).item(), **quick, "phase": rng.uniform(-3.0, 3.0)},
        "drive_torque": {"joint": int(rng.integers(n)) + 1, **slow, "phase": rng.uniform(-3.0, 3.0)},
    }
    return {name: values[name] for name in names}


def cases(names, n, count):
    """Scenes, the values of their effects, and a state at a time."""
    for seed in range(count):
        rng = np.random.default_rng(seed)
        values = drawn(names, n, rng)
        scene = given(random_chain(n, seed, spread=4.0), **values)
        yield scene, values, (scene.angles, scene.rates, rng.uniform(0.0, 5.0))


def assert_same(found, expected, tolerance):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())


ALL_SETS = [*SETS.values(), *MIXED]


@pytest.mark.parametrize("names", ALL_SETS, ids="-".join)
def test_accelerations_are_the_lagrangian_s(names):
    for scene, values, state in cases(names, N, 20):
        expected = derived(scene, values, state)
        # Measured: 6e-15 and 7e-15.
        assert_same(dense.accelerations(scene, *state), expected, 1e-13)
        assert_same(recursion.accelerations(scene, *state), expected, 1e-13)


def weightless(names, count):
    """Cases of which one mass at least is 0, on a rod that has mass."""
    for scene, values, state in cases(names, N, count):
        masses = np.where(np.arange(N) >= N - 1 - int(state[2]) % N, 0.0, scene.masses)
        values["rod_mass"] = [rod or 0.7 for rod in values["rod_mass"]]
        yield Scene("", "", 1.0, masses, scene.lengths, state[0], state[1], Effects(**values)), values, state


@pytest.mark.parametrize("names", [SETS["rod_mass"], SETS["all"]], ids=["rods", "all"])
def test_masses_of_0_are_the_lagrangian_s(names):
    for scene, values, state in weightless(names, 20):
        expected = derived(scene, values, state)
        assert_same(dense.accelerations(scene, *state), expected, 1e-13)
        assert_same(recursion.accelerations(scene, *state), expected, 1e-13)
        first, second = (extended_accelerations(form, scene, state) for form in (inertia_form, mobility_form))
        assert_same(first[:, 0], expected, 1e-13)
        assert np.abs((first - second).sum(axis=1)).max() < 1e-28 * np.abs(expected).max()


@pytest.mark.parametrize("name", [name for name in SETS if name != "all"])
def test_every_effect_is_in_the_lagrangian(name):
    """Otherwise the test above would prove nothing."""
    for scene, values, state in cases(SETS[name], N, 5):
        without = {key: value for key, value in values.items() if key != name}
        found, bare = derived(scene, values, state), derived(scene, without, state)
        assert np.abs(found - bare).max() > 1e-3 * np.abs(found).max()


def test_values_for_each_link_differ_from_link_to_link():
    """A list's entries are those of its own joints or rods, not of others."""
    for scene, values, state in cases((*SETS["all"], "armature"), N, 5):
        expected = dense.accelerations(scene, *state)
        for name in ("joint_damping", "joint_stiffness", "joint_rest", "joint_torque", "rod_mass", "armature"):
            turned = given(scene, **{**values, name: values[name][::-1]})
            if values[name] != values[name][::-1]:
                assert np.abs(dense.accelerations(turned, *state) - expected).max() > 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize("n", [1, 2, 3, 10, 40])
@pytest.mark.parametrize("names", ALL_SETS, ids="-".join)
def test_recursion_is_the_dense_form(names, n):
    for scene, _, state in cases(names, n, 5):
        # What the dense solve loses grows with n: measured 8e-14 at n = 40.
        assert_same(recursion.accelerations(scene, *state), dense.accelerations(scene, *state), 1e-12)


@pytest.mark.parametrize(
    "names", [names for names in ALL_SETS if not {"rod_mass", "armature"} & {*names}], ids="-".join
)
def test_newton_holds_for_every_mass(names):
    """Mass times acceleration against free fall is the pull of two rods and what pushes: no matrix, no recursion."""
    for scene, _, (theta, omega, t) in cases(names, 9, 3):
        angular = recursion.accelerations(scene, theta, omega, t)
        pull = np.append(recursion.tensions(scene, theta, omega, t), 0.0)[:, None]
        along = np.stack([np.sin(theta), -np.cos(theta)], axis=-1)
        across = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
        rods = scene.lengths[:, None] * (angular[:, None] * across - omega[:, None] ** 2 * along)
        left = scene.masses[:, None] * (np.cumsum(rods, axis=0) + acting.pivot_acceleration(scene, t))
        pulls = pull[1:] * np.append(along[1:], [[0.0, 0.0]], axis=0) - pull[:-1] * along
        assert_same(left, pulls + acting.mass_forces(scene, t, theta, omega), 1e-13)


def test_two_rods_are_the_textbook_s():
    """The double pendulum of two equal uniform rods and nothing else: Wikipedia, "Double pendulum"."""
    rod, length, g = 2.0, 0.7, GRAVITY
    for seed in range(10):
        a, b, wa, wb = np.random.default_rng(seed).uniform(-3.0, 3.0, 4)
        effects = Effects(gravity=g, rod_mass=rod)
        scene = Scene("", "", 1.0, [0.0, 0.0], [length, length], [a, b], [wa, wb], effects)
        matrix = np.array([[8.0, 3.0 * np.cos(a - b)], [3.0 * np.cos(a - b), 2.0]]) / 6.0
        right = -0.5 * np.array(
            [wb**2 * np.sin(a - b) + 3 * g / length * np.sin(a), -(wa**2) * np.sin(a - b) + g / length * np.sin(b)]
        )
        assert_same(recursion.accelerations(scene, [a, b], [wa, wb]), np.linalg.solve(matrix, right), 1e-13)


# The reference's two forms, in 32 digits


@compiled
def _extended(system, y, dy):
    extended_derivative(system, y, dy)


def forms_of(scene):
    """The reference's two, as it chooses them."""
    return (rotor_form, matrix_form) if "armature" in scene.terms else (inertia_form, mobility_form)


def extended_accelerations(form, scene, state):
    """theta'' as (n, 2): high and low parts."""  # noqa: D403
    system, y = form(scene)
    y[-1, 0] = state[2]
    dy = np.empty_like(y)
    _extended(system, y, dy)
    n = scene.n
    np.testing.assert_array_equal(dy[:n], y[n : 2 * n])
    np.testing.assert_array_equal(dy[-1], [1.0, 0.0])
    return dy[n : 2 * n]


@pytest.mark.parametrize("names", SETS.values(), ids="-".join)
def test_both_sides_of_the_reference_have_the_same_accelerations(names):
    for n in (1, 2, 3, 10):
        for scene, _, state in cases(names, n, 3):
            first, second = (extended_accelerations(form, scene, state) for form in forms_of(scene))
            largest = np.abs(first[:, 0]).max()
            # Measured: 1e-30, and 8e-15 for what doubles make of it.
            assert np.abs((first - second).sum(axis=1)).max() < 1e-28 * largest
            assert_same(first[:, 0], recursion.accelerations(scene, *state), 1e-13)
            assert np.abs(first[:, 1]).max() > 1e-20 * largest  # the low parts are there


@pytest.mark.parametrize("names", SETS.values(), ids="-".join)
def test_thirty_digits_agree(names):
    """The two sides share the effects' laws; the Lagrangian in 40 digits does not."""
    for scene, values, state in cases(names, N, 2):
        found = extended_accelerations(forms_of(scene)[0], scene, state)
        with mpmath.workdps(40):
            matrix, right = equations("mpmath")(*map(mpmath.mpf, map(float, arguments(scene, values, *state))))
            expected = mpmath.lu_solve(mpmath.matrix(matrix), mpmath.matrix(right))
            sums = [mpmath.mpf(high) + mpmath.mpf(low) for high, low in found.tolist()]
            errors = [abs(a - b) for a, b in zip(sums, expected, strict=True)]
            assert max(errors) < 1e-29 * max(map(abs, expected))  # measured: 3e-32


@pytest.mark.parametrize(
    ("effects", "bound"),
    [
        ({"driven_pivot": {"axis": "y", "amplitude": 0.03, "angular_frequency": 15.0}}, 1e-14),
        ({"joint_damping": 0.05}, 1e-10),
        ({"joint_stiffness": 2.0}, 1e-8),
        ({"air_drag": {"linear": 0.05}}, 1e-9),
        ({"rod_mass": 0.3}, 3e-8),
        ({"armature": 0.1}, 2e-7),
    ],
)
def test_masses_over_sixteen_decades_cost_no_more_digits_than_is_said(effects, bound):
    """Measured: 2e-15, 2e-11, 3e-9, 3e-10, 7e-9 and 4e-8; docs/effects.md says so."""
    for hard in hard_chains("random over sixteen decades", range(20)):
        scene = given(hard, gravity=9.81, **effects)
        exact = extended_accelerations(forms_of(scene)[0], scene, (scene.angles, scene.rates, 0.3))[:, 0]
        found = recursion.accelerations(scene, scene.angles, scene.rates, 0.3)
        assert np.abs(found - exact).max() < bound * np.abs(exact).max()
