"""Rigid links against computer algebra, closed forms, the chains that they contain, and engines' own accelerations."""

from __future__ import annotations

import dataclasses
from functools import cache
from importlib.util import find_spec

import mpmath
import mujoco
import numpy as np
import pytest
import sympy as sp

import pendbench as pb
from effects.test_effects_symbolic import extended_accelerations
from pendbench.engines.joints import joint_values
from pendbench.engines.mujoco.mjcf import compile_chain, write_mjcf
from pendbench.engines.protocol import refusal
from pendbench.engines.registry import engine
from pendbench.physics import dense, energy
from pendbench.physics.exact import single_pendulum
from pendbench.physics.extended.inertias import inertia_form
from pendbench.physics.extended.matrices import matrix_form
from pendbench.physics.extended.mobilities import mobility_form, suits
from pendbench.physics.extended.rotors import rotor_form
from pendbench.physics.kernels import recursion
from pendbench.scene.links import Links
from pendbench.scene.scene import Effects, Scene
from support.effect_sets import GRAVITY, USUAL
from support.scenes import chain, random_chain

N = 3
LINKS = range(N)
ANGLE, RATE = sp.symbols(f"theta1:{N + 1}"), sp.symbols(f"omega1:{N + 1}")
MASS, CENTRE, INERTIA, LENGTH, ROTOR = (sp.symbols(f"{name}1:{N + 1}") for name in ("m", "c", "J", "l", "A"))
G = sp.Symbol("g")
TIMES = np.linspace(0.2, 2.0, 10)
PUSHED = {name: value for name, value in USUAL.items() if name not in ("rod_mass", "armature")}


def linked(n: int, seed: int, *, odd: bool = False, **effects: object) -> Scene:
    """Links at random, their centres anywhere on their lines where they are odd, between their ends otherwise."""
    rng = np.random.default_rng(seed)
    lengths = rng.uniform(0.5, 1.5, n)
    centres = lengths * (rng.uniform(-1.0, 2.0, n) if odd else rng.uniform(0.1, 1.0, n))
    links = Links(rng.uniform(0.5, 2.0, n), centres, rng.uniform(0.01, 0.3, n))
    angles, rates = rng.uniform(-3.0, 3.0, (2, n))
    return Scene("links", "Links", 2.0, None, lengths, angles, rates, Effects(gravity=GRAVITY, **effects), links)  # type: ignore[arg-type]


def rotors(n: int, seed: int) -> list[float]:
    """Of each joint, one of them 0 where there are several."""
    numbers = np.random.default_rng(seed).uniform(0.1, 0.5, n)
    numbers[seed % n] *= float(n == 1)
    return numbers.tolist()


def in_motion(expression):
    return sum((sp.diff(expression, ANGLE[j]) * RATE[j] for j in LINKS), 0 * expression)


@cache
def equations(numbers="numpy"):
    """The matrix and the right side of the equations, from each link's centre and turning alone."""
    joint, lagrangian = sp.Matrix([0, 0]), 0
    for i in LINKS:
        along = sp.Matrix([sp.sin(ANGLE[i]), -sp.cos(ANGLE[i])])
        centre = joint + CENTRE[i] * along
        speed = in_motion(centre)
        bend_rate = RATE[i] - (RATE[i - 1] if i else 0)
        lagrangian += MASS[i] * (speed.dot(speed) / 2 - G * centre[1])
        lagrangian += INERTIA[i] * RATE[i] ** 2 / 2 + ROTOR[i] * bend_rate**2 / 2
        joint = joint + LENGTH[i] * along
    momenta = [sp.diff(lagrangian, rate) for rate in RATE]
    matrix = sp.Matrix(N, N, lambda i, j: sp.diff(momenta[i], RATE[j]))
    right = [sp.diff(lagrangian, ANGLE[i]) - in_motion(momenta[i]) for i in LINKS]
    return sp.lambdify(
        (*MASS, *CENTRE, *INERTIA, *LENGTH, *ROTOR, G, *ANGLE, *RATE), [matrix, right], numbers, cse=True
    )


