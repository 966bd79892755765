"""Engines that are broken, each in one way that real ones were: whoever judges engines has to catch and to name it.

A beast is the classical Runge-Kutta method on the dense equations, right but for what its maker changes.
"""

# ruff: noqa: ARG001, rules are all called alike
from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgesv

from pendbench.base.faults import Fault
from pendbench.engines.protocol import Mapped, Method, State
from pendbench.physics import acting
from pendbench.physics.energy import energy, kinetic_energy
from pendbench.scene.links import Links

EFFECTS = ("joint_damping", "joint_torque", "drive_torque", "rod_mass", "links")


@dataclass
class Rules:
    """What a beast does, right unless something else is given. Each is called with the run first."""

    mass: Callable[..., Any] = lambda run, q: run.mass(q)
    coriolis: Callable[..., Any] = lambda run, q, v: run.coupling(q) @ v**2
    weight: Callable[..., Any] = lambda run, q, t: run.weight(q)  # noqa: ARG005
    forces: Callable[..., Any] = lambda run, q, v, t: run.forces(q, v, t)
    after_step: Callable[..., Any] = lambda run: None  # noqa: ARG005
    read: Callable[..., Any] = lambda run: State(run.q.copy(), run.v.copy())
    health: Callable[..., Any] = lambda run: finite(run)  # noqa: PLW0108, defined below
    scene: Callable[..., Any] = lambda scene: scene
    steps: Callable[..., Any] = lambda run, steps: steps  # noqa: ARG005
    step_length: Callable[..., Any] = lambda dt: dt


def finite(run: Run) -> Fault | None:
    good = np.isfinite(run.q).all() and np.abs(run.v).max() < 1e6  # nan is not below it
    return None if good else Fault("not finite", "an angle or a rate is not finite")


class Run:
    """A run by rules."""

    def __init__(self, rules: Rules, scene: Any, dt: float) -> None:
        self.rules, self.scene, self.dt = rules, rules.scene(scene), rules.step_length(dt)
        self.q, self.v, self.taken, self.calls = scene.angles.copy(), scene.rates.copy(), 0, 0
        self.last = self.q.copy(), self.v.copy()
        self.memory: dict[str, Any] = {}
        lumped = acting.lumped_masses(self.scene)
        hanging, links = np.cumsum(lumped[::-1])[::-1], np.arange(scene.n)
        self._pairs = hanging[np.maximum.outer(links, links)] * np.outer(self.scene.lengths, self.scene.lengths)
        self._turning = np.diag(acting.link_inertias(self.scene))
        self._weights = hanging * self.scene.lengths * (self.scene.effects.gravity or 0.0)
        self._plain = set(self.scene.terms) <= {"gravity", "rod_mass", "links"}

    def mass(self, q: Any) -> Any:
        """What dense.mass_matrix is, in less time."""
        return self._pairs * np.cos(np.subtract.outer(q, q)) + self._turning

    def coupling(self, q: Any) -> Any:
        """What dense.coupling_matrix is."""
        return self._pairs * -np.sin(np.subtract.outer(q, q))

    def weight(self, q: Any) -> Any:
        """What minus dense.weight_torques is, of a pivot at rest."""
        return -self._weights * np.sin(q)

    def forces(self, q: Any, v: Any, t: float) -> Any:
        """What dampers, torques and motors do."""
        return 0.0 * v if self._plain else acting.generalized_forces(self.scene, t, q, v)

    def pull(self, q: Any, v: Any, t: float) -> Any:
        its = self.rules
        torque = its.coriolis(self, q, v) + its.weight(self, q, t) + its.forces(self, q, v, t)
        _, _, acceleration, singular = dgesv(its.mass(self, q), torque)  # numpy's way to it takes five times as long
        return np.full_like(torque, np.nan) if singular else acceleration

    def advance(self, steps: int) -> None:
        self.calls += 1
        with np.errstate(all="ignore"):
            for _ in range(self.rules.steps(self, steps)):
                if self.rules.health(self) is None and np.abs(self.v).max() < 1e8:  # nan is not below it
                    self.last = self.q.copy(), self.v.copy()
                    self.step(self.taken * self.dt)
                    self.rules.after_step(self)
                self.taken += 1

    def step(self, t: float) -> None:
        h, q, v = self.dt, self.q, self.v
        a = self.pull(q, v, t)
        v2 = v + 0.5 * h * a
        b = self.pull(q + 0.5 * h * v, v2, t + 0.5 * h)
        v3 = v + 0.5 * h * b
        c = self.pull(q + 0.5 * h * v2, v3, t + 0.5 * h)
        v4 = v + h * c
        d = self.pull(q + h * v3, v4, t + h)
        self.q = q + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
        self.v = v + h / 6.0 * (a + 2.0 * (b + c) + d)

    def state(self) -> State:
        return self.rules.read(self)

    def health(self) -> Fault | None:
        return self.rules.health(self)


