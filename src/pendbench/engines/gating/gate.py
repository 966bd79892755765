"""All checks of an engine, each in a process that may crash or hang, and what they found."""

from __future__ import annotations

import pickle
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

from pendbench.base.errors import InputError, choose
from pendbench.base.faults import Fault
from pendbench.engines.conformance import CHECKS, checks_of, unmet
from pendbench.engines.conformance.check import BROKEN, ERROR, PASSED, PROTOCOL, SKIPPED, Check, Finding, without
from pendbench.engines.gating.ask import Description, Source, asked, described
from pendbench.execution.pool import Job, LocalPool, Outcome

#: What a check may take: s of processor time. By the clock it is ten times that, since others may use the machine: four
#: times was too little for one that had two processors and ten other processes beside it.
TIME_LIMIT_S: Final = 30.0
_WALL: Final = 10.0
#: Of one method: so many checks that crash or hang, and the rest are not asked. Of all methods: so many that hang.
_CRASHES, _HANGS = 4, 4

#: What is asked before all else.
LOADS: Final = Check("loads", lambda its: iter(()), "Can it be loaded, quietly?", BROKEN, PROTOCOL, whole=True)  # noqa: ARG005


class Watcher(Protocol):
    """Is told how far a gate is."""

    def begin(self, stage: str, total: int, done: int) -> None:
        """A stage of `total` checks begins."""

    def advance(self) -> None:
        """One more is done."""


@dataclass(frozen=True)
class Asked:
    """What a gate asks. methods, checks: these only. workers: processes; with 0, who crashes ends the gate."""

    source: Source
    methods: tuple[str, ...] = ()
    seed: int = 0
    workers: int = 2
    time_limit: float = TIME_LIMIT_S
    checks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Gated:
    """What a gate found: of which engine, and every finding in the order of the checks, one method after the other."""

    engine: Description
    seed: int
    isolated: bool
    findings: tuple[Finding, ...] = field(repr=False)


def can_travel(source: Source) -> bool:
    """Whether another process can be given the engine."""
    try:
        return bool(pickle.dumps(source))
    except Exception:
        return False


def gate_of(wanted: Asked, watcher: Watcher) -> Gated:
    """Ask an engine every check. Raises InputError for names that are none."""
    isolated = wanted.workers > 0 and can_travel(wanted.source)
    if not isolated:
        return _gated(wanted, watcher, None)
    with LocalPool(wanted.workers) as pool:
        return _gated(wanted, watcher, pool)


def _gated(wanted: Asked, watcher: Watcher, pool: LocalPool | None) -> Gated:
    found: list[Finding] = []
    description = _description(wanted, pool)
    if description.flaw:
        found.append(without(LOADS, "", ERROR, description.flaw))
    else:
        found.append(Finding(LOADS.name, "", "", PASSED, 0.0, 0.0, LOADS.unit, LOADS.limit_from, ""))
    methods = _methods(wanted, description)
    pending = _pending(wanted, methods) if description.methods else []
    watcher.begin("checks", len(pending), 0)
    patience = _Patience(wanted)
    for level in sorted({_level(each) for _, each in pending}):
        now = [(method, each) for method, each in pending if _level(each) == level]
        for batch in _answers(wanted, pool, now, found, patience):
            found += batch
            watcher.advance()
    return Gated(description, wanted.seed, pool is not None, tuple(sorted(found, key=_place(methods))))


def _description(wanted: Asked, pool: LocalPool | None) -> Description:
    name = wanted.source if isinstance(wanted.source, str) else type(wanted.source).__name__
    if pool is None:
        return described(wanted.source)
    job = Job("description", described, (wanted.source,), wanted.time_limit, wall_limit=_WALL * wanted.time_limit)
    outcome = next(iter(pool.run([job])))
    if outcome.fault is not None:
        return Description(name, flaw=f"it cannot be loaded: {_told(outcome.fault)}")
    known: Description = outcome.value
    return known


def _methods(wanted: Asked, known: Description) -> Sequence[str]:
    for name in wanted.methods:
        if known.methods and name not in known.methods:
            raise InputError(f"engine {known.name!r}: {choose('method', name, known.methods)}")
    return wanted.methods or known.methods


def _pending(wanted: Asked, methods: Sequence[str]) -> list[tuple[str, Check]]:
    every = [(method, each) for method in ("", *methods) for each in checks_of(method)]
    return [(method, each) for method, each in every if not wanted.checks or each.name in wanted.checks]


def _level(one: Check) -> int:
    """How many checks have to be answered before, one after the other."""
    needed = [each for each in CHECKS if each.name in one.needs]
    return 1 + max(map(_level, needed)) if needed else 0


def _place(methods: Sequence[str]) -> Callable[[Finding], tuple[int, int]]:
    order = {each.name: i for i, each in enumerate((LOADS, *CHECKS))}
    at = {method: i for i, method in enumerate(("", *methods))}
    return lambda finding: (at[finding.method], order[finding.check])


class _Patience:
    """How much longer an engine is asked that crashes or hangs."""

    def __init__(self, wanted: Asked) -> None:
        self._limit, self._crashes, self._hangs = wanted.time_limit, Counter[str](), 0

    def add(self, method: str, fault: Fault) -> None:
        self._crashes[method] += 1
        self._hangs += fault.status == "timed out"

    def ended(self, method: str) -> str:
        """Why nothing more is asked of a method, or ""."""
        if self._hangs >= _HANGS:
            return f"not asked: {self._hangs} checks took longer than {self._limit:g} s of processor time each"
        if self._crashes[method] >= _CRASHES:
            return f"not asked: {self._crashes[method]} checks of this method crashed or hung"
        return ""


def _answers(
    wanted: Asked, pool: LocalPool | None, now: list[tuple[str, Check]], before: list[Finding], patience: _Patience
) -> Iterator[list[Finding]]:
    """What each of these checks finds, in the order in which they end."""
    told: list[list[Finding]] = []

    def willing() -> Iterator[tuple[str, Check]]:
        for method, one in now:
            missing = unmet(one, [finding for finding in before if finding.method == method])
            if why := missing or patience.ended(method):
                told.append([without(one, method, SKIPPED if missing else ERROR, why)])
            else:
                yield method, one

    if pool is None:
        for method, one in willing():
            yield asked(wanted.source, method, one.name, wanted.seed)
    else:
        yield from _from_processes(wanted, pool, willing(), patience)
    yield from told


def _from_processes(
    wanted: Asked, pool: LocalPool, willing: Iterable[tuple[str, Check]], patience: _Patience
) -> Iterator[list[Finding]]:
    known: dict[str, tuple[str, Check]] = {}

    def jobs() -> Iterator[Job]:
        for method, one in willing:
            key = f"{method}:{one.name}"
            known[key] = method, one
            arguments = (wanted.source, method, one.name, wanted.seed)
            yield Job(key, asked, arguments, wanted.time_limit, wall_limit=_WALL * wanted.time_limit)

    for outcome in pool.run(jobs()):
        method, one = known[outcome.job.key]
        yield _findings(method, one, outcome, patience)


def _findings(method: str, one: Check, outcome: Outcome, patience: _Patience) -> list[Finding]:
    if outcome.fault is None:
        found: list[Finding] = outcome.value
        return found
    patience.add(method, outcome.fault)
    return [without(one, method, ERROR, _told(outcome.fault))]


def _told(fault: Fault) -> str:
    return f"{fault.status}: {fault.reason}"


def names_of_checks() -> tuple[str, ...]:
    """Every check that a gate asks, in order."""
    return tuple(each.name for each in (LOADS, *CHECKS))
