"""What the league runs of each engine: one file for each, studies/league/ENGINE.toml, that its authors can change."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import ConfigDict, Field

from pendbench.base.bundled import bundled
from pendbench.base.ranges import Step
from pendbench.base.strict import read_toml, shown_path, validate
from pendbench.engines.registry import engine_names, is_foreign
from pendbench.scene.toml_file import Table
from pendbench.study.study_file import EngineTable

_FOLDER: Final = "league"


class LeagueTable(EngineTable):
    """[[engines]] of a league: as in every study, and whether this is how the engine comes."""

    as_it_comes: bool = False
    """whether this one method, with its one step, is what who installs the engine and changes nothing gets"""


class AsItComes(Table):
    """[as_it_comes]: the method and step of who installs the engine and changes nothing. Further keys: settings."""

    model_config = ConfigDict(extra="allow")

    method: str
    """the method's name"""
    dt: Annotated[float, Step(1e-6, 1e3, "s")] | None = None
    """the engine's own step, s, or that of its examples; none for a method that chooses its steps"""
    why: Annotated[str, Field(min_length=1, max_length=300)]
    """where that is said"""


class Tried(Table):
    """[[tried]]: methods that are tried at their best. Further keys are lists of values for their settings."""

    model_config = ConfigDict(extra="allow")

    methods: Annotated[list[str], Field(min_length=1)]
    """their names"""
    dt: Annotated[list[Annotated[float, Step(1e-6, 1e3, "s")]], Field(min_length=1)] | None = None
    """steps, s; by default 1/20 s and its halves"""


class EngineFile(Table):
    """studies/league/ENGINE.toml."""

    as_it_comes: AsItComes
    """what is run as it comes"""
    tried: Annotated[list[Tried], Field(min_length=1)]
    """what is tried at its best"""
    snippet: Annotated[str, Field(min_length=1, max_length=20_000)] | None = None
    """what a user writes to have the angles `theta` (rad) of the challenge at 0.1 s"""


def engine_file(name: str) -> tuple[str, EngineFile] | None:
    """An engine's file, and where it is; None where there is none. Raises `InputError` for a file with a fault."""
    path = bundled("studies") / _FOLDER / f"{name}.toml"
    return _read(path) if path.is_file() else None


@cache
def _read(path: Path) -> tuple[str, EngineFile]:
    where = shown_path(path)
    return where, validate(EngineFile, read_toml(path), where)


def league_tables() -> Iterator[LeagueTable]:
    """What is run of every engine that is known: as its file says, or all its methods where it has none."""
    for name in engine_names():
        if (found := engine_file(name)) is not None:
            yield from _tables(name, *found)
        elif is_foreign(name):
            yield LeagueTable(name=name, optional=True)


def _tables(name: str, where: str, file: EngineFile) -> Iterator[LeagueTable]:
    comes = file.as_it_comes
    step = {} if comes.dt is None else {"dt": [comes.dt]}
    own: dict[str, Any] = {"methods": [comes.method], **step, **(comes.model_extra or {})}
    yield _table(name, f"{where} [as_it_comes]", own | {"as_it_comes": True})
    for number, tried in enumerate(file.tried, 1):
        its = {"methods": tried.methods, "dt": tried.dt, **(tried.model_extra or {})}
        yield _table(name, f"{where} [tried number {number}]", its)


def _table(name: str, where: str, keys: Mapping[str, Any]) -> LeagueTable:
    return validate(LeagueTable, {"name": name, "optional": True, **keys}, where).of(where)
