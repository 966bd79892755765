"""TOML files read strictly: whatever is wrong with one is said in one line that names the file."""

from __future__ import annotations

import dataclasses
import difflib
import os
import re
import stat
import tomllib
import typing
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar, cast

from pendbench.base.errors import InputError, choose, printable

if TYPE_CHECKING:
    import pydantic
    from pydantic_core import ErrorDetails

    Model = TypeVar("Model", bound=pydantic.BaseModel)

MAX_BYTES: Final = 1 << 20
MAX_LINE: Final = 400
#: Of a file with several faults: how many are told, how long each may be, and all of them together.
MAX_FAULTS: Final = 8
MAX_FAULT: Final = 200
MAX_LINES: Final = 600
MAX_KEY_PARTS: Final = 32

# tomllib needs time and memory that grow with the square of a dotted key's parts: minutes, for a key of 100 kB.
_KEY_PART: Final = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_LONG_KEY: Final = re.compile(rf"(?<![\w-])(?:{_KEY_PART}){{{MAX_KEY_PARTS}}}", re.ASCII)

_UNKNOWN: Final = ("extra_forbidden", "unexpected_keyword_argument")
_MISSING: Final = ("missing", "missing_argument", "missing_keyword_only_argument")

# What is allowed, by pydantic's type of error and with its context.
_ALLOWED: Final[Mapping[str, str]] = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "finite_number": "a finite number",
    "bool_type": "true or false",
    "string_type": "text in quotes",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dataclass_type": "a table",
    "greater_than": "above {gt}",
    "greater_than_equal": "{ge} or more",
    "less_than": "below {lt}",
    "less_than_equal": "at most {le}",
    "string_too_short": "text of {min_length} or more characters",
    "string_too_long": "text of at most {max_length} characters",
    "too_short": "{min_length} or more entries",
    "too_long": "at most {max_length} entries",
    "literal_error": "{expected}",
}


def shown_path(path: str | os.PathLike[str]) -> str:
    """A path for a message: on one line, and its end where it is long."""
    text = os.fspath(path)
    line = printable(text[-121:])
    return line if len(line) <= 120 else "..." + line[-117:]


def show(value: object) -> str:
    """A value for a message: short and on one line, however large or deep the value is."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            line = printable(value[:61])
            return repr(line) if len(line) <= 60 else repr(line[:57]) + "..."
        case int():
            digits = int(value.bit_length() * 0.30103) + 1
            return str(value) if digits <= 40 else f"a whole number of about {digits} digits"
        case Mapping():
            return "a table"
        case Sequence():
            return f"a list of {len(value)}" if value else "an empty list"
        case _:
            text = printable(str(value)[:200])
            return text if len(text) <= 60 else text[:57] + "..."


def input_error(where: str, problem: str) -> InputError:
    """The error that says what is wrong where, in one line of bounded length."""
    line = printable(f"{where}: {problem}")
    return InputError(line if len(line) <= MAX_LINE else line[: MAX_LINE - 3] + "...")


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What a TOML file holds.

    Only a regular file of at most `MAX_BYTES` in UTF-8 is read; a pipe or a device is never opened.

    Raises `InputError`, one line, for anything else and for text that is not TOML (with line and column).
    """
    where = shown_path(path)
    text = _decoded(read_regular(path, where, MAX_BYTES), where)
    if long_key := _LONG_KEY.search(text):
        line = text.count("\n", 0, long_key.start()) + 1
        raise input_error(where, f"a dotted key of more than {MAX_KEY_PARTS} parts (at line {line})")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        end = f"at the end, line {text.count(chr(10)) + 1}"
        raise input_error(where, f"not TOML: {error}".replace("at end of document", end)) from None
    except RecursionError:
        raise input_error(where, "lists or tables are nested too deeply") from None
    except ValueError:  # of Python itself, which reads no integer of more than some thousand digits
        raise input_error(where, "a whole number has too many digits") from None


