"""The recording loop and what may be asked of it."""

from __future__ import annotations

import numpy as np
import pytest

from pendbench.base.errors import InputError
from pendbench.base.faults import Fault
from pendbench.engines.protocol import Method, Setting, State
from pendbench.engines.recording import simulate
from pendbench.engines.registry import engine
from pendbench.physics.dense import accelerations
from pendbench.scene.scene import load_scene
from support.installed import installed_engines
from support.scenes import chain
from support.tampered import Passing, Tampered, honest_build, wrapping

SCENE = chain(2, angle=[0.5, 0.3], duration=1.0)
STEPS = {"dt": 0.1, "times": np.arange(11) * 0.1}

EVERY_METHOD = [(name, method) for name in installed_engines() for method in engine(name).methods]


@pytest.mark.parametrize(("name", "method"), EVERY_METHOD)
def test_every_method_records_the_scene(name, method):
    its = engine(name).methods[method]
    adaptive = its.adaptive
    run = simulate(SCENE, name, method, None if adaptive else 0.001, times=[0.0, 0.01, 0.02])
    assert (run.status, run.reason) == ("ok", "")
    assert run.theta.shape == run.omega.shape == (3, 2)
    assert run.gap.shape == (3,)
    assert run.steps == 20 if not adaptive else run.steps >= 1
    np.testing.assert_allclose(run.theta[0], SCENE.angles, rtol=1e-6 if its.single else 1e-15)
    # theta(t) = theta(0) + theta'' t^2 / 2 + O(t^4) from rest; methods of order 1 are off by theta'' t dt / 2.
    change = 0.5 * accelerations(SCENE, SCENE.angles, SCENE.rates) * 0.02**2
    np.testing.assert_allclose(run.theta[2] - SCENE.angles, change, rtol=0.06, atol=its.plateau)


def test_the_default_is_the_cheapest_method_of_the_analytic_engine():
    run = simulate(SCENE, times=[0.0, 1.0])
    named = simulate(SCENE, "analytic", "taylor", times=[0.0, 1.0])
    np.testing.assert_array_equal(run.theta, named.theta)


def test_a_scene_can_be_named_and_an_engine_given():
    by_name = simulate("double", "analytic", "rk4", 0.01, times=[0.0, 0.1])
    given = simulate(load_scene("double"), engine("analytic"), "rk4", 0.01, times=[0.0, 0.1])
    np.testing.assert_array_equal(by_name.theta, given.theta)


# When samples are taken.


def test_adaptive_default_times_span_the_duration():
    run = simulate(SCENE)
    np.testing.assert_array_equal(run.t, np.linspace(0.0, 1.0, 1001))


@pytest.mark.parametrize(
    ("duration", "dt", "count", "last"),
    [
        (1.0, 0.001, 1001, 1.0),
        (1.0, 0.0001, 1001, 1.0),
        (1.0, 0.3, 4, 0.9),
        (0.3, 0.1, 4, 0.3),
        (1.0, 0.0004, 1251, 1.0),
    ],
)
def test_default_times_of_a_fixed_step_are_multiples_of_it(duration, dt, count, last):
    run = simulate(chain(1, duration=duration), "analytic", "euler", dt)
    assert len(run.t) == count
    assert run.t[-1] == pytest.approx(last, rel=1e-12)
    assert run.steps == round(last / dt)
    np.testing.assert_array_equal(run.t, np.rint(run.t / dt) * dt)
    assert np.ptp(np.diff(run.t[:-1])) < 1e-12  # even, but for the last


def test_times_may_lie_beyond_the_duration_and_need_not_begin_at_zero():
    assert simulate(SCENE, "analytic", "rk4", 0.1, times=[0.5, 3.0]).steps == 30
    np.testing.assert_array_equal(simulate(SCENE, times=[0.5, 3.0]).t, [0.5, 3.0])


def test_times_are_those_that_were_reached():
    run = simulate(SCENE, "analytic", "rk4", 0.1, times=[0.0, 0.3 + 5e-8])
    assert run.t[1] == 3 * 0.1


def test_samples_do_not_depend_on_each_other():
    few = simulate(SCENE, "analytic", "rk4", 0.01, times=[0.7])
    many = simulate(SCENE, "analytic", "rk4", 0.01, times=np.arange(71) * 0.01)
    np.testing.assert_array_equal(few.omega[-1], many.omega[-1])