def numbers_of(scene, turned):
    its = scene.links
    return *its.mass, *its.centre, *its.inertia, *scene.lengths, *turned, GRAVITY, *scene.angles, *scene.rates


def assert_same(found, expected, tolerance):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())


@pytest.mark.parametrize("geared", [False, True], ids=["", "geared"])
@pytest.mark.parametrize("odd", [False, True], ids=["between", "anywhere"])
def test_accelerations_are_the_lagrangian_s(odd, geared):
    for seed in range(10):
        turned = rotors(N, seed) if geared else [0.0] * N
        scene = linked(N, seed, odd=odd, armature=turned)
        numbers = numbers_of(scene, turned)
        matrix, right = equations()(*numbers)
        expected = np.linalg.solve(np.array(matrix, float), np.array(right, float))
        # Measured: 3e-15 and 3e-15.
        assert_same(dense.accelerations(scene, scene.angles, scene.rates), expected, 1e-13)
        assert_same(recursion.accelerations(scene, scene.angles, scene.rates), expected, 1e-13)


@pytest.mark.parametrize("geared", [False, True], ids=["", "geared"])
def test_thirty_digits_agree(geared):
    """All forms of the reference with the Lagrangian in 40 digits, which takes the scene's numbers as exact, too."""
    for seed in range(3):
        turned = rotors(N, seed) if geared else [0.0] * N
        scene = linked(N, seed, odd=seed > 0, armature=turned)
        with mpmath.workdps(40):
            matrix, right = equations("mpmath")(*map(mpmath.mpf, map(float, numbers_of(scene, turned))))
            expected = mpmath.lu_solve(mpmath.matrix(matrix), mpmath.matrix(right))
            for form in forms_of(scene):
                found = extended_accelerations(form, scene, (scene.angles, scene.rates, 0.0)).tolist()
                sums = [mpmath.mpf(high) + mpmath.mpf(low) for high, low in found]
                errors = [abs(a - b) for a, b in zip(sums, expected, strict=True)]
                assert max(errors) < 1e-29 * max(map(abs, expected))  # measured: 2e-31


def forms_of(scene):
    if "armature" in scene.terms:
        return rotor_form, matrix_form
    return (inertia_form, matrix_form, mobility_form) if suits(scene) else (inertia_form, matrix_form)


@pytest.mark.parametrize("n", [1, 2, 10, 40])
@pytest.mark.parametrize("effects", [{}, PUSHED, {**PUSHED, "armature": 0.2}], ids=["", "pushed", "geared"])
def test_recursion_is_the_dense_form(effects, n):
    for seed in range(4):
        scene = linked(n, seed, odd=seed % 2 == 1, **{name: its for name, its in effects.items() if name != "gravity"})
        state = scene.angles, scene.rates, 0.3
        # Measured: 3e-13 at n = 40, of which the recursion has 1e-14.
        assert_same(recursion.accelerations(scene, *state), dense.accelerations(scene, *state), 1e-11)
        if n <= 10:
            first, second, *third = (extended_accelerations(form, scene, state) for form in forms_of(scene))
            for other in (second, *third):
                assert np.abs((first - other).sum(axis=1)).max() < 1e-28 * np.abs(first).max()
            assert_same(recursion.accelerations(scene, *state), first[:, 0], 1e-13)


# One link


@pytest.mark.parametrize("rate", [3.0, 12.0], ids=["swings", "turns over"])
@pytest.mark.parametrize("centre", [0.5, 0.9, -0.3], ids=["between", "beyond", "behind"])
def test_one_link_is_the_compound_pendulum(centre, rate):
    """A simple one of the length (J + m c^2) / (m c); upside down, where its centre is behind its joint."""
    mass, inertia, top = 1.5, 0.2, np.pi * (centre < 0.0)
    links = {"mass": mass, "centre": centre, "inertia": inertia}
    scene = Scene("link", "", 2.0, None, [0.7], [0.4], [rate], Effects(gravity=GRAVITY), links)  # type: ignore[arg-type]
    reduced = (inertia + mass * centre**2) / (mass * abs(centre))
    theta, omega = single_pendulum(chain(1, angle=0.4 + top, rate=rate, length=reduced), TIMES)
    found = pb.simulate(scene, times=TIMES)
    np.testing.assert_allclose(found.theta, theta - top, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.omega, omega, rtol=0, atol=1e-12)