def read_regular(path: str | os.PathLike[str], where: str, most: int) -> bytes:
    """The bytes of a regular file, at most so many; a pipe or a device is never opened.

    Raises `InputError`, one line that begins with `where`.
    """
    try:
        found = os.stat(path)
        if stat.S_ISDIR(found.st_mode):
            raise input_error(where, "a folder, not a file")
        if not stat.S_ISREG(found.st_mode):
            raise input_error(where, "not a regular file")
        content = b""
        if found.st_size <= most:
            with open(path, "rb") as file:
                content = file.read(most + 1)
    except FileNotFoundError:
        raise input_error(where, "no such file") from None
    except OSError as error:
        raise input_error(where, f"cannot be read: {error.strerror or error}") from None
    except InputError:
        raise
    except ValueError as error:  # a path that the system cannot be asked for: a NUL, a lone surrogate
        raise input_error(where, f"not a path: {error}") from None
    if max(found.st_size, len(content)) > most:
        raise input_error(where, f"larger than {most} bytes, the largest that is read")
    return content


def _decoded(content: bytes, where: str) -> str:
    try:
        return content.decode("utf-8-sig")  # some editors begin a file with a mark of its encoding
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise input_error(where, f"not UTF-8: byte 0x{content[error.start]:02x} (at line {line})") from None


def validate(model: type[Model], data: Mapping[str, Any], where: str) -> Model:
    """The data as a pydantic model, or an `InputError` whose one line says all that is wrong and what is allowed.

    A validator of one value raises `ValueError` with the words for what is allowed ("a number from 0 to 9 m"); a
    validator of a whole table raises `InputError` with a sentence. A table's class may say what its keys are, for the
    message about an unknown one: ``KEYS_ARE: ClassVar[str] = "effect"``; and that of the whole file what to say of keys
    that people try, in any of its tables: ``NOT_YET: ClassVar[Mapping[str, str]]``.
    """
    from pydantic import ValidationError

    try:
        return model.model_validate(data)
    except ValidationError as error:
        groups = _groups(error.errors(include_url=False), model, data)
    faults = [_explained(details, model, data) for details in groups[:MAX_FAULTS]]
    raise _all_of(faults, len(groups), where)


class _Fault(NamedTuple):
    """What is wrong in the table at a path of the file."""

    tables: Sequence[str | int]
    problem: str


def _groups(details: list[ErrorDetails], model: type[Any], data: Mapping[str, Any]) -> list[list[ErrorDetails]]:
    """The errors of each fault: those about one value that may be one of several things are one. Unknown keys first.

    A misspelt key is also a missing one; the misspelling is what helps.
    """
    groups: list[list[ErrorDetails]] = []
    meant: set[tuple[str | int, ...]] = set()
    first: tuple[str | int, ...] = ()
    for detail in details:
        path = _path(detail, data)
        if detail["type"] in _UNKNOWN and len(groups) < 4 * MAX_FAULTS:
            meant |= {(*path[:-1], name) for name in _near(path, model)}
        shared = min(len(path), len(first))
        if groups and path[:shared] == first[:shared]:
            groups[-1].append(detail)
        else:
            groups.append([detail])
            first = path
    kept = [group for group in groups if group[0]["type"] not in _MISSING or _path(group[0], data) not in meant]
    return sorted(kept, key=lambda group: group[0]["type"] not in _UNKNOWN)


def _near(path: tuple[str | int, ...], model: type[Any]) -> list[str]:
    """The key that one at a path of the file may have been meant for."""
    allowed = [name for owner in _tables_at(model, path[:-1]) for name in _fields(owner)]
    return difflib.get_close_matches(str(path[-1])[:60], allowed, n=1)


def _all_of(faults: list[_Fault], count: int, where: str) -> InputError:
    """The error that says one fault, or as many of them as a line holds."""
    if count == 1:
        return _at(where, *faults[0])
    told = f"{where}: {count} faults"
    for number, (tables, problem) in enumerate(faults, 1):
        name = _table_name(tables)
        line = printable(f"({number}) {name and f'[{name}] '}{problem}")
        line = line if len(line) <= MAX_FAULT else line[: MAX_FAULT - 3] + "..."
        if number > 1 and len(told) + len(line) > MAX_LINES - 20:
            return InputError(f"{told}; and {count - number + 1} more")
        told += f"{':' if number == 1 else ';'} {line}"
    return InputError(told if count == len(faults) else f"{told}; and {count - len(faults)} more")


