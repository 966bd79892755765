"""Canonical variables, Gauss-Legendre collocation and RATTLE."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pendbench.physics import canonical, dense
from pendbench.physics.energy import angular_momentum, energy, energy_scale, potential_energy
from pendbench.physics.exact import single_pendulum
from pendbench.physics.recursion import system_of
from pendbench.recording import simulate
from pendbench.scene import Scene, load_scene
from pendbench.solvers.gauss import collocate, gauss_legendre
from scenes import random_chain

SYMPLECTIC = ["gauss4", "gauss6", "rattle", "frame"]


def written(kernel: object, scene: Scene, *arguments: object) -> np.ndarray:
    """What a kernel of `canonical` writes."""
    out = np.empty(scene.n)
    kernel(system_of(scene), *(np.array(a) if isinstance(a, np.ndarray) else a for a in arguments), out)
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


@pytest.mark.parametrize("stages", [2, 3])
def test_gauss_legendre_runs_backwards_to_where_it_came_from(stages: int) -> None:
    scene, method = random_chain(4, seed=4), gauss_legendre(stages)
    system, q = system_of(scene), scene.angles.copy()
    p = written(canonical.write_momenta, scene, scene.angles, scene.rates)
    carry, slopes = np.zeros((2, 4)), np.zeros((2, stages, 4))
    assert collocate(system, method, 0, 1e-3, q, p, carry, slopes, 300) == 300
    assert np.abs(q - scene.angles).max() > 0.1  # it went somewhere
    slopes[:] = 0.0
    assert collocate(system, method, 0, -1e-3, q, p, carry, slopes, 300) == 300
    assert q == pytest.approx(scene.angles, abs=1e-11)


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
    assert 0 < run.gap.max() < 1e-13


@pytest.mark.parametrize("method", ["gauss4", "gauss6", "rattle"])
def test_steps_that_do_not_converge_are_a_status(method: str) -> None:
    scene = dataclasses.replace(load_scene("chain10"), rates=np.full(10, 50.0))
    run = simulate(scene, "analytic", method, 0.5, [0.5, 1.0, 5.0])
    assert run.status == "not converged"
    assert "a smaller step might" in run.reason
