"""The keys of a study file, and what stands in for those that it leaves out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Self

from pydantic import AfterValidator, ConfigDict, Field, PrivateAttr

from pendbench.base.errors import MissingEngineError
from pendbench.base.ranges import Step
from pendbench.engines.registry import engine, engine_names, is_foreign, only_by_name
from pendbench.execution.limits import MEMORY_LIMIT_GB, TIME_LIMIT_S
from pendbench.scene.toml_file import Table, one_line_title


class EngineTable(Table):
    """[[engines]]: an engine and what is to run of it. Further keys are lists of values for its methods' settings.

    Without any such table, all engines that are installed are run with all their methods.
    """

    model_config = ConfigDict(extra="allow")

    name: str
    """the engine's name"""
    methods: Annotated[list[str], Field(min_length=1)] | None = None
    """some of its methods; all of them by default"""
    dt: Annotated[list[Annotated[float, Step(1e-6, 1e3, "s")]], Field(min_length=1)] | None = None
    """steps, s, for methods that do not choose their own; by default those of the kind of study that a scene is long
    enough for"""
    scenes: Annotated[list[str], Field(min_length=1)] | None = None
    """the names of those of the study's scenes that these are for; all of them by default"""
    optional: bool = False
    """leave the engine out where it is not installed, and say so"""
    _origin: str = PrivateAttr("")

    def of(self, origin: str) -> Self:
        """The same table, which stands in another file than the study's: `origin` says where."""
        self._origin = origin
        return self

    def place(self, study: str, number: int) -> str:
        """Where it stands, for messages; number: of the study's tables."""
        return self._origin or f"{study} [engines number {number}]"


class StudyFile(Table):
    """The keys that every study file may have. A kind of study adds its own."""

    KEYS_ARE: ClassVar[str] = "key"
    #: What is run where a file names no steps (s), and, of methods that have a tolerance, no engines at all.
    STEPS: ClassVar[tuple[float, ...]] = (1e-2, 1e-3, 1e-4)
    TOLERANCES: ClassVar[tuple[float, ...]] = ()
    #: The kind's keys that name scenes: with --scenes they keep what is about one of those.
    ABOUT_SCENES: ClassVar[tuple[str, ...]] = ()
    #: Whether engines that may be left out are first loaded in processes of their own, which may crash or hang.
    LOADED_APART: ClassVar[bool] = False

    title: Annotated[str, AfterValidator(one_line_title)] | None = None
    """one line, the report's heading; the study's name by default"""
    kind: str = "chaos"
    """the question that the study asks"""
    scenes: Annotated[list[str], Field(min_length=1)]
    """names of bundled scenes, or paths beside the study's file; with --scenes they are not needed"""
    engines: Annotated[list[EngineTable], Field(min_length=1)] | None = None
    """what is run in each scene: see [[engines]]"""
    time_limit: Annotated[float, Field(gt=0, le=86400)] = TIME_LIMIT_S
    """s of processor time that each job may take; compiling does not count"""
    memory_limit: Annotated[float, Field(ge=0.5, le=1e6, allow_inf_nan=False)] = MEMORY_LIMIT_GB
    """GB (1e9 bytes) that each job may take; less than half a GB would fail good engines, which compile their code"""
    quick: dict[str, Any] = {}
    """keys that take the place of the others' values with --quick"""

    @classmethod
    def default_engines(cls, named: Sequence[str]) -> Sequence[EngineTable]:
        """What is run where the file names no engines; `named`: on the command line."""
        return default_tables(cls, named)


def default_tables(options: type[StudyFile], named: Sequence[str] = ()) -> list[EngineTable]:
    """All engines that are installed, with all their methods, but those that run only by name and are not `named`.

    Those of others are not loaded here, since that may go wrong; they are left out later where they are missing.
    """
    return [table for name in engine_names() for table in _tables_of(name, options.TOLERANCES, name in named)]


def _tables_of(name: str, tolerances: Sequence[float], named: bool) -> Iterator[EngineTable]:
    if is_foreign(name):
        yield EngineTable(name=name, optional=True)
        return
    if only_by_name(name) and not named:
        return
    try:
        methods = engine(name).methods
    except MissingEngineError:
        return
    with_tolerance = [key for key, method in methods.items() if tolerances and "tolerance" in method.settings]
    others = [key for key in methods if key not in with_tolerance]
    if others:
        yield EngineTable(name=name, methods=others)
    if with_tolerance:
        its = methods[with_tolerance[0]].settings["tolerance"]
        allowed = [value for value in tolerances if its.fits(value)]
        yield EngineTable.model_validate({"name": name, "methods": with_tolerance, "tolerance": allowed})


def about_scenes(data: Mapping[str, Any], names: Sequence[str], keys: Sequence[str]) -> dict[str, Any]:
    """A study file's data about these scenes in place of its own.

    keys: those that name scenes. They keep what is about one of these; the kind's defaults stand in for the rest.
    """
    changed = {**_about(data, names, keys), "scenes": list(names)}
    overlay = data.get("quick")
    if isinstance(overlay, Mapping):
        changed["quick"] = {key: its for key, its in _about(overlay, names, keys).items() if key != "scenes"}
    return changed


def _about(table: Mapping[str, Any], names: Sequence[str], keys: Sequence[str]) -> dict[str, Any]:
    kept = {key: _kept(table[key], names) for key in keys if key in table}
    return {key: kept.get(key, its) for key, its in table.items() if kept.get(key, True)}


def _kept(value: Any, names: Sequence[str]) -> Any:
    """What of a value is about these scenes: a name, a list of names, a table by names, or one with a list of them."""
    match value:
        case str():
            return value if value in names else None
        case list():
            return [each for each in value if each in names]
        case {"scenes": list(own)}:
            kept = [each for each in own if each in names]
            return {**value, "scenes": kept} if kept else None
        case Mapping():
            return {key: its for key, its in value.items() if key in names}
    return value  # of a wrong type, which is said where it is read
