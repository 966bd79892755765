"""The conformance kit passes every engine there is, and catches every engine that is broken on purpose."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pendbench.base.faults import Fault
from pendbench.engines import conformance
from pendbench.engines.analytic.adapter import AnalyticEngine
from pendbench.engines.conformance import check_engine
from pendbench.engines.protocol import Mapped, Method, Setting, State
from pendbench.engines.registry import engine
from pendbench.scene.scene import Effects, Scene
from support.installed import installed_engines
from support.tampered import Passing, Tampered, honest_build, wrapping
from support.zoo import ZOO


@pytest.mark.parametrize("name", installed_engines())
def test_every_engine_conforms(name):
    assert check_engine(engine(name)) == ()


def test_the_engine_that_the_broken_ones_are_made_of_conforms():
    assert check_engine(wrapping(Passing)) == ()


def changed(scene: Scene, **parts) -> Scene:
    kept = {name: getattr(scene, name) for name in ("masses", "lengths", "angles", "rates", "effects")}
    return Scene(name="changed", title="Changed", duration=1.0, **{**kept, **parts})


class OneArray(Passing):
    """Gives the arrays it goes on to work in."""

    def __init__(self, inner):
        self.inner, first = inner, inner.state()
        self.kept = State(first.theta, first.omega)

    def state(self):
        now = self.inner.state()
        self.kept.theta[:], self.kept.omega[:] = now.theta, now.omega
        return self.kept

    def advance(self, steps):
        self.inner.advance(steps)
        self.state()


class Obeying(Passing):
    """Goes on from what was written into the arrays that it gave."""

    def state(self):
        n = len(self.inner._y) // 2
        return State(self.inner._y[:n], self.inner._y[n:])


class Lists(Passing):
    def state(self):
        theta, omega, _ = self.inner.state()
        return State(theta.tolist(), omega.tolist())


class WrongShape(Passing):
    def state(self):
        theta, omega, _ = self.inner.state()
        return State(theta[:, None], omega[:, None])


class SinglePrecision(Passing):
    def state(self):
        theta, omega, _ = self.inner.state()
        return State(theta.astype(np.float32), omega.astype(np.float32))


class Silent(Passing):
    def health(self):
        return None


class Alarmed(Passing):
    def health(self):
        return Fault("warned", "something, as always")


class UnknownStatus(Passing):
    def health(self):
        fault = self.inner.health()
        return fault and Fault("exploded", "loudly")


class NoReason(Passing):
    def health(self):
        fault = self.inner.health()
        return fault and Fault("not finite", "")


class Raising(Passing):
    def advance(self, steps):
        self.inner.advance(steps)
        if self.inner.health():
            raise FloatingPointError("too much")


class Lossy(Passing):
    """Loses a step of every call of many."""

    def advance(self, steps):
        self.inner.advance(steps - (steps > 4))


class Noisy(Passing):
    random = np.random.default_rng(1)

    def state(self):
        theta, omega, _ = self.inner.state()
        return State(theta + 1e-12 * self.random.random(len(theta)), omega)


class Torn(Passing):
    def state(self):
        return self.inner.state()._replace(gap=0.2)


class Leaning(Passing):
    """Adds to the right what it adds to the left."""

    def state(self):
        theta, omega, _ = self.inner.state()
        return State(theta + 1e-8, omega)


class HalfAStepBehind(Passing):
    """Built with half the step, and one of these half steps is never made."""

    behind = 1

    def advance(self, steps):
        self.inner.advance(2 * steps - self.behind)
        self.behind = 0


def half_a_step_behind() -> Tampered:
    return Tampered(make=lambda scene, method, dt: HalfAStepBehind(honest_build(scene, method, dt / 2)))


def changes_the_scene() -> Tampered:
    def make(scene, method, dt):
        run = honest_build(scene, method, dt)
        object.__setattr__(scene, "rates", scene.rates + 1.0)
        return run

    return Tampered(make=make)


def always_has_gravity() -> Tampered:
    return Tampered(make=lambda scene, *given: honest_build(changed(scene, effects=Effects(gravity=9.81)), *given))


def has_a_mass_of_its_own() -> Tampered:
    def make(scene, *given):
        return honest_build(changed(scene, masses=scene.masses + 0.001), *given)

    return Tampered(make=make)


def has_other_gravity(share: float = 1.001, method: str = "rk4") -> Tampered:
    """A negative control: gravity off by 0.1 %, or by another share."""

    def make(scene, *given):
        gravity = scene.effects.gravity and share * scene.effects.gravity
        return honest_build(changed(scene, effects=Effects(gravity=gravity)), *given)

    return Tampered(make=make, methods={method: AnalyticEngine.methods[method]})


def gives_way(share: float) -> Tampered:
    """Says that no step brings it to the truth, and has other gravity."""
    found = has_other_gravity(share, "euler")
    found.methods = {"euler": dataclasses.replace(found.methods["euler"], plateau=1e-4)}
    return found


class UpsideDown(Passing):
    """Gravity with the wrong sign: a chain that stands where the scene's hangs."""

    def state(self):
        theta, omega, _ = self.inner.state()
        return State(theta - np.pi, omega)