@dataclass
class Beast:
    """An engine by rules, with one method; run: another class of runs."""

    rules: Rules = field(default_factory=Rules)
    run: type[Run] = Run
    order: int = 4
    name: str = "beast"
    precision: str = "double"
    methods: Any = None
    effects: Any = field(default_factory=lambda: knowing(*EFFECTS))

    def __post_init__(self) -> None:
        self.methods = MappingProxyType({"rk4": Method(order=self.order, single=self.precision == "single")})

    def version(self) -> str:
        return "1.0"

    def refuses(self, scene: Any) -> str | None:  # noqa: ARG002
        return None

    def build(self, scene: Any, method: str, dt: float) -> Run:  # noqa: ARG002
        return self.run(self.rules, scene, dt)


def knowing(*effects: str) -> dict[str, Mapped]:
    return {name: Mapped("as it is") for name in ("gravity", *effects)}


def by(*effects: str, run: type[Run] = Run, order: int = 4, **rules: Any) -> Callable[[], Beast]:
    """A beast that breaks these rules, and knows these effects beside gravity."""
    return lambda: Beast(Rules(**rules), run, order, effects=knowing(*effects))


# Equations.


def one_sign(run: Run, q: Any, v: Any) -> Any:
    terms = run.coupling(q)
    if len(q) > 1:
        terms[1, 0] *= -1.0
    return terms @ v**2


def uniform_rods(run: Run, q: Any) -> Any:
    return run.mass(q) + np.diag(run.scene.masses * run.scene.lengths**2) / 12.0


def uncoupled(run: Run, q: Any) -> Any:
    return np.diag(np.diag(run.mass(q)))


def nothing(run: Run, q: Any, v: Any) -> Any:
    return 0.0 * v


def flat_weight(run: Run, q: Any, t: float) -> Any:
    return run.weight(np.full(len(q), 0.5 * np.pi)) * q


def upwards(run: Run, q: Any, t: float) -> Any:
    return -run.weight(q)


def heavy(run: Run, q: Any, t: float) -> Any:
    return 1.001 * run.weight(q)


def all_signs(run: Run, q: Any, v: Any) -> Any:
    return -(run.coupling(q) @ v**2)


def dampers(q: Any, v: Any) -> Any:
    bends = np.diff(v, prepend=0.0)
    return -0.01 * (bends - np.append(bends[1:], 0.0))


def dies(run: Run) -> None:
    """A damper where Euler's method should be."""
    run.v = run.v * (1.0 - 0.1 * run.dt)


def with_forces(extra: Callable[..., Any]) -> Callable[..., Any]:
    return lambda run, q, v, t: run.forces(q, v, t) + extra(q, v)


def ages(run: Run, q: Any, v: Any, t: float) -> Any:
    """Drag that grows with the age of the run."""
    return run.forces(q, v, t) - 0.05 * t * v


