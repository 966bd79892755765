"""A study file, read strictly, and the cases it stands for."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final

from pydantic import AfterValidator, ConfigDict, Field

from pendbench.bundled import bundled, bundled_names
from pendbench.engines.protocol import Method
from pendbench.engines.registry import engine
from pendbench.errors import InputError, MissingEngineError, choose, printable
from pendbench.ranges import Range
from pendbench.scene import Scene, load_scene
from pendbench.scene_file import Table, one_line_title
from pendbench.strict import input_error, read_toml, show, shown_path, validate
from pendbench.study.case import Case
from pendbench.study.kinds import KINDS, WITH_EFFECTS, kind

_STEP: Final = Range(1e-6, 1e3, "s")  # times are told apart to 1e-12 s
_MOST_STEPS: Final = 1e12


class EngineTable(Table):
    """[[engines]]: a name, some of its methods, steps, and lists of values for the methods' settings.

    scenes: the names of those of the study's scenes that these are for; all of them by default. optional: leave the
    engine out where it is not installed, and say so.
    """

    model_config = ConfigDict(extra="allow")

    name: str
    methods: Annotated[list[str], Field(min_length=1)]
    dt: Annotated[list[Annotated[float, _STEP]], Field(min_length=1)] | None = None
    scenes: Annotated[list[str], Field(min_length=1)] | None = None
    optional: bool = False


class StudyFile(Table):
    """The keys that every study file may have. A kind of study adds its own.

    time_limit, memory_limit: what each job may take, s and GB (1e9 bytes). Less than half a GB would fail good engines,
    which compile their code.
    """

    KEYS_ARE: ClassVar[str] = "key"

    title: Annotated[str, AfterValidator(one_line_title)]
    kind: str = "chaos"
    scenes: Annotated[list[str], Field(min_length=1)]
    engines: Annotated[list[EngineTable], Field(min_length=1)]
    time_limit: Annotated[float, Field(gt=0, le=86400)] = 120.0
    memory_limit: Annotated[float, Field(ge=0.5, le=1e6, allow_inf_nan=False)] = 4.0
    quick: dict[str, Any] = {}


@dataclass(frozen=True)
class Plan:
    """A study, ready to run.

    options: the file's keys, checked, those of its kind among them. absent: optional engines that are not installed.
    """

    name: str
    where: str
    options: Any
    scenes: tuple[Scene, ...]
    cases: tuple[Case, ...]
    quick: bool
    absent: tuple[str, ...] = ()

    @property
    def digest(self) -> str:
        """A hash of the study's content."""
        text = json.dumps(self.options.model_dump(mode="json"), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def find_study(path_or_name: str | os.PathLike[str]) -> Path:
    """The file of a study: a path where it looks like one, the name of a bundled study otherwise."""
    try:
        text = os.fsdecode(path_or_name)
    except TypeError:
        raise InputError(f"{show(path_or_name)} is neither the name of a study nor a path") from None
    if text.lower().endswith(".toml") or "/" in text or os.sep in text:
        return Path(text)
    if text not in bundled_names("studies"):
        unknown = choose("study", printable(text[:60]), bundled_names("studies"))
        raise InputError(f"{unknown}, or a path that ends in .toml")
    return bundled("studies") / f"{text}.toml"


def load_plan(path_or_name: str | os.PathLike[str], *, quick: bool = False, engines: Sequence[str] = ()) -> Plan:
    """The plan of a study. quick: with the file's [quick] table over its other keys. engines: only these.

    Raises `InputError`, one line naming file and key, for whatever cannot be used.
    """
    path = find_study(path_or_name)
    where = shown_path(path)
    data = read_toml(path)
    name = data.get("kind", "chaos")
    if not isinstance(name, str) or name not in KINDS:
        raise input_error(where, choose("kind", printable(name[:60]) if isinstance(name, str) else show(name), KINDS))
    its = kind(name)
    options = validate(its.Options, data, where)
    overlay = data.get("quick", {})
    if fixed := {"quick", "kind"} & set(overlay):
        raise input_error(f"{where} [quick]", f"a quick study cannot change {min(fixed)!r}")
    changed = validate(its.Options, {**data, **overlay}, f"{where} [quick]")
    if quick:
        where, options = f"{where} [quick]" if overlay else where, changed
    scenes = tuple(_scenes(where, options.scenes, path.parent))
    if name not in WITH_EFFECTS:
        _check_plain(where, name, scenes)
    tables = _selected(where, options.engines, engines)
    absent = sorted({table.name for _, table in tables if table.optional and not _installed(table.name)})
    if absent and all(table.name in absent for _, table in tables):
        raise InputError(f"--engines: {', '.join(absent)}: not installed, and no other engine was asked for")
    cases = tuple(_cases(scenes, [(at, table) for at, table in tables if table.name not in absent]))
    idle = {scene.name for scene in scenes} - {case.scene.name for case in cases}
    if idle and not engines:
        raise input_error(where, f"scenes has {min(idle)!r}, and no table of [[engines]] is for it")
    plan = Plan(printable(path.stem), where, options, scenes, cases, quick, tuple(absent))
    its.check(plan)
    return plan


def _check_plain(where: str, kind_name: str, scenes: Sequence[Scene]) -> None:
    for scene in scenes:
        if others := sorted(scene.terms.keys() - {"gravity"}):
            allowed = f"scenes with gravity alone, in a study of kind {kind_name!r}"
            raise input_error(where, f"scenes has {scene.name!r}, which calls for {others[0]}; allowed: {allowed}")


def _scenes(where: str, names: Sequence[str], folder: Path) -> Iterator[Scene]:
    seen = set()
    for number, name in enumerate(names, 1):
        try:
            scene = load_scene(name, relative_to=folder)
        except InputError as error:
            raise input_error(f"{where}: scenes, entry {number}", str(error)) from None
        if scene.name in seen:
            raise input_error(where, f"scenes has {scene.name!r} twice; allowed: each name once")
        seen.add(scene.name)
        yield scene


def _installed(name: str) -> bool:
    try:
        engine(name)
    except MissingEngineError:
        return False
    except InputError:  # an unknown name, which is no engine to leave out: said where its table is read
        return True
    return True


def _selected(where: str, tables: list[EngineTable], only: Sequence[str]) -> list[tuple[str, EngineTable]]:
    """The tables of the engines asked for, each with where it is."""
    known = {table.name for table in tables}
    for name in only:
        if name not in known:
            raise InputError(f"--engines: {choose('engine', printable(str(name)), known)} (the engines of {where})")
    places = ((f"{where} [engines number {number}]", table) for number, table in enumerate(tables, 1))
    return [(at, table) for at, table in places if not only or table.name in only]


def _cases(scenes: Sequence[Scene], tables: Sequence[tuple[str, EngineTable]]) -> Iterator[Case]:
    variants = [(at, table, list(_variants(at, table))) for at, table in tables]
    known = [scene.name for scene in scenes]
    for at, table, _ in variants:
        if unknown := [name for name in table.scenes or () if name not in known]:
            raise input_error(at, f"scenes: {choose('scene', printable(unknown[0]), known)} (the study's scenes)")
    seen = set()
    for scene, (at, table, arguments) in itertools.product(scenes, variants):
        if table.scenes is not None and scene.name not in table.scenes:
            continue
        name = table.name
        for method, dt, settings in arguments:
            case = Case(scene, name, method, dt, settings)
            if (scene.name, *case.content) in seen:
                raise input_error(at, f"asks twice for {case}")
            if dt is not None and not 1 - 1e-9 <= scene.duration / dt <= _MOST_STEPS:
                least, most = scene.duration / _MOST_STEPS, scene.duration
                allowed = f"{least:.3g} to {most:g} s, for the {most:g} s of scene {scene.name!r}"
                raise input_error(at, f"dt is {dt:g}; allowed: {allowed}")
            seen.add((scene.name, *case.content))
            yield case


Variant = tuple[str, float | None, tuple[tuple[str, float], ...]]


def _variants(where: str, table: EngineTable) -> Iterator[Variant]:
    """The methods of an engine's table, with each step and each choice of settings."""
    try:
        its = engine(table.name)
    except InputError as error:
        raise input_error(where, str(error)) from None
    for name in table.methods:
        if name not in its.methods:
            raise input_error(where, choose("method", printable(name), its.methods))
    methods = [(name, its.methods[name]) for name in table.methods]
    settings = table.model_extra or {}
    known = sorted({setting for _, method in methods for setting in method.settings})
    for setting in settings:
        if setting not in known:
            raise input_error(
                where, choose("key", printable(setting), ["name", "methods", "dt", "scenes", "optional", *known])
            )
    if table.dt and all(method.adaptive for _, method in methods):
        raise input_error(where, f"dt is given; allowed: no dt, since method {methods[0][0]!r} chooses its steps")
    for name, method in methods:
        if not method.adaptive and table.dt is None:
            raise input_error(where, f"missing key 'dt': method {name!r} needs a list of steps, s")
        steps: list[float | None] = [None] if method.adaptive else list(table.dt or [])
        lists = [_values(where, key, settings[key], method) for key in sorted(method.settings) if key in settings]
        for dt, chosen in itertools.product(steps, itertools.product(*lists)):
            yield name, dt, chosen


def _values(where: str, key: str, values: Any, method: Method) -> list[tuple[str, float]]:
    setting = method.settings[key]
    whole = " whole" if setting.integer else ""
    allowed = f"a{whole} number, or a list of them, from {setting.low:g} to {setting.high:g}"
    chosen = values if isinstance(values, list) and values else [values]
    for value in chosen:
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not number or not setting.low <= value <= setting.high or (setting.integer and value != int(value)):
            raise input_error(where, f"{key} is {show(value)}; allowed: {allowed}")
    return [(key, int(value) if setting.integer else float(value)) for value in chosen]