def has_gravity_with_the_wrong_sign() -> Tampered:
    return Tampered(
        make=lambda scene, *given: UpsideDown(honest_build(changed(scene, angles=scene.angles + np.pi), *given))
    )


def starts_elsewhere() -> Tampered:
    return Tampered(make=lambda scene, *given: honest_build(changed(scene, rates=scene.rates + 0.01), *given))


def shares_its_run() -> Tampered:
    runs = {}
    return Tampered(make=lambda scene, *given: runs.setdefault((scene.digest, given), honest_build(scene, *given)))


class Loose(Passing):
    """An adaptive run that does not care for its tolerance."""

    def advance_to(self, time):
        steps = max(1, round(time / 1e-2))
        self.inner.advance(steps)
        return steps


def ignores_its_tolerance() -> Tampered:
    method = Method(order=4, adaptive=True, settings={"tolerance": Setting(1e-8, 1e-12, 1e-2)})
    return Tampered(
        make=lambda scene, method, dt, tolerance=0.0: Loose(honest_build(scene, "rk4", 1e-2)),  # noqa: ARG005
        methods={"adaptive": method},
    )


class Forgetful(AnalyticEngine):
    """Leaves out an effect, and says that it simulates it."""

    methods = {"rk4": AnalyticEngine.methods["rk4"]}

    def build(self, scene, method, dt, **settings):
        return super().build(scene.without("drive_torque"), method, dt, **settings)


class Reversed(Forgetful):
    """Takes the list of an effect from its other end."""

    methods = {"rk4": AnalyticEngine.methods["rk4"]}

    def build(self, scene, method, dt, **settings):
        effects = scene.effects
        if effects.rod_mass is not None:
            effects = dataclasses.replace(effects, rod_mass=effects.rod_mass[::-1])
        return AnalyticEngine.build(self, dataclasses.replace(scene, effects=effects), method, dt, **settings)


class Weak(Forgetful):
    """Has too weak a motor, which only its second method knows, one of first order."""

    methods = {
        "taylor": dataclasses.replace(AnalyticEngine.methods["taylor"], effects=("gravity",)),
        "euler": AnalyticEngine.methods["euler"],
    }

    def build(self, scene, method, dt, **settings):
        effects = scene.effects
        if effects.drive_torque is not None:
            weak = dataclasses.replace(effects.drive_torque, amplitude=0.9 * effects.drive_torque.amplitude)
            effects = dataclasses.replace(effects, drive_torque=weak)
        return AnalyticEngine.build(self, dataclasses.replace(scene, effects=effects), method, dt, **settings)


class Windy(Forgetful):
    """Names an effect that there is not."""

    effects = {**AnalyticEngine.effects, "wind": Mapped("blows")}


