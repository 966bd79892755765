"""Canonical variables, Gauss-Legendre collocation and RATTLE."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from pendbench.engines.recording import simulate
from pendbench.physics import dense
from pendbench.physics.energy import angular_momentum, energy, energy_scale, potential_energy
from pendbench.physics.exact import single_pendulum
from pendbench.physics.kernels import canonical
from pendbench.physics.kernels.table import system_of
from pendbench.scene.scene import Effects, Scene, load_scene
from pendbench.solvers import gauss, newton
from pendbench.solvers.collocation import Motion, gauss_legendre, motion_from
from pendbench.solvers.methods import fixed_step_methods
from support.kernels import called
from support.scenes import chain, random_chain

SYMPLECTIC = ["gauss4", "gauss6", "rattle", "frame"]


def written(kernel: object, scene: Scene, *arguments: object) -> np.ndarray:
    """What a kernel of `canonical` writes."""
    out = np.empty(scene.n)
    called(kernel)(system_of(scene), *(np.array(a) if isinstance(a, np.ndarray) else a for a in arguments), out)
    return out


@pytest.mark.parametrize("n", [1, 2, 3, 9, 40])
def test_momenta_are_the_mass_matrix_times_the_rates(n: int) -> None:
    scene = random_chain(n, seed=n)
    expected = dense.mass_matrix(scene, scene.angles) @ scene.rates
    assert written(canonical.write_momenta, scene, scene.angles, scene.rates) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3, 9, 40])
def test_rates_invert_momenta(n: int) -> None:
    scene = random_chain(n, seed=n)
    momenta = written(canonical.write_momenta, scene, scene.angles, scene.rates)
    found = written(canonical.write_rates, scene, scene.angles, momenta)
    assert found == pytest.approx(scene.rates, rel=1e-9, abs=1e-9)  # the matrix has a condition number up to 1e5 here


@pytest.mark.parametrize("gravity", [None, 9.81])
def test_forces_are_the_gradient_of_the_lagrangian(gravity: float | None) -> None:
    scene, h = random_chain(5, seed=5, gravity=gravity), 1e-5

    def lagrangian(theta: np.ndarray) -> float:
        kinetic = 0.5 * scene.rates @ dense.mass_matrix(scene, theta) @ scene.rates
        return float(kinetic - potential_energy(scene, theta))

    steps = h * np.eye(scene.n)
    gradient = [(lagrangian(scene.angles + s) - lagrangian(scene.angles - s)) / (2 * h) for s in steps]
    found = written(canonical.write_forces, scene, 0.0, scene.angles, scene.rates)
    assert found == pytest.approx(gradient, rel=1e-7, abs=1e-7)  # h^2, and rounding over h


@pytest.mark.parametrize("stages", [1, 2, 3, 4])
def test_gauss_legendre_integrates_polynomials_of_twice_its_stages(stages: int) -> None:
    method = gauss_legendre(stages)
    assert method.order == 2 * stages
    assert method.a.sum(axis=1) == pytest.approx(method.c, abs=1e-15)
    for k in range(2 * stages):
        assert method.b @ method.c**k == pytest.approx(1 / (k + 1), abs=1e-14)
    assert abs(method.b @ method.c ** (2 * stages) - 1 / (2 * stages + 1)) > 1e-8


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_gauss_legendre_is_symplectic(stages: int) -> None:
    a, b = gauss_legendre(stages).a, gauss_legendre(stages).b
    # Hairer, Lubich, Wanner, Geometric Numerical Integration, theorem VI.4.3
    assert b[:, None] * a + (b[:, None] * a).T == pytest.approx(np.outer(b, b), abs=1e-15)


# Fixed-point iteration alone, and Newton's method alone.
SOLVERS = {"iteration": gauss.collocate, "newton": newton.collocate_by_newton}


def start_of(scene: Scene, stages: int) -> Motion:
    bare = dataclasses.replace(scene, effects=Effects())  # they are the same, and one kernel has them all
    momenta = written(canonical.write_momenta, bare, scene.angles, scene.rates)
    return motion_from(scene.angles, momenta, scene.rates, stages)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("stages", [2, 3])
def test_gauss_legendre_runs_backwards_to_where_it_came_from(stages: int, solver: str) -> None:
    scene, method, collocate = random_chain(4, seed=4), gauss_legendre(stages), SOLVERS[solver]
    system, motion = system_of(scene), start_of(scene, stages)
    assert collocate(system, method, motion, 0, 1e-3, 300) == 300
    assert np.abs(motion.q - scene.angles).max() > 0.1  # it went somewhere
    motion.slopes[:] = 0.0
    assert collocate(system, method, motion, 0, -1e-3, 300) == 300
    assert motion.q == pytest.approx(scene.angles, abs=1e-11)


@pytest.mark.parametrize("stages", [1, 2, 3, 4])
def test_modes_take_the_method_apart(stages: int) -> None:
    method = gauss_legendre(stages)
    found = (method.from_modes * method.eigenvalues) @ method.to_modes
    assert found.real == pytest.approx(method.a, abs=1e-14)
    assert len(method.eigenvalues) == (stages + 1) // 2


@pytest.mark.parametrize("effects", [{}, {"joint_damping": 0.4}, {"air_drag": {"linear": 0.1, "quadratic": 0.2}}])
@pytest.mark.parametrize("stages", [2, 3])
def test_newton_finds_what_the_iteration_finds(stages: int, effects: dict[str, object]) -> None:
    """So it has the same order. Steps of 10 ms: to rounding, which the chain's motion makes ten times larger."""
    scene = dataclasses.replace(random_chain(4, seed=4), effects=Effects(gravity=9.81, **effects))
    one, other = start_of(scene, stages), start_of(scene, stages)
    for motion, collocate in ((one, gauss.collocate), (other, newton.collocate_by_newton)):
        assert collocate(system_of(scene), gauss_legendre(stages), motion, 0, 1e-2, 50) == 50
    assert np.abs(one.q - scene.angles).max() > 0.1
    assert other.q == pytest.approx(one.q, abs=1e-12)
    assert other.p == pytest.approx(one.p, abs=1e-12)