def turns_when_free(run: Run, q: Any, v: Any, t: float) -> Any:
    """A torque on the first of several rods where nothing acts."""
    pushed = run.forces(q, v, t)
    if len(q) > 1 and run.scene.effects.gravity is None:
        pushed[0] += 0.1
    return pushed


def factor_of(name: str, factor: float) -> Callable[[Any], Any]:
    """A scene with an effect so many times as strong."""

    def changed(scene: Any) -> Any:
        value = getattr(scene.effects, name)
        if value is None:
            return scene
        if dataclasses.is_dataclass(value):
            return scene.with_(**{name: dataclasses.replace(value, amplitude=factor * value.amplitude)})
        return scene.with_(**{name: [factor * each for each in value] if isinstance(value, tuple) else factor * value})

    return changed


def reversed_rods(scene: Any) -> Any:
    return scene if scene.effects.rod_mass is None else scene.with_(rod_mass=scene.effects.rod_mass[::-1])


def wrong_point(scene: Any) -> Any:
    if scene.links is None:
        return scene
    its = scene.links
    return dataclasses.replace(scene, links=Links(its.mass, its.centre, its.inertia + its.mass * its.centre**2))


class Relative(Run):
    """Takes the scene's angles for those between rods, and gives them back as such."""

    def __init__(self, rules: Rules, scene: Any, dt: float) -> None:
        super().__init__(rules, scene, dt)
        self.q, self.v = np.cumsum(self.q), np.cumsum(self.v)

    def state(self) -> State:
        return State(np.diff(self.q, prepend=0.0), np.diff(self.v, prepend=0.0))


# Steps.


def late_angles(run: Run) -> State:
    return State(run.last[0].copy(), run.v.copy())


def late_rates(run: Run) -> State:
    return State(run.q.copy(), run.last[1].copy())


class EulerDamped(Run):
    """Order 4, but for dampers, which act as they did at the start of the step."""

    def step(self, t: float) -> None:
        self.memory["v"] = self.v
        super().step(t)


def frozen_damping(run: Run, q: Any, v: Any, t: float) -> Any:
    return run.forces(q, run.memory.get("v", v), t)


class OwnSteps(Run):
    """Steps of a hundredth of a second, whatever is asked."""

    def advance(self, steps: int) -> None:
        self.memory["due"] = self.memory.get("due", 0.0) + steps * self.dt
        asked, self.dt = self.dt, 0.01
        while self.memory["due"] > 0.005:
            super().advance(1)
            self.memory["due"] -= 0.01
        self.dt = asked


class Euler(Run):
    def step(self, t: float) -> None:
        self.v = self.v + self.dt * self.pull(self.q, self.v, t)
        self.q = self.q + self.dt * self.v


def scaled_back(run: Run) -> None:
    """Puts the energy back by scaling the rates."""
    before = run.memory.setdefault("energy", float(energy(run.scene, run.scene.angles, run.scene.rates)))
    now, moving = (float(each(run.scene, run.q, run.v)) for each in (energy, kinetic_energy))
    if moving > 0.1 and before - now + moving > 0.0:
        run.v = run.v * np.sqrt((before - now + moving) / moving)


def single(run: Run) -> None:
    run.q, run.v = (each.astype(np.float32).astype(float) for each in (run.q, run.v))


def single_mass(run: Run, q: Any) -> Any:
    return run.mass(q).astype(np.float32).astype(float)


def silent_reset(run: Run) -> None:
    if not np.all(np.isfinite(run.v)) or np.abs(run.v).max() > 1e3:
        run.q, run.v = run.scene.angles.copy(), run.scene.rates.copy()


def clipped(run: Run) -> None:
    run.v = np.clip(run.v, -50.0, 50.0)


_NOISE = np.random.default_rng(1)


def noisy(run: Run) -> State:
    return State(run.q + 1e-9 * _NOISE.normal(size=len(run.q)), run.v.copy())


