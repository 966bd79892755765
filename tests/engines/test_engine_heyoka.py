"""The heyoka adapter: the same physics to rounding, no blind first step, and runs that fail say so."""

from __future__ import annotations

import dataclasses
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import pendbench as pb
from pendbench.base.errors import MissingEngineError
from pendbench.engines import registry
from pendbench.engines.protocol import refusal
from pendbench.physics.energy import angular_momentum, energy, energy_scale
from pendbench.physics.geometry import distance
from pendbench.scene.scene import Effects, Scene
from support.hard_chains import HARD, exact_accelerations, hard_chains, relative_error
from support.scenes import chain, random_chain

hy = pytest.importorskip("heyoka")
from pendbench.engines import heyoka as adapter  # noqa: E402

ENGINE = adapter.HeyokaEngine()
TOLERANCES = [1e-2, 1e-6, 1e-9, 1e-10, 1e-13, 1e-15, float(np.finfo(float).eps)]  # orders 4 to 20


@pytest.fixture(params=["unrolled", "compact"])
def code(request, monkeypatch):
    """Have the adapter build either kind of machine code, whatever the chain."""
    unrolled = request.param == "unrolled"
    monkeypatch.setattr(adapter, "_MOST_UNROLLED", 10**9 if unrolled else 0)
    assert ENGINE.build(chain(1), "taylor", None)._integrator.compact_mode is not unrolled
    return request.param


def error(scene: Scene, times: list[float], **settings: float) -> float:
    """The largest e(t) (E22) at the given times."""
    truth = pb.reference(scene, times)
    assert truth.horizon == times[-1]
    found = pb.simulate(scene, ENGINE, times=times, **settings)
    assert found.status == "ok"
    return float(distance(scene.lengths, truth.theta, truth.offset(found.theta)).max())


@pytest.mark.parametrize("kind", HARD)
def test_accelerations_keep_their_digits(kind):
    worst = 0.0
    for scene in hard_chains(kind, range(1)):
        if scene.n > 8:
            continue
        integrator = ENGINE.build(scene, "taylor", None, tolerance=1e-2)._integrator
        integrator.step(write_tc=True)
        worst = max(worst, relative_error(integrator.tc[scene.n : 2 * scene.n, 1], exact_accelerations(scene)))
    # Measured over 6 chains of each kind: 1e-14 for lengths, 2e-15 for all others.
    assert worst < (1e-13 if kind.startswith("lengths") else 2e-14)


@pytest.mark.parametrize(
    ("scene", "times"),
    [("double", [0.5, 1.0, 3.0]), ("chain10", [0.5, 1.0]), (random_chain(3, seed=4), [0.5, 1.0])],
    ids=["double", "chain10", "unlike links"],
)
def test_agrees_with_the_reference_to_rounding(scene, times):
    # Measured: 2e-15.
    assert error(scene if isinstance(scene, Scene) else pb.load_scene(scene), times) < 1e-13


def test_both_kinds_of_code_agree_with_the_reference(code):  # noqa: ARG001
    assert error(random_chain(4, seed=2), [0.5, 1.0]) < 1e-13


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_release_from_the_horizontal_has_no_step_without_bound(tolerance):
    """At orders 8, 12, 16 and 20 the last two terms of every angle and rate are zero there."""
    assert error(pb.load_scene("double"), [0.25, 0.5], tolerance=tolerance) < tolerance + 1e-14


def test_these_tolerances_have_all_the_orders_that_could_go_wrong():
    assert {8, 12, 16, 20} <= {adapter.taylor_order(tolerance) for tolerance in TOLERANCES}


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_the_order_is_the_one_that_heyoka_chooses(tolerance):
    run = ENGINE.build(chain(1), "taylor", None, tolerance=tolerance)
    assert run._integrator.order == adapter.taylor_order(tolerance)
    assert run._integrator.tol == tolerance


def test_the_order_claimed_is_that_of_heyokas_own_tolerance():
    x = hy.expression("x")
    integrator = hy.taylor_adaptive([(x, -x)], [1.0])
    assert integrator.tol == ENGINE.methods["taylor"].settings["tolerance"].default
    assert integrator.order == ENGINE.methods["taylor"].order


def test_code_is_unrolled_as_far_as_compiling_stays_bearable(monkeypatch):
    monkeypatch.setattr(adapter, "_MOST_UNROLLED", 4 * (20**2 + 4))
    compact = [ENGINE.build(chain(n), "taylor", None)._integrator.compact_mode for n in (4, 5)]
    assert compact == [False, True]


