"""A study file, read strictly, and the cases it stands for."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pendbench.base.bundled import bundled, bundled_names
from pendbench.base.errors import InputError, choose, printable
from pendbench.base.strict import input_error, read_toml, show, shown_path, validate
from pendbench.scene.scene import Scene, load_scene
from pendbench.study.absent import why_absent
from pendbench.study.case import Case
from pendbench.study.cases import cases_of, selected
from pendbench.study.kinds import kind, kinds
from pendbench.study.study_file import StudyFile, about_scenes


@dataclass(frozen=True)
class Plan:
    """A study, ready to run.

    options: the file's keys, checked, those of its kind among them. absent: optional engines left out, and why.
    """

    name: str
    where: str
    options: Any
    scenes: tuple[Scene, ...]
    cases: tuple[Case, ...]
    quick: bool
    absent: Mapping[str, str] = field(default_factory=dict)

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
    if text.lower().endswith((".xml", ".urdf")):
        where = shown_path(text)
        raise input_error(where, f"this is a model, not a study; {_instead(where)}")
    if text.lower().endswith(".toml") or "/" in text or os.sep in text:
        return Path(text)
    if text not in bundled_names("studies"):
        unknown = choose("study", printable(text[:60]), bundled_names("studies"))
        raise InputError(f"{unknown}, or a path that ends in .toml")
    return bundled("studies") / f"{text}.toml"


def _instead(where: str) -> str:
    """What to do with a scene's file."""
    file = shlex.quote(where)
    return f"to study it: pendbench judge {file}, or pendbench study chaos --scenes {file}"


def load_plan(
    path_or_name: str | os.PathLike[str],
    *,
    quick: bool = False,
    engines: Sequence[str] = (),
    scenes: Sequence[Scene] = (),
    changes: Mapping[str, Any] = MappingProxyType({}),
) -> Plan:
    """The plan of a study.

    quick: with the file's [quick] table over its other keys. engines: only these. scenes: in place of the study's.
    changes: keys over those of the file.

    Raises `InputError`, one line naming file and key, for whatever cannot be used.
    """
    path = find_study(path_or_name)
    where = shown_path(path)
    data = {**read_toml(path), **changes}
    its = kind(_kind_of(data, where))
    if scenes:
        _check_names(scenes)
        data = about_scenes(data, [scene.name for scene in scenes], its.Options.ABOUT_SCENES)
    where, options = _options(data, its.Options, where, quick=quick, named=engines)
    chosen = tuple(scenes or _scenes(where, options.scenes, path.parent))
    tables = selected(where, options.engines, engines, apart=its.Options.LOADED_APART)
    absent = why_absent({table.name for _, table in tables if table.optional}, apart=its.Options.LOADED_APART)
    if absent and all(table.name in absent for _, table in tables):
        raise InputError(f"--engines: {', '.join(absent)}: not installed, and no other engine was asked for")
    present = [(at, table) for at, table in tables if table.name not in absent]
    cases = tuple(cases_of(where, chosen, present, its.Options.STEPS, others=bool(scenes)))
    idle = {scene.name for scene in chosen} - {case.scene.name for case in cases}
    if idle and not engines:
        raise input_error(where, f"scenes has {min(idle)!r}, and no table of [[engines]] is for it")
    plan = Plan(printable(path.stem), where, options, chosen, cases, quick, absent)
    its.check(plan)
    return plan


def _check_names(scenes: Sequence[Scene]) -> None:
    names = [scene.name for scene in scenes]
    if twice := [name for at, name in enumerate(names) if name in names[:at]]:
        raise InputError(f"--scenes has {twice[0]!r} twice; allowed: each name once")


def _kind_of(data: Mapping[str, Any], where: str) -> str:
    """The name of a study's kind. Raises InputError where there is no such kind, or the file is no study."""
    if "chain" in data and "engines" not in data:
        raise input_error(where, f"this is a scene, not a study; {_instead(where)}")
    name = data.get("kind", StudyFile.model_fields["kind"].default)
    if not isinstance(name, str) or name not in kinds():
        raise input_error(where, choose("kind", printable(name[:60]) if isinstance(name, str) else show(name), kinds()))
    return name


def _options(
    data: Mapping[str, Any], its: type[StudyFile], where: str, *, quick: bool, named: Sequence[str]
) -> tuple[str, Any]:
    """A study's keys, checked, with what stands in for those that are left out; and where they are from."""
    options = validate(its, data, where)
    overlay = data.get("quick", {})
    if fixed := {"quick", "kind"} & set(overlay):
        raise input_error(f"{where} [quick]", f"a quick study cannot change {min(fixed)!r}")
    changed = validate(its, {**data, **overlay}, f"{where} [quick]")
    if quick:
        where, options = f"{where} [quick]" if overlay else where, changed
    if options.engines is None:
        options = options.model_copy(update={"engines": its.default_engines(named)})
    return where, options


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