BROKEN = {
    "reverses a list": (Reversed, "simulates the effects it maps: rod_mass: what it changes in half a second"),
    "claims a lower order": (lambda: wrapping(Passing, order=2), "converges: its order is 3.99, and it claims 2"),
    "claims a higher order": (lambda: wrapping(Passing, order=5), "converges: its order is 3.99, and it claims 5"),
    "drops half a step": (half_a_step_behind, "converges: its order is 1.0"),
    "has other gravity": (
        has_other_gravity,
        "is the same system: a calm chain: another system: accelerations differ by 0.00098 of",
    ),
    "has slightly other gravity, and order 1": (
        lambda: has_other_gravity(1.0001, "euler"),
        "is the same system: a calm chain: another system: accelerations differ by 9.8e-05 of",
    ),
    "has other gravity, and a plateau": (
        lambda: gives_way(1.02),
        "is the same system: a calm chain, its motion: another system: off by",
    ),
    "has a wrong sign": (
        has_gravity_with_the_wrong_sign,
        "is the same system: a calm chain: another system: accelerations differ",
    ),
    "ignores its tolerance": (ignores_its_tolerance, "converges: tolerance 1e5 times as tight: its error falls from"),
    "leaves out an effect": (
        Forgetful,
        "simulates the effects it maps: drive_torque: what it changes in half a second",
    ),
    "has a weak motor": (Weak, "simulates the effects it maps: drive_torque: what it changes in half a second"),
    "names an unknown effect": (Windy, "describes itself: effects has 'wind'; allowed: gravity, "),
    "changes the scene": (changes_the_scene, "leaves the scene alone: the scene was changed"),
    "gives one array": (lambda: wrapping(OneArray), "gives arrays of its own: a state that was read changes"),
    "obeys its reader": (lambda: wrapping(Obeying), "gives arrays of its own: "),
    "gives lists": (lambda: wrapping(Lists), "gives arrays of its own: theta is not a float64 array"),
    "gives a wrong shape": (lambda: wrapping(WrongShape), "gives arrays of its own: theta is not a float64 array"),
    "is in single precision": (lambda: wrapping(SinglePrecision), "gives arrays of its own: theta is not"),
    "hides that it is not finite": (lambda: wrapping(Silent), "owns up: the state is not finite"),
    "always complains": (lambda: wrapping(Alarmed), "is well when calm: a calm run is reported"),
    "is torn when calm": (lambda: wrapping(Torn), "is well when calm: in a calm run a rod is off"),
    "has a status of its own": (lambda: wrapping(UnknownStatus), "owns up: health() gave the status 'exploded'"),
    "gives no reason": (lambda: wrapping(NoReason), "owns up: health() gave no reason"),
    "raises": (lambda: wrapping(Raising), "owns up: raised FloatingPointError: too much"),
    "loses steps": (lambda: wrapping(Lossy), "adds steps up: 2 steps and 3 steps are not the same as 5"),
    "does not start there": (starts_elsewhere, "starts at the start: at time 0 the state is off"),
    "is noisy": (lambda: wrapping(Noisy), "repeats itself: two readings of one state differ"),
    "shares its run": (shares_its_run, "repeats itself: advancing one run moves another"),
    "leans": (lambda: wrapping(Leaning), "mirrors: the mirrored chain does not move in the mirror"),
    "always has gravity": (always_has_gravity, "has no gravity unasked: 2 rad/s: without gravity"),
    "has a mass of its own": (has_a_mass_of_its_own, "ignores the unit of mass: a thousand times the mass"),
    "refuses everything": (lambda: Tampered(says=lambda scene: "no"), "refused a plain chain"),  # noqa: ARG005
    "has no advance()": (lambda: Tampered(make=lambda *given: object()), "without advance()"),  # noqa: ARG005
    "has no name": (lambda: Tampered(name=""), "describes itself: its name is ''"),
    "has a bad default": (
        lambda: Tampered(methods={"rk4": Method(order=4, settings={"effort": Setting(5.0, 0.0, 1.0)})}),
        "describes itself: the default of 'effort', method 'rk4', is outside its own bounds",
    ),
    "is no engine": (object, "not an engine: it has no name"),
}


@pytest.mark.parametrize("how", BROKEN)
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_a_broken_engine_is_caught(how):
    make, expected = BROKEN[how]
    failures = check_engine(make())
    assert any(expected in failure for failure in failures), failures
    assert all(len(failure.splitlines()) == 1 for failure in failures)


@pytest.mark.parametrize("make", [lambda: has_other_gravity(1.0001), has_gravity_with_the_wrong_sign])
def test_another_system_is_told_first_and_no_effect_is_blamed(make):
    first, *others = check_engine(make())
    assert "another system" in first
    assert not any("simulates the effects" in failure for failure in others)


def test_a_method_with_a_plateau_conforms():
    assert check_engine(gives_way(1.0)) == ()


def test_each_check_catches_something():
    """A check that no broken engine needs is a check that may be empty."""
    titles = {check.name for check in conformance.CHECKS}
    caught = {expected.split(":")[0] for _, expected in BROKEN.values()} | {check for _, check, _ in ZOO.values()}
    assert titles <= caught
