"""The cases that the tables of a study's engines stand for, scene by scene."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Sequence
from typing import Any, Final, NamedTuple

from pendbench.base.errors import InputError, choose, printable
from pendbench.base.faults import Fault
from pendbench.base.strict import input_error, show
from pendbench.engines.protocol import Method
from pendbench.engines.registry import engine, is_foreign, try_to_load
from pendbench.execution.ask import ask_each
from pendbench.scene.scene import Scene
from pendbench.study.case import Case, Settings
from pendbench.study.study_file import EngineTable

_MOST_STEPS: Final = 1e12
_FEWEST_STEPS: Final = 20  # in a scene that the steps were not written for: fewer say nothing

#: A table of a file, with where it is.
Placed = tuple[str, EngineTable]


class Asked(NamedTuple):
    """A method of a table, with each choice of its settings."""

    where: str
    table: EngineTable
    method: str
    adaptive: bool
    settings: list[Settings]


def selected(where: str, tables: Sequence[EngineTable], only: Sequence[str], *, apart: bool = False) -> list[Placed]:
    """The tables of the engines asked for, each with where it is. Raises InputError for an engine that cannot be.

    apart: optional engines are loaded apart, later: none of them is an error.
    """
    known = {table.name for table in tables}
    for name in only:
        if name not in known:
            raise InputError(f"--engines: {choose('engine', printable(str(name)), known)} (the engines of {where})")
    places = ((table.place(where, number), table) for number, table in enumerate(tables, 1))
    chosen = [(at, table) for at, table in places if not only or table.name in only]
    _check_loading([(at, table) for at, table in chosen if not (apart and table.optional)])
    return chosen


def _check_loading(tables: Sequence[Placed]) -> None:
    """Raise InputError where somebody else's engine ends, or holds up, the process that loads it."""
    foreign = {table.name: at for at, table in tables if is_foreign(table.name)}
    for (name, at), found in zip(foreign.items(), ask_each(try_to_load, [(name,) for name in foreign]), strict=True):
        if isinstance(found, Fault):
            raise input_error(at, f"engine {name!r} cannot be loaded: {found.status}, {found.reason}")


def cases_of(
    where: str, scenes: Sequence[Scene], tables: Sequence[Placed], steps: Sequence[float], others: bool = False
) -> Iterator[Case]:
    """All cases. where: the study's file. steps: s, where a table has none. others: the scenes are those of --scenes.

    Raises InputError, naming the table, or the scene that it is not about, for what makes no sense.
    """
    asked = [each for at, table in tables for each in _asked(at, table)]
    known = [scene.name for scene in scenes]
    if not others:
        _check_scenes(tables, known)
    for scene in scenes:
        own = _for_other(asked) if others and not _is_named(scene, tables) else _for_own(scene, asked)
        seen = set()
        for each in own:
            for case in _cases(where, scene, each, steps, fit=others):
                asked_for = case.engine, case.method, case.dt, case.settings
                if asked_for in seen:
                    raise input_error(each.where, f"asks twice for {case}")
                seen.add(asked_for)
                yield case


def _check_scenes(tables: Sequence[Placed], known: Collection[str]) -> None:
    for at, table in tables:
        if unknown := [name for name in table.scenes or () if name not in known]:
            raise input_error(at, f"scenes: {choose('scene', printable(unknown[0]), known)} (the study's scenes)")


def _is_named(scene: Scene, tables: Sequence[Placed]) -> bool:
    return any(scene.name in (table.scenes or ()) for _, table in tables)


def _for_own(scene: Scene, asked: Sequence[Asked]) -> list[Asked]:
    return [each for each in asked if each.table.scenes is None or scene.name in each.table.scenes]


def _for_other(asked: Sequence[Asked]) -> Iterator[Asked]:
    """What a scene gets that no table names: each method once where tables differ by scene, the first that has it."""
    seen = set()
    for each in asked:
        pair = (each.table.name, each.method)
        if each.table.scenes is None or pair not in seen:
            yield each
        seen.add(pair)


def _cases(where: str, scene: Scene, asked: Asked, steps: Sequence[float], *, fit: bool) -> Iterator[Case]:
    """The cases of a method in a scene. fit: leave out the steps that the scene is too short for.

    Of steps that were not chosen for the scene, it is the scene that is too long.
    """
    given = asked.table.dt
    chosen: Sequence[float | None] = [None] if asked.adaptive else given or steps
    if not asked.adaptive and (fit or given is None):
        chosen = [dt for dt in chosen if dt is not None and dt * _FEWEST_STEPS <= scene.duration * (1 + 1e-9)]
    for dt, settings in itertools.product(chosen, asked.settings):
        case = Case(scene, asked.table.name, asked.method, dt, settings)
        if dt is not None and not 1 - 1e-9 <= scene.duration / dt <= _MOST_STEPS:
            least, most = scene.duration / _MOST_STEPS, scene.duration
            if given is None or fit:
                allowed = f"up to {dt * _MOST_STEPS:g} s, {_MOST_STEPS:g} steps of {dt:g} s"
                raise input_error(where, f"scene {scene.name!r} lasts {most:g} s; allowed: {allowed}")
            allowed = f"{least:.3g} to {most:g} s, for the {most:g} s of scene {scene.name!r}"
            raise input_error(asked.where, f"dt is {dt:g}; allowed: {allowed}")
        yield case


def _asked(where: str, table: EngineTable) -> Iterator[Asked]:
    """The methods of an engine's table, each with every choice of its settings."""
    try:
        its = engine(table.name)
    except InputError as error:
        raise input_error(where, str(error)) from None
    methods = list(table.methods or its.methods)
    for name in methods:
        if name not in its.methods:
            raise input_error(where, choose("method", printable(name), its.methods))
    settings = table.model_extra or {}
    known = sorted({setting for name in methods for setting in its.methods[name].settings})
    for setting in settings:
        if setting not in known:
            raise input_error(where, choose("key", printable(setting), [*EngineTable.model_fields, *known]))
    if table.dt and all(its.methods[name].adaptive for name in methods):
        raise input_error(where, f"dt is given; allowed: no dt, since method {methods[0]!r} chooses its steps")
    for name in methods:
        method = its.methods[name]
        lists = [_values(where, key, settings[key], method) for key in sorted(method.settings) if key in settings]
        yield Asked(where, table, name, method.adaptive, [*itertools.product(*lists)])


def _values(where: str, key: str, values: Any, method: Method) -> list[tuple[str, float]]:
    setting = method.settings[key]
    whole = " whole" if setting.integer else ""
    allowed = f"a{whole} number, or a list of them, from {setting.low:g} to {setting.high:g}"
    chosen = values if isinstance(values, list) and values else [values]
    for value in chosen:
        if not setting.fits(value):
            raise input_error(where, f"{key} is {show(value)}; allowed: {allowed}")
    return [(key, setting.read(key, value)) for value in chosen]
