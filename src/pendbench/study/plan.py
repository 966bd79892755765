"""A study file, read strictly, and the cases it stands for."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, ConfigDict, Field

from pendbench.bundled import bundled, bundled_names
from pendbench.engines.protocol import Engine, Method
from pendbench.engines.registry import engine
from pendbench.errors import InputError, choose, printable
from pendbench.scene import Scene, load_scene
from pendbench.scene_file import Table
from pendbench.strict import input_error, read_toml, show, shown_path, validate
from pendbench.study.case import Case
from pendbench.study.kinds import KINDS, kind

Step = Annotated[float, Field(gt=0, le=1e3, allow_inf_nan=False)]


def _one_line(text: str) -> str:
    if not (text.isprintable() and 1 <= len(text) <= 200):
        raise ValueError("one line of 1 to 200 characters")
    return text


class EngineTable(Table):
    """[[engines]]: a name, some of its methods, steps, and lists of values for the methods' settings."""

    model_config = ConfigDict(extra="allow")

    name: str
    methods: Annotated[list[str], Field(min_length=1)]
    dt: list[Step] = []


class StudyFile(Table):
    """The keys that every study file may have. A kind of study adds its own."""

    KEYS_ARE: ClassVar[str] = "key"

    title: Annotated[str, AfterValidator(_one_line)]
    kind: str = "chaos"
    scenes: Annotated[list[str], Field(min_length=1)]
    engines: Annotated[list[EngineTable], Field(min_length=1)]
    time_limit: Annotated[float, Field(gt=0, le=86400)] = 120.0
    quick: dict[str, Any] = {}


@dataclass(frozen=True)
class Plan:
    """A study, ready to run. options: the file's keys, checked, those of its kind among them."""

    name: str
    where: str
    options: Any
    scenes: tuple[Scene, ...]
    cases: tuple[Case, ...]
    quick: bool

    @property
    def digest(self) -> str:
        """A hash of the study's content."""
        text = json.dumps(self.options.model_dump(mode="json"), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def find_study(path_or_name: str | os.PathLike[str]) -> Path:
    """The file of a study: a path where it looks like one, the name of a bundled study otherwise."""
    text = os.fsdecode(path_or_name)
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
    if name not in KINDS:
        raise input_error(where, choose("kind", name if isinstance(name, str) else show(name), KINDS))
    model = kind(name).Options
    validate(model, data, where)
    overlay = data.get("quick", {}) if quick else {}
    if "quick" in overlay or "kind" in overlay:
        raise input_error(f"{where} [quick]", "a quick study cannot change 'kind' or 'quick'")
    options = validate(model, {**data, **overlay}, f"{where} [quick]" if overlay else where)
    scenes = tuple(load_scene(scene, relative_to=path.parent) for scene in options.scenes)
    _distinct(where, [scene.name for scene in scenes])
    cases = tuple(_cases(where, scenes, _selected(where, options.engines, engines)))
    return Plan(printable(path.stem), where, options, scenes, cases, quick)


def _distinct(where: str, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise input_error(where, f"scenes names {name!r} twice; allowed: each name once")


def _selected(where: str, tables: list[EngineTable], only: Sequence[str]) -> list[EngineTable]:
    known = {table.name for table in tables}
    for name in only:
        if name not in known:
            raise InputError(f"--engines: {choose('engine', printable(name), known)} (the engines of {where})")
    return [table for table in tables if not only or table.name in only]


def _cases(where: str, scenes: Sequence[Scene], tables: Sequence[EngineTable]) -> Iterator[Case]:
    seen = set()
    for scene, (number, table) in itertools.product(scenes, enumerate(tables, 1)):
        for arguments in _variants(f"{where} [engines number {number}]", table, engine(table.name)):
            case = Case(scene, table.name, *arguments)
            if (scene.name, *case.content) in seen:
                raise input_error(where, f"asks twice for {case}")
            seen.add((scene.name, *case.content))
            yield case


Variant = tuple[str, float | None, tuple[tuple[str, float], ...]]


def _variants(where: str, table: EngineTable, its: Engine) -> Iterator[Variant]:
    methods = {name: its.methods[name] for name in table.methods if name in its.methods}
    for name in table.methods:
        if name not in its.methods:
            raise input_error(where, choose("method", printable(name), its.methods))
    settings = table.model_extra or {}
    known = sorted({setting for method in methods.values() for setting in method.settings})
    for setting in settings:
        if setting not in known:
            raise input_error(where, choose("key", printable(setting), ["name", "methods", "dt", *known]))
    for name, method in methods.items():
        steps: list[float | None] = [None] if method.adaptive else list(table.dt)
        if not steps:
            raise input_error(where, f"missing key 'dt': method {name!r} needs a list of steps, s")
        lists = [_values(where, key, settings[key], method) for key in sorted(method.settings) if key in settings]
        for dt, chosen in itertools.product(steps, itertools.product(*lists)):
            yield name, dt, chosen


def _values(where: str, key: str, values: Any, method: Method) -> list[tuple[str, float]]:
    setting = method.settings[key]
    whole = " whole" if setting.integer else ""
    allowed = f"a{whole} number, or a list of them, from {setting.low:g} to {setting.high:g}"
    chosen = values if isinstance(values, list) else [values]
    for value in chosen or [None]:
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not number or not setting.low <= value <= setting.high or (setting.integer and value != int(value)):
            raise input_error(where, f"{key} is {show(value)}; allowed: {allowed}")
    return [(key, value) for value in chosen]