def test_a_flywheel_at_the_tip_keeps_its_rate_and_weighs():
    """Its centre in its joint, nothing turns it: the link that carries it swings as if it were a point."""
    links = {"mass": [0.5, 2.0], "centre": [0.3, 0.0], "inertia": [0.05, 0.3]}
    lengths, angles, rates = [0.6, 1.0], [1.0, 0.2], [0.5, 9.0]
    scene = Scene("wheel", "", 2.0, None, lengths, angles, rates, Effects(gravity=GRAVITY), links)  # type: ignore[arg-type]
    found = pb.simulate(scene, times=TIMES)
    np.testing.assert_allclose(found.omega[:, 1], 9.0, rtol=0, atol=1e-12)
    about, moment = 0.05 + 0.5 * 0.3**2 + 2.0 * 0.6**2, 0.5 * 0.3 + 2.0 * 0.6
    theta, _ = single_pendulum(chain(1, angle=1.0, rate=0.5, length=about / moment), TIMES)
    np.testing.assert_allclose(found.theta[:, :1], theta, rtol=0, atol=1e-12)


# The chains that they contain


def test_points_at_the_ends_are_the_chain_of_point_masses():
    for seed in range(5):
        points = random_chain(10, seed, spread=3.0)
        links = Links(points.masses, points.lengths, np.zeros(10))
        scene = dataclasses.replace(points, masses=np.zeros(10), links=links)
        for accelerations in (dense.accelerations, recursion.accelerations):
            expected = recursion.accelerations(points, points.angles, points.rates)
            assert_same(accelerations(scene, points.angles, points.rates), expected, 1e-12)  # measured: 4e-14, dense
        assert energy.energy(scene, points.angles, points.rates) == pytest.approx(
            energy.energy(points, points.angles, points.rates), rel=1e-14
        )


def test_uniform_links_are_rods_with_mass():
    rods = np.random.default_rng(1).uniform(0.5, 2.0, 10)
    for seed in range(5):
        points = dataclasses.replace(random_chain(10, seed, spread=3.0), masses=np.full(10, 1e-30))
        massive = dataclasses.replace(points, effects=Effects(gravity=GRAVITY, rod_mass=rods.tolist()))
        links = Links(rods, points.lengths / 2, rods * points.lengths**2 / 12)
        scene = dataclasses.replace(points, masses=np.zeros(10), links=links)
        expected = recursion.accelerations(massive, points.angles, points.rates)
        assert_same(recursion.accelerations(scene, points.angles, points.rates), expected, 1e-14)


def test_a_rotor_at_the_pivot_is_an_inertia_of_the_first_link():
    plain = linked(5, 3)
    geared = dataclasses.replace(plain, effects=Effects(gravity=GRAVITY, armature=[0.4, 0.0, 0.0, 0.0, 0.0]))
    links = dataclasses.replace(plain.links, inertia=plain.links.inertia + np.array([0.4, 0, 0, 0, 0]))
    heavy = dataclasses.replace(plain, links=links)
    expected = recursion.accelerations(heavy, plain.angles, plain.rates)
    assert_same(recursion.accelerations(geared, plain.angles, plain.rates), expected, 1e-14)


def test_where_the_last_link_ends_changes_nothing_but_its_tip():
    scene = linked(4, 2)
    longer = dataclasses.replace(scene, lengths=[*scene.lengths[:-1], 3.0])
    expected = recursion.accelerations(scene, scene.angles, scene.rates)
    assert_same(recursion.accelerations(longer, scene.angles, scene.rates), expected, 1e-13)


# Motion