def stability_function(stages: int, z: float) -> float:
    """The diagonal Pade approximation of exp z, from its definition (Hairer and Wanner, SODE II, theorem IV.3.11)."""
    f = math.factorial
    weights = [f(2 * stages - j) * f(stages) / (f(2 * stages) * f(j) * f(stages - j)) for j in range(stages + 1)]
    return sum(w * z**j for j, w in enumerate(weights)) / sum(w * (-z) ** j for j, w in enumerate(weights))


@pytest.mark.parametrize("z", [-0.1, -2.0, -5.0, -1e2, -1e4, -1e6])
@pytest.mark.parametrize("stages", [2, 3])
def test_damping_of_any_strength_is_stable(stages: int, z: float) -> None:
    """Without weight a damped pendulum of 1 kg at 1 m is p' = -c p: each step multiplies p by R(-c h), |R| < 1."""
    scene = dataclasses.replace(chain(1, length=1.0, rate=0.5), effects=Effects(joint_damping=-z / 1e-2))
    method = fixed_step_methods()[f"gauss{2 * stages}"]
    motion = start_of(scene, stages)
    assert method.advance(system_of(scene), motion, 0, 1e-2, 3) == 3
    expected = stability_function(stages, z) ** 3 * 0.5
    assert abs(expected) < 0.5
    # The momentum is a difference of forces that are z times as large.
    assert motion.p[0] == pytest.approx(expected, abs=1e-15 * max(10.0, abs(z)))


@pytest.mark.parametrize("method", ["gauss4", "gauss6"])
def test_stiff_damping_is_followed_with_steps_far_longer(method: str) -> None:
    """5000 N m s/rad on 1 kg at 1 m: theta from Radau with a tolerance of 1e-12."""
    scene = dataclasses.replace(
        chain(1, length=1.0, angle=1.5), effects=Effects(gravity=9.81, joint_damping=5000.0), duration=2.0
    )
    run = simulate(scene, "analytic", method, 1e-3, [1.0, 2.0])
    assert (run.status, run.reason) == ("ok", "")
    assert run.theta[:, 0] == pytest.approx([1.49804344, 1.49608677], abs=1e-8)


@pytest.mark.parametrize("method", ["gauss4", "gauss6"])
def test_stiff_springs_keep_the_energy_in_a_band_and_run_backwards(method: str) -> None:
    """Springs of 1e7 N m/rad swing 5 times and more in a step of 10 ms: no iteration converges, Newton's does."""
    scene = dataclasses.replace(
        chain(3, length=1.0, angle=[0.4, 0.4, 0.4]), effects=Effects(gravity=9.81, joint_stiffness=[1e-3, 1e7, 1e7])
    )
    times = np.arange(0.0, 40.0, 0.1).round(3)
    run = simulate(scene, "analytic", method, 1e-2, times)
    assert run.status == "ok", run.reason
    strays = (energy(scene, run.theta, run.omega) - energy(scene, scene.angles, scene.rates)) / energy_scale(scene)
    band = np.ptp(strays)
    assert band < 1e-2
    assert abs(np.polyfit(run.t, strays, 1)[0]) * run.t[-1] < 0.1 * band + 1e-10
    back = simulate(scene.with_start(run.theta[-1], -run.omega[-1]), "analytic", method, 1e-2, times)
    assert back.theta[-1] == pytest.approx(scene.angles, abs=1e-8)