def test_no_engine_is_asked_for_no_steps():
    class Proud(Passing):
        def advance(self, steps):
            assert steps > 0
            self.inner.advance(steps)

        def advance_to(self, time):
            assert time > 0.0
            return self.inner.advance_to(time)

    assert simulate(SCENE, wrapping(Proud), **STEPS).status == "ok"
    adaptive = Tampered(
        make=lambda scene, *given: Proud(honest_build(scene, *given)),
        methods={"adaptive": engine("analytic").methods["adaptive"]},
    )
    assert simulate(SCENE, adaptive, times=[0.0, 0.1]).status == "ok"


def test_settings_reach_the_engine():
    kept = {}

    def make(scene, method, dt, **settings):
        kept.update(settings)
        return honest_build(scene, method, dt)

    methods = {
        "rk4": Method(4, settings={"effort": Setting(3.0, 0.0, 9.0), "turns": Setting(None, 1, 9, integer=True)})
    }
    simulate(SCENE, Tampered(make=make, methods=methods), dt=0.1, effort=2, turns=np.int64(4))
    assert kept == {"effort": 2.0, "turns": 4}
    assert isinstance(kept["turns"], int)
    kept.clear()
    simulate(SCENE, Tampered(make=make, methods=methods), dt=0.1, effort=None)
    assert kept == {}


# What makes no sense.

