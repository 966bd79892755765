"""`pendbench.gate`: whether an engine may pass, by numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any, Final

from pendbench.base.errors import InputError, choose
from pendbench.base.processes import processors
from pendbench.base.strict import show
from pendbench.commands.gate import LIMIT
from pendbench.commands.gate_record import Gate
from pendbench.commands.shell import number
from pendbench.effects import Effects
from pendbench.engines.gating.functions import FunctionEngine, world
from pendbench.engines.gating.gate import TIME_LIMIT_S, Asked, Watcher, can_travel, gate_of
from pendbench.engines.protocol import Engine
from pendbench.scene.scene import Scene

_MOST_WORKERS: Final = 64


class _Silence:
    def begin(self, stage: str, total: int, done: int) -> None:
        """Say nothing."""

    def advance(self) -> None:
        """Say nothing."""


def gate(
    engine: str | Engine | None = None,
    *,
    step: Callable[[Any], object] | None = None,
    state: Callable[[Any], Any] | None = None,
    start: Callable[[Scene, float], Any] | None = None,
    health: Callable[[Any], str | None] | None = None,
    order: int = 1,
    effects: Sequence[str] = (),
    name: str = "functions",
    version: str = "unknown",
    precision: str = "double",
    methods: str | Sequence[str] = (),
    seed: int = 0,
    jobs: int | None = None,
    time_limit: float = TIME_LIMIT_S,
) -> Gate:
    """Ask an engine every check of the conformance kit: pass or fail, with numbers, in less than a minute.

    engine: its name, `module:Class`, or the engine itself. Without one, two functions will do: `step(world)` takes one
    step, `state(world)` gives its angles (n,) rad and rates (n,) rad/s, absolute. The world is what `start(scene, dt)`
    makes; without that it has `scene`, `theta`, `omega` and `dt`, and `step` changes it. health: what is wrong with a
    world, in words, or None. order: which the steps claim. effects: what they know beside gravity. precision: "single"
    where that is what it computes in. methods: only these. seed: of the random states. jobs: processes; an engine that
    cannot be sent to another one, as a function of a notebook, is asked in this one, and can end it. time_limit: for
    each check, s of processor time. Scripts that call this need the usual `if __name__ == "__main__":` guard, since it
    starts processes.

    >>> import pendbench as pb
    >>> pb.gate("pymunk").passed  # doctest: +SKIP
    True
    >>> def step(world):  # semi-implicit Euler, of one link only
    ...     world.omega -= world.dt * 9.81 / world.scene.lengths * np.sin(world.theta)
    ...     world.theta += world.dt * world.omega
    >>> found = pb.gate(step=step, state=lambda world: (world.theta, world.omega))  # doctest: +SKIP
    >>> found.passed, found.failures, found.checks  # doctest: +SKIP

    Raises InputError, one line, for what cannot be used; never for what the engine does.
    """
    from pendbench.commands.run import names_of

    described = _text("name", name), _text("version", version), _effects(names_of(effects, "effects", "an effect"))
    source = _source(engine, step, state, start or world, health, order, precision, *described)
    only, limit = names_of(methods, "methods", "a method"), number("time_limit", time_limit, LIMIT)
    workers, begin = _workers(jobs), _seed(seed)
    if workers and can_travel(source):
        from pendbench.base.processes import refuse_without_guard

        refuse_without_guard()
    return run_gate(Asked(source, only, begin, workers, limit), _Silence())


def _workers(jobs: Any) -> int:
    workers = processors() if jobs is None else jobs
    if type(workers) is not int or not 0 <= workers <= _MOST_WORKERS:
        raise InputError(f"jobs is {show(jobs)}; allowed: 0 to {_MOST_WORKERS}")
    return workers


def _seed(seed: Any) -> int:
    if type(seed) is not int or seed < 0:
        raise InputError(f"seed is {show(seed)}; allowed: a whole number from 0 on")
    return seed


def run_gate(asked: Asked, watcher: Watcher) -> Gate:
    """Ask, and make a record of what was found."""
    return Gate.of(gate_of(asked, watcher))


def _source(
    engine: str | Engine | None, step: Any, state: Any, start: Any, health: Any, order: int, precision: str,
    name: str, version: str, effects: tuple[str, ...],
) -> str | Engine:  # fmt: skip
    """The engine, or one that is made of functions. Raises InputError."""
    if engine is not None:
        if step is not None or state is not None:
            raise InputError("engine and functions are given; allowed: one of them")
        if isinstance(engine, str) and not engine.strip():
            raise InputError("engine is empty; allowed: a name, module:Class, or an engine")
        return engine
    for given, its in (("step", step), ("state", state), ("start", start)):
        if not callable(its):
            raise InputError(f"{given} is {show(its)}; allowed: a function, where no engine is given")
    if type(order) is not int or order < 1:
        raise InputError(f"order is {show(order)}; allowed: a whole number from 1 on")
    if health is not None and not callable(health):
        raise InputError(f"health is {show(health)}; allowed: a function, or None")
    if precision not in ("double", "single"):
        raise InputError(f"precision is {show(precision)}; allowed: double or single")
    return FunctionEngine(step, state, start, health, order, name, version, precision, effects)


def _text(key: str, given: object) -> str:
    if not isinstance(given, str) or not given.strip():
        raise InputError(f"{key} is {show(given)}; allowed: a text")
    return given


def _effects(names: tuple[str, ...]) -> tuple[str, ...]:
    known = [each.name for each in fields(Effects)]
    for name in names:
        if name not in known:
            raise InputError(f"effects: {choose('effect', name, known)}")
    return names