def test_how_a_run_is_cut_into_calls_changes_nothing() -> None:
    """Also where the iteration is tried again between steps with Newton's method."""
    scene = dataclasses.replace(chain(2, length=1.0, angle=1.0), effects=Effects(gravity=9.81, joint_damping=3000.0))
    method, motions = fixed_step_methods()["gauss4"], [start_of(scene, 2), start_of(scene, 2)]
    assert method.advance(system_of(scene), motions[0], 0, 1e-3, 120) == 120
    for first in range(0, 120, 7):
        method.advance(system_of(scene), motions[1], first, 1e-3, min(7, 120 - first))
    np.testing.assert_array_equal(motions[0].q, motions[1].q)
    np.testing.assert_array_equal(motions[0].p, motions[1].p)


def test_what_is_too_large_for_newton_is_not_converged() -> None:
    n = newton.MOST_COORDINATES + 1
    scene = dataclasses.replace(chain(n, length=0.1, angle=0.1), effects=Effects(gravity=9.81, joint_damping=5000.0))
    run = simulate(scene, "analytic", "gauss4", 1e-3, [1e-3])
    assert run.status == "not converged"


@pytest.mark.parametrize("method", SYMPLECTIC)
def test_energy_has_a_band_and_no_slope(method: str) -> None:
    scene = load_scene("double_calm")
    run = simulate(scene, "analytic", method, 5e-2, np.arange(0.0, 300.0, 0.1).round(3))
    strays = (energy(scene, run.theta, run.omega) - energy(scene, scene.angles, scene.rates)) / energy_scale(scene)
    band = np.ptp(strays)
    assert 1e-13 < band < 1e-2
    assert abs(np.polyfit(run.t, strays, 1)[0]) * run.t[-1] < 0.1 * band


def test_rk4_has_a_slope() -> None:
    """What the test before this one would see of a method that drifts."""
    scene = load_scene("double_calm")
    run = simulate(scene, "analytic", "rk4", 2e-2, np.arange(0.0, 300.0, 0.1).round(3))
    strays = energy(scene, run.theta, run.omega) / energy_scale(scene)
    assert abs(np.polyfit(run.t, strays, 1)[0]) * run.t[-1] > 0.5 * np.ptp(strays)


@pytest.mark.parametrize("method", SYMPLECTIC)
def test_angular_momentum_is_kept_without_gravity(method: str) -> None:
    scene = random_chain(4, seed=4, gravity=None)
    run = simulate(scene, "analytic", method, 2e-3, np.arange(0.0, 4.0, 0.1).round(3))
    momentum = angular_momentum(scene, run.theta, run.omega)
    # Quadratic in positions and momenta: kept by these methods to rounding (GNI, IV.2), unlike the energy.
    assert np.ptp(momentum) < 1e-11 * abs(momentum[0]) + 1e-11


@pytest.mark.parametrize("method", SYMPLECTIC)
def test_turns_are_counted(method: str) -> None:
    scene = dataclasses.replace(load_scene("single"), rates=np.array([12.0]))
    times = np.arange(0.0, 5.0, 0.5)
    run = simulate(scene, "analytic", method, 1e-4, times)
    theta, _ = single_pendulum(scene, times)
    assert theta[-1, 0] > 6 * np.pi
    assert run.theta == pytest.approx(theta, abs=1e-4)


def test_rattle_keeps_the_rods_lengths() -> None:
    run = simulate("chain10", "analytic", "rattle", 1e-3, np.arange(0.0, 2.0, 0.1).round(3))
    assert run.status == "ok"
    assert 0 < run.gap.max() < 1e-12


@pytest.mark.parametrize(("method", "rate"), [("gauss4", 50.0), ("gauss6", 50.0), ("rattle", 1e5)])
def test_steps_that_do_not_converge_are_a_status(method: str, rate: float) -> None:
    scene = dataclasses.replace(load_scene("chain10"), rates=rate * np.arange(10))
    run = simulate(scene, "analytic", method, 0.5, [0.5, 1.0, 5.0])
    assert run.status == "not converged"
    assert "a smaller step might" in run.reason
