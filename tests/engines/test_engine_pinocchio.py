"""The Pinocchio adapter: our equations, as many digits as ABA has, and no chain that memory cannot take."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from pendbench.base.errors import MissingEngineError
from pendbench.base.faults import Fault
from pendbench.engines import registry
from pendbench.engines.recording import simulate
from pendbench.physics.kernels.recursion import accelerations
from pendbench.scene.scene import Scene
from support.scenes import chain, random_chain

pin = pytest.importorskip("pinocchio")
from pendbench.engines import pinocchio as adapter  # noqa: E402

ENGINE = adapter.PinocchioEngine()


def after(scene: Scene, method: str, dt: float, steps: int):
    run = ENGINE.build(scene, method, dt)
    run.advance(steps)
    return run.state()


def error(scene: Scene) -> float:
    """Of the accelerations at the start, over the largest: a semi-implicit step of 1 s adds them to the rates."""
    exact = accelerations(scene, scene.angles, scene.rates)
    return float(np.abs(after(scene, "euler", 1.0, 1).omega - scene.rates - exact).max() / np.abs(exact).max())


def worst_with_tip(ratio: float, n: int) -> float:
    """The largest error over shapes of a chain whose last mass is `ratio` times each of the others."""
    rng = np.random.default_rng(n)
    masses = np.append(np.ones(n - 1), ratio)
    return max(error(chain(n, mass=masses, angle=rng.uniform(-np.pi, np.pi, n))) for _ in range(20))


# The same system.


@pytest.mark.parametrize("n", [1, 2, 5, 20, 100])
def test_accelerations_are_those_of_point_masses_on_massless_rods(n):
    # Measured over 20 chains of each length: 3e-15.
    assert error(random_chain(n, seed=n)) < 3e-14


@pytest.mark.parametrize("method", ENGINE.methods)
def test_a_method_is_the_textbook_method_on_the_same_equations(method):
    scene = random_chain(5, seed=2)
    theirs, ours = (simulate(scene, engine, method, 2e-3, [0.3, 0.6]) for engine in (ENGINE, "analytic"))
    # Rounding, multiplied by the chain over 0.6 s: measured 1e-15, where the methods' own errors are above 1e-8.
    np.testing.assert_allclose(theirs.theta, ours.theta, rtol=0, atol=1e-13)
    np.testing.assert_allclose(theirs.omega, ours.omega, rtol=0, atol=1e-12)


def test_angles_are_absolute_and_keep_their_turns():
    scene = chain(3, angle=[7.0, -20.0, 0.5], rate=[1.0, -2.0, 3.0], gravity=None)
    state = ENGINE.build(scene, "rk4", 1e-3).state()
    np.testing.assert_allclose(state.theta, scene.angles, rtol=0, atol=1e-14)
    np.testing.assert_allclose(state.omega, scene.rates, rtol=0, atol=1e-14)
    assert after(chain(1, rate=50.0, angle=1.0, gravity=None), "rk4", 1e-2, 100).theta == pytest.approx([51.0])


def test_without_gravity_nothing_pulls():
    absent, zero = (after(chain(3, angle=1.0, rate=[1.0, -2.0, 3.0], gravity=g), "rk4", 1e-3, 300) for g in (None, 0.0))
    np.testing.assert_array_equal(absent.theta, zero.theta)
    assert not adapter.chain_model(chain(2, gravity=None)).gravity.vector.any()


# Masses and lengths.


@pytest.mark.parametrize("ratio", [1e-8, 1e-4])
@pytest.mark.parametrize("n", [2, 3, 20])
def test_a_light_tip_costs_no_digit(ratio, n):
    # Measured: 2e-15.
    assert worst_with_tip(ratio, n) < 2e-14


@pytest.mark.parametrize("ratio", [1e4, 1e8])
def test_a_heavy_tip_costs_as_many_digits_as_its_ratio_has(ratio):
    """If the lower bounds fail, Pinocchio is better than the adapter says."""
    lost = ratio * float(np.finfo(float).eps)
    assert worst_with_tip(ratio, 2) < 1e-14
    # Measured: 0.3 to 2 of `lost`.
    assert 0.01 * lost < worst_with_tip(ratio, 3) < 10 * lost
    assert 0.01 * lost < worst_with_tip(ratio, 20) < 10 * lost


@pytest.mark.parametrize(
    ("mass", "length"), [(1e-17, 1.0), (1e-50, 1e-50), (1e-50, 1e50), (1e50, 1e-50), (1e50, 1e50), (1.0, 1e-12)]
)
def test_masses_and_lengths_far_from_one_are_represented(mass, length):
    # Measured: 6e-16.
    assert error(chain(3, angle=[0.3, -0.2, 0.5], mass=mass, length=length)) < 1e-14


def test_an_appended_body_of_little_mass_would_be_wrong_without_a_word():
    """Why the adapter writes inertias itself; if this fails, Pinocchio no longer needs that."""
    scene = chain(1, mass=1e-17)
    model = adapter.chain_model(scene)
    given = model.inertias[1].copy()
    model.inertias[1] = pin.Inertia.Zero()
    model.appendBodyToJoint(1, given, pin.SE3.Identity())
    assert given.lever[0] == scene.lengths[0]
    assert model.inertias[1].lever[0] < 0.1 * scene.lengths[0]


# What it refuses.


def test_refuses_chains_that_take_too_much_memory():
    assert ENGINE.refuses(chain(200)) is None
    assert "201 links" in ENGINE.refuses(chain(201))
    assert "more than 200" in ENGINE.refuses(chain(201))


def test_memory_grows_as_the_refusal_says():
    """If this fails for being too high a guess, longer chains can be allowed."""
    code = """if True:
        import numpy, pinocchio, psutil
        model = pinocchio.Model()
        for i in range(150):
            model.addJoint(i, pinocchio.JointModelRZ(), pinocchio.SE3.Identity(), str(i))
        before = psutil.Process().memory_info().rss
        data = model.createData()
        print(psutil.Process().memory_info().rss - before)
    """
    told = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    # Measured: 36 n^3 bytes at 150 links; what grows more slowly is the difference.
    assert 30 < int(told.stdout) / 150**3 < 45


# What goes wrong.


@pytest.mark.parametrize("method", ENGINE.methods)
def test_a_run_that_blows_up_is_not_finite(method):
    run = ENGINE.build(chain(5, rate=100.0), method, 10.0)
    run.advance(100)
    assert run.health() == Fault("not finite", "an angle or a rate is not finite")


@pytest.mark.parametrize("method", ENGINE.methods)
def test_what_overflows_in_python_is_not_finite_and_no_warning(method):
    run = ENGINE.build(chain(2, gravity=None), method, 100.0)
    run._v[:] = 1e308
    assert run.health().status == "not finite"  # the sum of both
    run.advance(1)
    assert run.health().status == "not finite"


@pytest.mark.parametrize("method", ENGINE.methods)
def test_hard_numbers_give_a_state_or_a_fault_and_no_exception(method):
    for scene in (
        chain(3, mass=[1e-50, 1e50, 1.0]),
        chain(3, length=1e50, rate=1e9),
        chain(3, length=[1e50, 1e-50, 1.0], mass=[1e50, 1e-50, 1.0], rate=1e9),
    ):
        run = ENGINE.build(scene, method, 1e-3)
        run.advance(100)
        assert run.health() is not None or np.isfinite(run.state().theta).all()


def test_a_step_is_needed():
    with pytest.raises(ValueError, match="needs a step"):
        ENGINE.build(chain(1), "rk4", None)


def test_without_pinocchio_the_message_is_the_command_that_brings_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)  # importing it now fails as if it were not there
    monkeypatch.delitem(sys.modules, "pendbench.engines.pinocchio")
    with pytest.raises(MissingEngineError) as caught:
        registry.engine("pinocchio")
    assert 'pip install --upgrade "pendbench[pinocchio]"' in str(caught.value)