FIXED = {"engine": "analytic", "method": "rk4", "dt": 0.1}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"scene": "duble"}, "unknown scene 'duble'; did you mean 'double'?"),
        ({"scene": 5}, "neither the name of a scene nor a path"),
        ({"engine": "mujco"}, "unknown engine 'mujco'; did you mean 'mujoco'?"),
        ({"engine": object()}, "which is none"),
        ({"method": "adaptve"}, "engine 'analytic': unknown method 'adaptve'; did you mean 'adaptive'?"),
        ({"method": 4}, "unknown method '4'"),
        ({"dt": 0.1}, "dt is 0.1; allowed: none, since method 'taylor' chooses its steps"),
        ({**FIXED, "dt": None}, "dt is missing; allowed: a number"),
        *[({**FIXED, "dt": dt}, "dt is ") for dt in (0.0, -1.0, np.nan, np.inf, "0.1", True, 10**400, [0.1])],
        ({**FIXED, "dt": 2.0}, "dt is 2; allowed: at most the scene's duration of 1 s"),
        ({**FIXED, "dt": 1e-40}, "dt is 1e-40; allowed: steps of which the run needs at most"),
        ({**FIXED, "dt": 1e-40, "times": [1e300]}, "dt is 1e-40; allowed: steps of which"),
        ({**FIXED, "times": [0.0, 0.15]}, "times has 0.15 s; allowed: whole multiples of dt = 0.1 s"),
        ({**FIXED, "times": [0.0, 0.1 + 1e-6]}, "times has 0.100001 s"),
        ({**FIXED, "times": [0.1, 0.1 + 1e-9]}, "times are closer together than dt"),
        *[
            ({"times": times}, "times is not in order")
            for times in ([0.2, 0.1], [0.1, 0.1], [-0.1], [np.nan], [np.inf])
        ],
        *[({"times": times}, "times is not a list") for times in ([], 0.1, "now", [[0.1]], [None], [0.1, [2]], [True])],
        ({"tolerence": 1e-9}, "method 'taylor': unknown setting 'tolerence'; did you mean 'tolerance'?"),
        ({**FIXED, "tolerance": 1e-9}, "method 'rk4': unknown setting 'tolerance'; allowed: none"),
        *[({"tolerance": value}, "tolerance is ") for value in (0.0, 1.0, np.nan, "1e-9", True, [1e-9])],
        ({"engine": "pymunk", "dt": 0.1, "iterations": 2.5}, "iterations is 2.5; allowed: a whole number from 1 to"),
        ({"engine": "pymunk", "dt": 0.1, "iterations": 0}, "iterations is 0; allowed: a whole number from 1 to"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(arguments, said):
    with pytest.raises(InputError) as caught:
        simulate(**{"scene": SCENE, **arguments})
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


# Runs that go wrong end in a status, and keep what was right.


class After(Passing):
    """Does something else from its fourth step on."""

    taken = 0

    def advance(self, steps):
        self.inner.advance(steps)
        self.taken += steps

    @property
    def spoiled(self) -> bool:
        return self.taken >= 4


class Raises(After):
    def advance(self, steps):
        super().advance(steps)
        if self.spoiled:
            raise RuntimeError("the first line\nand a second")


class RaisesWithoutText(After):
    def state(self):
        if self.spoiled:
            raise AssertionError
        return self.inner.state()


class RunsOutOfMemory(After):
    def health(self):
        if self.spoiled:
            raise MemoryError


class Faults(After):
    def health(self):
        return Fault("warned", "as a test\nwould") if self.spoiled else None


class FaultsOddly(After):
    said: object = ("exploded", "loudly")

    def health(self):
        return self.said if self.spoiled else None


class SaysOk(FaultsOddly):
    said = ("ok", "it is fine")


class SaysTrue(FaultsOddly):
    said = True


class SaysList(FaultsOddly):
    said = ([], "unhashable")


class IsNotFinite(After):
    def state(self):
        theta, omega, _ = self.inner.state()
        return State(theta, omega * np.nan) if self.spoiled else State(theta, omega)


class HasOtherShape(After):
    def state(self):
        theta, omega, _ = self.inner.state()
        return State(theta, omega[:1]) if self.spoiled else State(theta, omega)


@pytest.mark.parametrize(
    ("spoiled", "status", "reason"),
    [
        (Raises, "error", "RuntimeError: the first line"),
        (RaisesWithoutText, "error", "AssertionError"),
        (RunsOutOfMemory, "out of memory", "MemoryError"),
        (Faults, "warned", r"as a test\nwould"),
        (FaultsOddly, "error", "health() gave a list of 2, which is not a Fault"),
        (SaysOk, "error", "health() gave a list of 2, which is not a Fault"),
        (SaysTrue, "error", "health() gave true, which is not a Fault"),
        (SaysList, "error", "TypeError: unhashable type: 'list'"),
        (IsNotFinite, "not finite", "an angle or a rate is not finite at t = 0.4 s"),
        (HasOtherShape, "error", "state() gave theta (2,) and omega (1,); a chain of 2 has (2,)"),
    ],
)
def test_a_run_that_goes_wrong_keeps_what_was_right(spoiled, status, reason):
    run = simulate(SCENE, wrapping(spoiled), **STEPS)
    honest = simulate(SCENE, wrapping(Passing), **STEPS)
    assert (run.status, run.reason) == (status, reason)
    np.testing.assert_array_equal(run.t, honest.t[:4])
    np.testing.assert_array_equal(run.theta, honest.theta[:4])
    np.testing.assert_array_equal(run.omega, honest.omega[:4])
    assert run.gap.shape == (4,)
    assert run.steps in (3, 4)
    assert honest.status == "ok"


@pytest.mark.parametrize(
    ("broken", "status", "reason"),
    [
        (Tampered(says=lambda scene: f"no chains of {scene.n}"), "refused", "no chains of 2"),
        (Tampered(says=lambda scene: scene.nothing), "error", "AttributeError"),
        (Tampered(make=lambda *given: object()), "error", "TypeError: a run with a fixed step has no advance()"),  # noqa: ARG005
        (Tampered(make=lambda *given: 1 / 0), "error", "ZeroDivisionError: division by zero"),  # noqa: ARG005
    ],
)
def test_a_run_that_does_not_begin_has_no_samples(broken, status, reason):
    run = simulate(SCENE, broken, **STEPS)
    assert run.status == status
    assert run.reason.startswith(reason)
    assert run.t.shape == run.gap.shape == (0,)
    assert run.theta.shape == run.omega.shape == (0, 2)
    assert run.steps == 0


def test_states_are_recorded_and_not_the_arrays_that_hold_them():
    class OneArray(Passing):
        kept = np.zeros(2), np.zeros(2)

        def state(self):
            theta, omega, _ = self.inner.state()
            self.kept[0][:], self.kept[1][:] = theta, omega
            return State(*self.kept)

    run = simulate(SCENE, wrapping(OneArray), **STEPS)
    np.testing.assert_array_equal(run.theta, simulate(SCENE, wrapping(Passing), **STEPS).theta)


def test_a_real_engine_that_blows_up_keeps_its_beginning():
    run = simulate(chain(5, rate=100.0), "mujoco", "euler", 10.0, times=np.arange(100) * 10.0)
    assert run.status in ("warned", "not finite")
    assert 1 <= len(run.t) < 100
    assert np.all(np.isfinite(run.theta))


def test_an_engine_that_refuses_is_a_status():
    run = simulate(chain(1024), "mujoco", "euler", 0.1)
    assert (run.status, run.steps) == ("refused", 0)
    assert "1023" in run.reason
    assert run.theta.shape == (0, 1024)