def noisy_and_the_same(run: Run) -> State:
    return State(run.q + 1e-9 * np.sin(1e12 * run.q), run.v.copy())


def fewer_by_calls(run: Run, steps: int) -> int:
    return steps - (run.calls > 1)


_BUILT: list[int] = []


def older(scene: Any) -> Any:
    """Each run has a little more gravity than the last."""
    _BUILT.append(1)
    return (
        scene
        if scene.effects.gravity is None
        else scene.with_(gravity=scene.effects.gravity * (1 + 1e-12 * len(_BUILT)))
    )


def stays_silent(run: Run) -> None:
    return None


def stopped(run: Run) -> None:
    """Holds a chain that is too fast, and says nothing."""
    if np.abs(run.v).max() > 20.0 and len(run.q) == 5:
        run.q, run.v = run.last


def prints(scene: Any) -> Any:
    print("hello from a library")
    return scene


def moves_house(scene: Any) -> Any:
    os.chdir("/")
    return scene


def hushes_numpy(scene: Any) -> Any:
    np.seterr(all="ignore")
    return scene


def leaves(scene: Any) -> Any:
    if scene.n == 5:
        sys.exit(3)
    return scene


def dies_at_once(scene: Any) -> Any:
    if scene.n == 5:
        os._exit(3)
    return scene


def hangs(scene: Any) -> Any:
    while scene.n == 5:
        pass
    return scene


def raises(scene: Any) -> Any:
    if scene.n == 5:
        raise RuntimeError("five is too many")
    return scene


def wrong_shape(run: Run) -> State:
    return State(run.q[:, None], run.v[:, None])


MODEL, ORDER, EFFECT = "is the same system", "converges", "simulates the effects it maps"

