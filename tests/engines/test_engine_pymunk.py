"""The pymunk adapter: its two methods have the orders they claim, in angles and in rates, and torn joints are seen."""

from __future__ import annotations

import dataclasses

import numpy as np
import pymunk
import pytest
from scipy.integrate import solve_ivp

from pendbench.engines.protocol import State, refusal
from pendbench.engines.pymunk.adapter import PymunkEngine
from pendbench.engines.pymunk.tuning import tuning
from pendbench.physics.dense import accelerations
from pendbench.physics.geometry import distance, wrapped
from pendbench.scene.scene import Effects, Scene
from support.scenes import chain, random_chain

ENGINE = PymunkEngine()


def after(scene: Scene, method: str, dt: float, time: float, **settings: float) -> State:
    run = ENGINE.build(scene, method, dt, **settings)
    run.advance(round(time / dt))
    return run.state()


def truth(scene: Scene, time: float) -> State:
    """The dense form, integrated by scipy to far below the errors measured here."""

    def slope(t, y):  # noqa: ARG001
        theta, omega = np.split(y, 2)
        return np.concatenate([omega, accelerations(scene, theta, omega)])

    start = np.concatenate([scene.angles, scene.rates])
    y = solve_ivp(slope, (0.0, time), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return State(*np.split(y, 2))


def e(scene: Scene, found: State, exact: State) -> float:
    return float(distance(scene.lengths, exact.theta, found.theta - exact.theta))


SCENES = {
    "from rest": chain(2, angle=[1.0, 0.5]),
    "moving": chain(2, angle=[0.4, 0.9], rate=[-1.5, 2.0], mass=[1.0, 0.3], length=[0.5, 0.8]),
    "three, moving": random_chain(3, seed=4),
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("method", ENGINE.methods)
def test_order_of_angles_and_of_rates(method, name):
    scene, time = SCENES[name], 0.5
    exact = truth(scene, time)
    steps = np.array([250, 500, 1000, 2000])
    found = [after(scene, method, time / k, time, iterations=100) for k in steps]
    for quantity in ("theta", "omega"):
        errors = [np.abs(wrapped(getattr(f, quantity) - getattr(exact, quantity))).max() for f in found]
        order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
        assert abs(order - ENGINE.methods[method].order) < 0.2, quantity


@pytest.mark.parametrize("n", [5, 20])
def test_the_chosen_iterations_are_enough_and_far_fewer_are_not(n):
    scene = chain(n)
    exact = truth(scene, 0.3)

    def error(**settings: float) -> float:
        return e(scene, after(scene, "tuned", 1e-3, 0.3, **settings), exact)

    limit = error(iterations=5 * n**2)
    assert error() == pytest.approx(limit, rel=0.01)
    assert error(iterations=n**2 // 16 + 1) > 10 * limit


def test_the_choice_is_made_where_no_iterations_are_given():
    chosen = after(chain(7), "tuned", 1e-3, 0.1)
    given = after(chain(7), "tuned", 1e-3, 0.1, iterations=tuning(np.ones(7), 1e-3).iterations)
    np.testing.assert_array_equal(chosen.theta, given.theta)
    assert not np.array_equal(chosen.theta, after(chain(7), "tuned", 1e-3, 0.1, iterations=8).theta)


def test_default_is_pymunk_as_it_comes():
    assert ENGINE.methods["default"].settings["iterations"].default == pymunk.Space().iterations
    joint = next(iter(ENGINE.build(chain(1), "default", 1e-3)._space.constraints))
    assert joint.error_bias == pymunk.PinJoint(pymunk.Body(1, 1), pymunk.Body(1, 1)).error_bias


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_tuned_stretches_a_turning_rod_by_what_its_step_says(dt):
    rate = 3.0
    found = after(chain(1, angle=1.0, rate=rate, gravity=None), "tuned", dt, 100 * dt)
    # A step along the tangent leaves a rod at l sqrt(1 + a^2), a = rate dt; half a step on with the next velocity,
    # whose part along the rod is -l a^2 / (2 dt), it is at l (1 + 3/8 a^2). The next term is of order a^4.
    assert found.gap == pytest.approx(0.375 * (rate * dt) ** 2, rel=2 * (rate * dt) ** 2 + 1e-4)


@pytest.mark.parametrize("effects", [Effects(gravity=9.81), Effects(gravity=9.81, rod_mass=0.5)])
def test_the_gap_is_that_of_the_worst_joint(effects):
    run = ENGINE.build(Scene("", "", 1.0, [1.0, 1.0], [1.0, 0.5], [0.0, 0.0], [0.0, 0.0], effects), "default", 1e-3)
    body = list(run._space.bodies)[-1]
    body.position = (body.position.x, body.position.y - 0.05)  # a tenth of the second rod; the first stays whole
    assert run.state().gap == pytest.approx(0.1)


def test_both_methods_start_at_the_start():
    scene = random_chain(4, seed=1)
    for method in ENGINE.methods:
        state = ENGINE.build(scene, method, 1e-2).state()
        np.testing.assert_allclose(state.theta, scene.angles, atol=1e-14)
        np.testing.assert_allclose(state.omega, scene.rates, atol=1e-14)
        assert state.gap < 1e-14


@pytest.mark.parametrize("method", ENGINE.methods)
def test_angles_are_followed_through_whole_turns(method):
    rate, every = 40.0, 0.5  # three turns between samples
    run = ENGINE.build(chain(1, angle=30.0, rate=rate, gravity=None), method, 1e-4)
    for k in range(1, 6):
        run.advance(round(every / 1e-4))
        theta = run.state().theta[0]
        # The default method turns slower, by two parts in a hundred at this rate and step: far from a whole turn.
        assert theta == pytest.approx(30.0 + rate * every * k, abs=0.025 * rate * every * k)
        assert run.state().theta[0] == theta


def test_angles_are_followed_over_the_top_under_gravity():
    scene = chain(1, angle=0.0, rate=12.0)
    run, exact = ENGINE.build(scene, "tuned", 1e-4), truth(scene, 1.0)
    for _ in range(20):
        run.advance(500)
        state = run.state()
    assert exact.theta[0] > 2 * np.pi
    assert state.theta[0] == pytest.approx(exact.theta[0], abs=1e-4)


def test_zero_gravity_is_no_gravity():
    absent, zero = (after(chain(3, angle=1.0, rate=[1, -2, 3], gravity=g), "tuned", 1e-3, 0.3) for g in (None, 0.0))
    np.testing.assert_array_equal(absent.theta, zero.theta)


@pytest.mark.parametrize("method", ENGINE.methods)
def test_a_chain_that_comes_apart_is_torn(method):
    run = ENGINE.build(chain(5, rate=30.0), method, 0.1)
    run.advance(20)
    fault = run.health()
    assert fault.status == "torn"
    assert f"{run.state().gap:.3g}" in fault.reason


def test_a_state_that_is_not_finite_is_reported():
    run = ENGINE.build(chain(2), "default", 0.01)
    next(iter(run._space.bodies)).velocity = (np.nan, 0.0)
    run.advance(1)
    assert run.health().status == "not finite"
    assert not np.isfinite(run.state().theta).all()


def test_hard_numbers_give_a_state_or_a_fault_and_no_exception():
    for scene in (chain(3, mass=[1e-50, 1e50, 1.0]), chain(3, length=1e-50), chain(3, length=1e50, rate=1e9)):
        run = ENGINE.build(scene, "tuned", 1e-3)
        run.advance(50)
        assert run.health() is not None or np.isfinite(run.state().theta).all()


def test_refuses_massless_rods_among_heavy_ones():
    heavy = dataclasses.replace(chain(2), effects=Effects(gravity=9.81, rod_mass=[0.1, 0.2]))
    mixed = dataclasses.replace(chain(2), effects=Effects(gravity=9.81, rod_mass=[0.1, 0.0]))
    assert refusal(ENGINE, "tuned", chain(2)) is None
    assert refusal(ENGINE, "tuned", heavy) is None
    assert refusal(ENGINE, "tuned", mixed) == "rods of which some have no mass"