@pytest.mark.parametrize("gravity", [9.81, None])
def test_energy_is_conserved(gravity):
    scene = random_chain(5, seed=6, spread=2.0, gravity=gravity)
    found = pb.simulate(scene, ENGINE, times=np.linspace(0.0, 4.0, 9))
    energies = energy(scene, found.theta, found.omega)
    # Measured: 3e-15 of the scale.
    assert np.ptp(energies) < 1e-13 * energy_scale(scene)
    momenta = angular_momentum(scene, found.theta, found.omega)
    assert (np.ptp(momenta) < 1e-13 * np.abs(momenta).max()) == (gravity is None)


def test_zero_gravity_is_no_gravity():
    absent, zero = (
        pb.simulate(chain(3, angle=1.0, rate=[1.0, -2.0, 3.0], gravity=g), ENGINE, times=[0.0, 0.5])
        for g in (None, 0.0)
    )
    np.testing.assert_array_equal(absent.theta, zero.theta)


def test_what_does_not_accelerate_takes_one_step():
    run = ENGINE.build(chain(1, angle=1.0, rate=2.0, gravity=None), "taylor", None)
    assert run.advance_to(3.0) == 1
    assert run.state().theta == pytest.approx([7.0], rel=1e-15)


def test_a_tighter_tolerance_takes_more_work_for_less_error():
    scene = pb.load_scene("double")
    found = [error(scene, [1.0], tolerance=tolerance) for tolerance in (1e-3, 1e-6, 1e-9, 1e-12)]
    assert found == sorted(found, reverse=True)
    assert found[0] > 1e-9
    assert found[-1] < 1e-12


def test_steps_are_counted_and_limited():
    free = ENGINE.build(chain(2), "taylor", None)
    needed = free.advance_to(0.5) + free.advance_to(1.0)
    enough, short = (ENGINE.build(chain(2), "taylor", None, most_steps=needed - k) for k in (0, 1))
    assert enough.advance_to(0.5) + enough.advance_to(1.0) == needed
    assert enough.health() is None
    assert short.advance_to(0.5) + short.advance_to(1.0) == needed - 1
    assert short.health().status == "work limit"
    assert short.advance_to(1.0) == 0
    assert enough.advance_to(2.0) == 0
    assert enough.health().status == "work limit"


def test_a_state_that_is_not_finite_is_reported(code):  # noqa: ARG001
    run = ENGINE.build(chain(2), "taylor", None)
    run._integrator.state[2] = np.nan
    run.advance_to(0.5)
    assert run.health().status == "not finite"
    assert "0.5 s" in run.health().reason


def test_hard_numbers_give_a_state_or_a_fault_and_no_exception():
    for scene in (
        chain(3, mass=[1e-50, 1e50, 1.0]),
        chain(3, length=1e-50),
        chain(3, length=1e50, rate=1e9),
        chain(3, length=[1e50, 1e-50, 1.0], mass=[1e50, 1e-50, 1.0], rate=1e9),
    ):
        run = ENGINE.build(scene, "taylor", None, most_steps=1000)
        run.advance_to(0.1)
        assert run.health() is not None or np.isfinite(run.state().theta).all()


def test_refuses_chains_that_take_too_long_to_compile():
    assert ENGINE.refuses(chain(200)) is None
    assert "201 links" in ENGINE.refuses(chain(201))


def test_refuses_an_effect_that_it_does_not_know():
    damped = dataclasses.replace(chain(2), effects=Effects(gravity=9.81, joint_damping=0.1))
    assert refusal(ENGINE, "taylor", chain(2)) is None
    assert refusal(ENGINE, "taylor", damped).startswith("no joint_damping: the adapter")


def test_without_heyoka_the_message_is_the_command_that_brings_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "heyoka", None)  # importing it now fails as if it were not there
    monkeypatch.delitem(sys.modules, "pendbench.engines.heyoka")
    with pytest.raises(MissingEngineError) as caught:
        registry.engine("heyoka")
    assert 'pip install --upgrade "pendbench[heyoka]"' in str(caught.value)


def test_pyproject_has_the_extras_that_messages_name():
    project = tomllib.loads(Path(__file__).parents[2].joinpath("pyproject.toml").read_text())["project"]
    assert set(project["optional-dependencies"]) & set(registry._BUNDLED) >= set(registry._BUNDLED) - registry._ALONG