#: What is broken; how it is made; the check that catches it; and what that says is wrong.
ZOO: dict[str, tuple[Callable[[], Beast], str, str]] = {
    "the sign of one Coriolis term": (
        by(coriolis=one_sign),
        MODEL,
        "the Coriolis term of rod 1 in the equation of rod 2 has the wrong sign",
    ),
    "the sign of all Coriolis terms": (
        by(coriolis=all_signs),
        MODEL,
        "Coriolis terms: what the rods' turning does has the wrong sign",
    ),
    "no Coriolis terms": (by(coriolis=nothing), MODEL, "what the rods' turning does is missing"),
    "gravity off by 0.1 %": (by(weight=heavy), MODEL, "gravity is 1.001 times"),
    "gravity upwards": (by(weight=upwards), MODEL, "gravity has the wrong sign"),
    "inertia about the wrong point": (
        by(mass=uniform_rods),
        MODEL,
        "inertia about the wrong point: each link has 0.08333 m l^2",
    ),
    "masses in the middle of their rods": (
        by(scene=lambda scene: scene.with_(lengths=0.5 * scene.lengths)),
        MODEL,
        "in the middle of their rods",
    ),
    "relative angles": (by(run=Relative), MODEL, "angles are taken as relative"),
    "masses from the other end": (
        by(scene=lambda scene: scene.with_(masses=scene.masses[::-1].copy())),
        MODEL,
        "the masses are in the reverse order",
    ),
    "lengths from the other end": (
        by(scene=lambda scene: scene.with_(lengths=scene.lengths[::-1].copy())),
        MODEL,
        "the lengths are in the reverse order",
    ),
    "one mass for all": (
        by(scene=lambda scene: scene.with_(masses=np.full(scene.n, scene.masses[0]))),
        MODEL,
        "every mass is taken for the first",
    ),
    "small angles": (by(weight=flat_weight), MODEL, "the sine of an angle is taken for the angle"),
    "links that do not feel each other": (by(mass=uncoupled, coriolis=nothing), MODEL, "the links are not coupled"),
    "damping unasked in the joints": (
        by(forces=with_forces(dampers)),
        MODEL,
        "damping unasked: 0.01 N m s in the joints",
    ),
    "a damper in Euler's place": (by(after_step=dies), MODEL, "every rate dies at 0.1 of itself a second"),
    "a thousandth too much time": (by(step_length=lambda dt: 1.001 * dt), MODEL, "every acceleration is 1.001 times"),
    "angles a step late": (by(read=late_angles), ORDER, "angles are 1 of a step late"),
    "rates a step late": (by(read=late_rates), ORDER, "rates are 1 of a step late"),
    "a step too few": (by(steps=lambda run, steps: steps - (run.calls == 1)), ORDER, "1 of a step too few"),
    "steps of its own": (by(run=OwnSteps), "counts its steps", "steps of 10 and of 5 ms"),
    "an order too high": (by(order=5), ORDER, "its order is 3.9"),
    "Euler under another name": (by(run=Euler), ORDER, "its order is 1.0"),
    "another order with dampers only": (
        by("joint_damping", forces=frozen_damping, run=EulerDamped),
        "converges with each effect",
        "its order is 1.0",
    ),
    "damping ignored": (
        by("joint_damping", scene=lambda scene: scene.without("joint_damping")),
        EFFECT,
        "it is ignored",
    ),
    "damping applied twice": (by("joint_damping", scene=factor_of("joint_damping", 2.0)), EFFECT, "it counts twice"),
    "a torque of the wrong sign": (
        by("joint_torque", scene=factor_of("joint_torque", -1.0)),
        EFFECT,
        "it has the wrong sign",
    ),
    "half a motor": (by("drive_torque", scene=factor_of("drive_torque", 0.5)), EFFECT, "it counts half"),
    "rods from the other end": (by("rod_mass", scene=reversed_rods), EFFECT, "its list is in the reverse order"),
    "links' inertia about their joints": (
        by("links", scene=wrong_point),
        EFFECT,
        "its inertia is taken about the wrong point",
    ),
    "a state in single precision": (by(after_step=single), "is smooth", "its state is in single precision"),
    "single precision somewhere": (by(mass=single_mass), "is smooth", "single precision somewhere"),
    "noise of 1e-9": (by(read=noisy), "repeats itself", "something in it is random"),
    "noise of 1e-9 that is always the same": (by(read=noisy_and_the_same), "is smooth", "its results carry noise of"),
    "a silent reset": (
        by(after_step=silent_reset, health=stays_silent),
        "owns up",
        "it started again or stopped, in silence",
    ),
    "a silent stop": (
        by(after_step=stopped, health=stays_silent),
        "owns up",
        "it started again or stopped, in silence",
    ),
    "clipped rates": (by(after_step=clipped), "has no gravity unasked", "clipped"),
    "energy put back by scaling": (by(after_step=scaled_back), "balances its energy", "the energy is put back by hand"),
    "results that depend on the number of calls": (
        by(steps=fewer_by_calls),
        "adds steps up",
        "the result depends on the calls",
    ),
    "results that depend on earlier runs": (by(scene=older), "repeats itself", "random, or remembered"),
    "drag that grows with a run's age": (by(forces=ages), "forgets its past", "something but the state decides"),
    "a torque where nothing acts": (by(forces=turns_when_free), "keeps its momentum", "the momentum is off by"),
    "prints": (by(scene=prints), "leaves the process alone", "it prints 'hello from a library'"),
    "changes the working folder": (by(scene=moves_house), "leaves the process alone", "it changes the working folder"),
    "changes numpy's error state": (
        by(scene=hushes_numpy),
        "leaves the process alone",
        "it changes numpy's error state",
    ),
    "exits": (by(scene=leaves), "owns up", "tried to exit the program"),
    "raises": (by(scene=raises), "owns up", "raised RuntimeError: five is too many"),
    "a wrong shape": (by(read=wrong_shape), "gives arrays of its own", "theta is not a float64 array"),
}