def _explained(details: list[ErrorDetails], model: type[Any], data: Mapping[str, Any]) -> _Fault:
    """What the first of pydantic's errors means; those that follow may be about alternatives to it."""
    first = details[0]
    path = _path(first, data)
    *tables, key = path or ("",)
    owners = _tables_at(model, tables)
    if first["type"] in _UNKNOWN:
        if said := getattr(model, "NOT_YET", {}).get(key):
            return _Fault(tables, said)
        kind = getattr(owners[0], "KEYS_ARE", "key")
        allowed = {name for owner in owners for name in _fields(owner)}
        return _Fault(tables, choose(kind, printable(str(key)[:60])[:60], allowed))
    if first["type"] in _MISSING:
        return _Fault(tables, _missing(str(key), [_fields(owner).get(str(key)) for owner in owners]))
    if isinstance(first.get("ctx", {}).get("error"), InputError):
        return _Fault(path, str(first["ctx"]["error"]))
    return _wrong_value(path, details, data)


def _missing(key: str, annotations: list[Any]) -> str:
    if not any(_tables_in(annotation) for annotation in annotations):
        return f"missing key '{key}'"
    is_list = any(typing.get_origin(annotation) is list for annotation in annotations)
    return f"missing table [[{key}]]" if is_list else f"missing table [{key}]"


def _wrong_value(path: tuple[str | int, ...], details: list[ErrorDetails], data: Mapping[str, Any]) -> _Fault:
    """A value that may be one of several things is none of them for several reasons; the deepest one counts."""
    places = [(_path(detail, data), detail) for detail in details]
    deepest = max((place for place, _ in places if place[: len(path)] == path), key=len)
    here = [detail for place, detail in places if place == deepest]
    names = [i for i, step in enumerate(deepest) if isinstance(step, str)]
    tables, key, entries = deepest[: names[-1]], deepest[names[-1]], deepest[names[-1] + 1 :]
    found = here[0]["input"]
    if here[0]["type"] == "literal_error" and isinstance(found, str):
        choices = re.findall(r"'([^']*)'", here[0]["ctx"]["expected"])
        return _Fault(tables, choose(str(key), printable(found[:60]), choices))
    entry = "".join(f", entry {int(i) + 1}," for i in entries)
    allowed = ", or ".join(dict.fromkeys(_allowed(detail) for detail in here))
    return _Fault(tables, f"{printable(str(key)[:60])[:60]}{entry} is {show(found)}; allowed: {allowed}")


def _allowed(detail: ErrorDetails) -> str:
    context = detail.get("ctx", {})
    if detail["type"] == "value_error":
        return str(context["error"])
    words = _ALLOWED.get(detail["type"])
    return words.format(**context) if words else detail["msg"]


def _at(where: str, tables: Sequence[str | int], problem: str) -> InputError:
    """The error in a table, written as in TOML: ``[effects.air_drag]``, ``[engines number 2]``."""
    name = _table_name(tables)
    return input_error(f"{where} [{name}]" if name else where, problem)


def _table_name(tables: Sequence[str | int]) -> str:
    name = ""
    for step in tables[:8]:
        name += f" number {step + 1}" if isinstance(step, int) else f".{step[:60]}"
    return name[1:]


def _path(detail: ErrorDetails, data: Mapping[str, Any]) -> tuple[str | int, ...]:
    """Keys and entries from the top to the error, without the names that pydantic adds for alternatives."""
    path: list[str | int] = []
    here: Any = data
    for step in detail["loc"]:
        if (isinstance(here, Mapping) and step in here) or (isinstance(here, list) and isinstance(step, int)):
            path.append(step)
            here = cast(Any, here)[step]
    return (*path, detail["loc"][-1]) if detail["type"] in _MISSING else tuple(path)


def _tables_at(model: type[Any], path: Sequence[str | int]) -> list[type[Any]]:
    """The classes that describe the table at a path of the file."""
    tables = [model]
    for step in path:
        annotations = [_fields(table).get(str(step)) for table in tables]
        tables = [inner for annotation in annotations for inner in _tables_in(annotation)] or tables
    return tables


def _tables_in(annotation: Any) -> list[type[Any]]:
    """The classes of tables that an annotation mentions."""
    if isinstance(annotation, type) and (hasattr(annotation, "model_fields") or dataclasses.is_dataclass(annotation)):
        return [annotation]
    return [table for inner in typing.get_args(annotation) for table in _tables_in(inner)]


def _fields(table: type[Any]) -> dict[str, Any]:
    """The keys of a table, each with its annotation."""
    if dataclasses.is_dataclass(table):
        hints = typing.get_type_hints(table)
        return {field.name: hints[field.name] for field in dataclasses.fields(table)}
    return {field.alias or name: field.annotation for name, field in table.model_fields.items()}