@pytest.mark.parametrize("method", ["adaptive", "gauss6"])
@pytest.mark.parametrize("effects", [{}, {"armature": [0.1, 0.0, 0.2]}], ids=["", "geared"])
def test_energy_is_kept_and_the_way_back_is_the_way(effects, method):
    scene = dataclasses.replace(linked(3, 5, odd=True, **effects), rates=np.zeros(3))
    dt = None if method == "adaptive" else 1e-3
    there = pb.simulate(scene, method=method, dt=dt, times=[0.5, 1.0])
    drift = energy.energy(scene, there.theta, there.omega) - energy.energy(scene, scene.angles, scene.rates)
    assert np.abs(drift).max() < 1e-12 * energy.energy_scale(scene)  # measured: 4e-15 and 2e-14
    back = pb.simulate(scene.with_start(there.theta[-1], -there.omega[-1]), method=method, dt=dt, times=[1.0])
    np.testing.assert_allclose(back.theta[-1], scene.angles, rtol=0, atol=1e-10)
    np.testing.assert_allclose(back.omega[-1], 0.0, rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("odd", "effects"), [(False, {}), (True, {}), (False, {"armature": 0.1})], ids=["between", "anywhere", "geared"]
)
def test_the_reference_reaches_its_end_and_the_adaptive_method_agrees(odd, effects):
    scene = linked(4, 7, odd=odd, **effects)
    truth = pb.reference(scene, [0.5, 1.0])
    assert (truth.horizon, truth.reason) == (1.0, "")
    assert truth.disagreement.max() < 1e-22
    assert np.abs(truth.offset(pb.simulate(scene, times=truth.t).theta)).max() < 1e-11


# Engines


@pytest.mark.parametrize("geared", [False, True], ids=["", "geared"])
@pytest.mark.parametrize("n", [1, 2, 5, 20])
def test_mujoco_has_the_same_accelerations(n, geared):
    for seed in range(5):
        scene = linked(n, seed, odd=True, **({"armature": rotors(n, seed)} if geared else {}))
        exact = joint_values(recursion.accelerations(scene, scene.angles, scene.rates))
        for model in (compile_chain(scene), mujoco.MjModel.from_xml_string(write_mjcf(scene))):
            data = mujoco.MjData(model)
            data.qpos[:], data.qvel[:] = joint_values(scene.angles), joint_values(scene.rates)
            mujoco.mj_forward(model, data)
            assert_same(data.qacc, exact, 1e-11)


@pytest.mark.parametrize("geared", [False, True], ids=["", "geared"])
def test_pinocchio_has_the_same_accelerations(geared):
    pin = pytest.importorskip("pinocchio")
    from pendbench.engines.pinocchio import chain_model

    for n in (1, 2, 5, 20):
        for seed in range(5):
            scene = linked(n, seed, odd=True, **({"armature": rotors(n, seed)} if geared else {}))
            exact = joint_values(recursion.accelerations(scene, scene.angles, scene.rates))
            model, start = chain_model(scene), map(joint_values, (scene.angles, scene.rates))
            assert_same(pin.aba(model, model.createData(), *start, np.zeros(n)), exact, 1e-11)


@pytest.mark.parametrize("method", ["default", "tuned"])
def test_pymunk_holds_links_by_their_joints(method):
    scene = linked(2, 3)
    exact = pb.simulate(scene, times=[0.2])
    errors = []
    for dt in (1e-3, 5e-4):
        run = pb.simulate(scene, "pymunk", method, dt, times=[0.2])
        assert run.status == "ok"
        errors.append(np.abs(run.theta - exact.theta).max())
    assert errors[1] < 0.02
    assert errors[0] / errors[1] == pytest.approx({"default": 2.0, "tuned": 4.0}[method], rel=0.2)


def test_what_pymunk_and_heyoka_cannot_do_is_refused_in_one_line():
    point = dataclasses.replace(linked(2, 1), links=Links(1.0, 0.3, 0.0))  # type: ignore[arg-type]
    assert refusal(engine("pymunk"), "default", point) == "links with an inertia of 0"
    geared = linked(2, 1, armature=0.1)
    refused = "no armature: its joints have no inertia of their own"
    assert refusal(engine("pymunk"), "default", geared) == refused
    if find_spec("heyoka"):
        alone = "the adapter writes the equations of motion under gravity alone"
        assert refusal(engine("heyoka"), "taylor", linked(2, 1)) == f"no links: {alone}"
