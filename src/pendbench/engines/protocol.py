"""What an engine is to the rest of the project. An adapter translates; everything else lives outside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, Final, NamedTuple, Protocol, runtime_checkable

from pendbench.base.arrays import FloatArray, all_finite
from pendbench.base.errors import InputError
from pendbench.base.faults import Fault
from pendbench.base.strict import show
from pendbench.scene.scene import Scene


class State(NamedTuple):
    """theta (n,) rad and omega (n,) rad/s, absolute, float64; gap: the worst rod's relative error in length."""

    theta: FloatArray
    omega: FloatArray
    gap: float = 0.0


@dataclass(frozen=True)
class Setting:
    """A number a method can be given. `default` None: the engine chooses one for the scene, as `note` says."""

    default: float | None
    low: float
    high: float
    integer: bool = False
    note: str = ""

    def fits(self, value: object) -> bool:
        """Whether the value is such a number."""
        if isinstance(value, bool) or not isinstance(value, Real):
            return False
        number: Any = value
        return bool(self.low <= number <= self.high and not (self.integer and number != int(number)))

    def read(self, name: str, value: Any) -> float:
        """The value of what is called `name`. Raises `InputError` where it does not fit."""
        if not self.fits(value):
            kind = "a whole number" if self.integer else "a number"
            raise InputError(f"{name} is {show(value)}; allowed: {kind} from {self.low:g} to {self.high:g}")
        return int(value) if self.integer else float(value)


@dataclass(frozen=True)
class Mapped:
    """What an engine does with an effect.

    how: by what means it simulates it, or why it refuses to, in a few words for the documentation. orders: the order of
    convergence that is left, by method, where the means lower it.
    """

    how: str
    orders: Mapping[str, int] = field(default_factory=dict)
    refused: bool = False


@dataclass(frozen=True)
class Method:
    """One way an engine advances time.

    order: the order of convergence it claims. adaptive: it chooses its own steps and is built with dt None. dense: its
    steps give every state on the way, so several times can fall into one. substeps: it divides its step as it sees fit.
    effects: those it can simulate, None for all of its engine.
    plateau: the error that no step and no tolerance brings it below, rad after a second of a calm swing of two links,
    where that is more than rounding of doubles: soft joints, single precision. single: it is in single precision.
    conserves: its formula keeps the energy at any step, which is else a sign that it is put back by hand.
    note: one line for the documentation.
    """

    order: int
    adaptive: bool = False
    settings: Mapping[str, Setting] = field(default_factory=dict)
    note: str = ""
    dense: bool = False
    substeps: bool = False
    effects: frozenset[str] | None = None
    plateau: float = 0.0
    single: bool = False
    conserves: bool = False

    def with_defaults(self, given: Mapping[str, float]) -> dict[str, float]:
        """The settings `given`, and the defaults of those that are not; one without either is left out."""
        defaults = {name: s.default for name, s in self.settings.items() if s.default is not None}
        return {**defaults, **given}


@runtime_checkable
class Simulation(Protocol):
    """One run in the making, of a method with a fixed step."""

    def advance(self, steps: int) -> None:
        """Take `steps` steps. The only call that is timed."""

    def state(self) -> State:
        """The state now, as new arrays."""

    def health(self) -> Fault | None:
        """What went wrong so far, or None."""


@runtime_checkable
class AdaptiveSimulation(Protocol):
    """One run in the making, of a method that chooses its steps."""

    def advance_to(self, time: float) -> int:
        """Advance to exactly `time` (s) and return how many steps that took. The only call that is timed."""

    def state(self) -> State:
        """The state now, as new arrays."""

    def health(self) -> Fault | None:
        """What went wrong so far, or None."""


class Engine(Protocol):
    """A program that can simulate scenes.

    It may say by `default_method(scene, settings)` which method is run where none is named, and by `compiles = True`
    that the first run of a method compiles for long what all later ones find, those of other processes, too.

    It may also have `effects`, a mapping of effects' names to `Mapped`: scenes with others are refused for it, and the
    documentation has them in its table. An engine without one is taken to know gravity, and nothing else.
    """

    name: str
    methods: Mapping[str, Method]

    def version(self) -> str:
        """The version of the program behind the adapter."""

    def refuses(self, scene: Scene) -> str | None:
        """Why this engine cannot simulate the scene, or None."""

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation | AdaptiveSimulation:
        """A run at time 0 in the scene's start. Never timed. `settings` holds only settings the method declares."""


def default_method(engine: Engine, scene: Scene, settings: Mapping[str, float | None]) -> str:
    """The method that is run where none is named: what the engine says of the scene, or the first one it has."""
    its: Any = getattr(engine, "default_method", None)
    return str(its(scene, settings)) if callable(its) else next(iter(engine.methods))


_GRAVITY_ALONE: Final = {"gravity": Mapped("its adapter does not say")}


def mapped_effects(engine: Engine) -> Mapping[str, Mapped]:
    """What the engine does with each effect that its adapter knows."""
    known: Mapping[str, Mapped] = getattr(engine, "effects", _GRAVITY_ALONE)
    return known


def refusal(engine: Engine, method: str, scene: Scene) -> str | None:
    """Why the engine cannot simulate the scene with that method, or None."""
    mapped = mapped_effects(engine)
    known = engine.methods[method].effects
    for name in scene.terms:
        if name not in mapped:
            return f"the adapter has no {name}"
        if mapped[name].refused:
            return f"no {name}: {mapped[name].how}"
        if known is not None and name not in known:
            return f"method {method!r} has no {name}"
    return engine.refuses(scene)


def needed_step(method: str, dt: float | None) -> float:
    """The step, s, that a method with a fixed one is built with. Raises ValueError where there is none."""
    if dt is None:
        raise ValueError(f"method {method!r} needs a step")
    return dt


def not_finite(state: State) -> Fault | None:
    """The fault of a state with an angle or a rate that is no number; None where all are."""
    return None if all_finite(state.theta, state.omega) else Fault("not finite", "an angle or a rate is not finite")


def setting_line(engine: Engine, method: str, dt: float | None, settings: Mapping[str, float]) -> str:
    """A line that sets a method and its step: in the engine's own words where its adapter has them, else in ours.

    An adapter may have `setting_line(method, dt, settings)`, for those who use the engine without pendbench.
    """
    own = getattr(engine, "setting_line", None)
    if own is not None:
        return str(own(method, dt, settings))
    step = {} if dt is None else {"dt": dt}
    chosen = ", ".join(f"{name}={value!r}" for name, value in {**step, **settings}.items())
    return f"pb.simulate(scene, {engine.name!r}, {method!r}{', ' if chosen else ''}{chosen})"
