"""What a model file says before anything compiles it: only what is small, harmless and in its own folder is compiled.

A model file is data. It is read here once by a parser that follows no entity, to find the files that it names and how
much it asks for. MuJoCo opens a file only where this module has let its name through.
"""

from __future__ import annotations

import math
import os
import re
import stat
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NoReturn
from xml.parsers import expat

from pendbench.base.strict import input_error, read_regular, show, shown_path

MAX_TEXT: Final = 8 << 20
MAX_FILES: Final = 64
MAX_DATA: Final = 64 << 20
MAX_PIXELS: Final = 1 << 26
#: Elements, each as often as the file repeats it, and numbers that ask for memory.
MAX_ELEMENTS: Final = 10_000
MAX_DEPTH: Final = 2_000

#: What MuJoCo sets memory aside for: numbers that are multiplied, and the most that they may come to.
_SIZES: Final[Sequence[tuple[tuple[str, ...], int]]] = (
    (("width", "height"), 1 << 24),
    (("nrow", "ncol"), 1 << 22),
    (("params",), 1 << 20),
    (("subgrid",), 100),
    (("nsample",), MAX_ELEMENTS),
    (("dim",), MAX_ELEMENTS),
)
_NUMBER: Final = re.compile(r"\d{1,30}(\.\d*)?([eE]\+?\d{1,2})?", re.ASCII)
_MEMORY: Final = re.compile(r"\s*(\d+)\s*([KMGTPE]?)\s*", re.IGNORECASE)
MAX_MEMORY: Final = 1 << 30


@dataclass
class Source:
    """A model's files as they are read, and what they add up to."""

    path: Path
    folder: Path
    root: str = ""
    text: int = 0
    elements: int = 0
    attached: int = 0
    strip: bool | None = None
    folders: set[str] = field(default_factory=lambda: {""})
    files: list[tuple[str, str]] = field(default_factory=list)
    models: list[str] = field(default_factory=list)
    seen: set[Path] = field(default_factory=set)

    def refuse(self, problem: str) -> NoReturn:
        """Raise the error that says what is wrong with the model."""
        raise input_error(shown_path(self.path), problem)


def check_source(path: Path) -> Path:
    """Raise `InputError` where a model file is too large or names what it may not; return the file without links.

    Allowed are XML without a document type, at most `MAX_TEXT` bytes with all that it includes, files in its own folder
    and the folders below, no plugins, and no more than `MAX_ELEMENTS` elements, counted as often as they are repeated.
    """
    try:
        real = Path(os.path.realpath(path))
    except (OSError, ValueError) as error:  # a path that the system cannot be asked for
        raise input_error(shown_path(path), f"not a path: {error}") from None
    source = Source(path, real.parent)
    _read(source, real, 1)
    if source.root not in ("mujoco", "robot"):
        source.refuse(f"its root is <{source.root[:40]}>; allowed: <mujoco> (MJCF) or <robot> (URDF)")
    _read_models(source)
    for what, name in source.files:
        for found in _found(source, what, name):
            if found.stat().st_size > MAX_DATA or _pixels(found) > MAX_PIXELS:
                source.refuse(f"{what} {show(name)} is larger than {MAX_DATA} bytes or {MAX_PIXELS} pixels")
    return real


def _read_models(source: Source) -> None:
    """Read the models that can be attached to this one; all that there is may be there once more with each."""
    attached = source.attached
    for name in source.models:
        for found in _found(source, "model", name):
            if found.suffix.lower() in (".xml", ".urdf"):
                _read(source, found, 1)
    if source.attached > attached:
        source.refuse("it attaches a model that attaches others; allowed: models that do not")
    _check_count(source, source.elements * (1 + attached))


def _read(source: Source, path: Path, times: int) -> None:
    """One file with what it includes; `times`: how often its elements are there."""
    real = Path(os.path.realpath(path))
    if real in source.seen:
        return  # MuJoCo itself refuses a file that is included twice
    source.seen.add(real)
    if len(source.seen) > MAX_FILES:
        source.refuse(f"includes more than {MAX_FILES} files")
    content = read_regular(path, shown_path(path), MAX_TEXT)
    source.text += len(content)
    if source.text > MAX_TEXT:
        source.refuse(f"larger than {MAX_TEXT} bytes with what it includes, the largest that is read")
    _Elements(source, path, times).parse(content)


class _Elements:
    """One file's elements, one after the other."""

    def __init__(self, source: Source, path: Path, times: int) -> None:
        self.source, self.path = source, path
        self.times = [times]
        self.names: list[str] = []

    def parse(self, content: bytes) -> None:
        where = shown_path(self.path)
        parser = expat.ParserCreate("utf-8")
        parser.StartElementHandler, parser.EndElementHandler = self._start, self._end
        parser.StartDoctypeDeclHandler = self._doctype
        try:
            parser.Parse(content, True)
        except expat.ExpatError as error:
            said = expat.ErrorString(error.code)
            raise input_error(where, f"not XML: {said} (at line {error.lineno}, column {error.offset + 1})") from None

    def _doctype(self, *_: object) -> None:
        raise input_error(shown_path(self.path), "it declares a document type or entities; allowed: XML without these")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        source = self.source
        source.root = source.root or name
        self.names.append(name)
        self.times.append(self.times[-1] * (_times(attributes.get("count", "")) if name == "replicate" else 1))
        if len(self.names) > MAX_DEPTH:
            source.refuse(f"elements are nested deeper than {MAX_DEPTH}")
        source.elements += self._weight(name, attributes)
        _check_count(source, source.elements)
        if name in ("plugin", "extension"):
            source.refuse(f"<{name}>: a plugin is a program; allowed: a model that is data")
        _check_sizes(source, name, attributes)
        self._files(name, attributes)

    def _end(self, _: str) -> None:
        self.names.pop()
        self.times.pop()

    def _weight(self, name: str, attributes: Mapping[str, str]) -> int:
        if name == "attach":
            self.source.attached += self.times[-1]
        made = _times(attributes.get("count", "")) if name in ("composite", "flexcomp") else 1
        return self.times[-1] * made

    def _files(self, name: str, attributes: Mapping[str, str]) -> None:
        """Note the files that an element names; read those with more elements at once, for they may be repeated."""
        source = self.source
        if name == "compiler":
            source.folders |= {attributes[key] for key in ("assetdir", "meshdir", "texturedir") if key in attributes}
            if "strippath" in attributes:
                source.strip = attributes["strippath"] == "true"
        for key, value in attributes.items():
            if not (key.startswith("file") and value):
                continue
            if name == "include":
                self._include(value)
            elif name == "model":
                source.models.append(value)
            else:
                source.files.append((name, value))

    def _include(self, name: str) -> None:
        found = _found(self.source, "include", name, beside=self.path.parent)
        if not found:
            self.source.refuse(f"it includes {show(name)}, and there is no such file")
        for path in found:
            _read(self.source, path, self.times[-1])


def _times(text: str) -> int:
    """The product of whole numbers as they are written; MuJoCo says what is wrong with those that are none."""
    return math.prod(max(1, int(float(word))) for word in text.split() if _NUMBER.fullmatch(word))


def _check_count(source: Source, count: int) -> None:
    if count > MAX_ELEMENTS:
        source.refuse(f"it asks for more than {MAX_ELEMENTS} elements, counted as often as they are repeated")


def _check_sizes(source: Source, name: str, attributes: Mapping[str, str]) -> None:
    for keys, most in _SIZES:
        if math.prod(_times(attributes.get(key, "")) for key in keys) > most:
            source.refuse(f"<{name}> asks for {' x '.join(keys)} above {most}, the most that is set aside")
    if name in ("size", "numeric"):
        for key, value in attributes.items():
            if key not in ("memory", "data", "name") and _times(value) > MAX_ELEMENTS:
                source.refuse(f"<{name} {key}> is {show(value)}; allowed: at most {MAX_ELEMENTS}")
        _check_memory(source, attributes.get("memory", ""))


def _check_memory(source: Source, text: str) -> None:
    found = _MEMORY.fullmatch(text)
    if found and int(found[1][:30]) << 10 * " KMGTPE".index(found[2].upper() or " ") > MAX_MEMORY:
        source.refuse(f"<size memory> is {show(text)}; allowed: at most 1G")


def _found(source: Source, what: str, name: str, beside: Path | None = None) -> list[Path]:
    """The files that a name can mean: in the model's folder, in those that it names for meshes and the like.

    Refuses a name that leads, or may lead, out of the model's folder.
    """
    names = dict.fromkeys(_names(source, what, name))
    bases = {source.folder, *([beside] if beside else [])}
    if what != "include":
        bases |= {source.folder / folder for folder in source.folders if _inside(source, what, folder)}
    candidates = [base / own for base in sorted(bases) for own in names if _inside(source, what, own)]
    return [path for path in candidates if os.path.lexists(path) and _checked(source, what, path)]


def _names(source: Source, what: str, name: str) -> Iterator[str]:
    """A file's name without its folders, and with them unless MuJoCo strips them off, as it does for URDF."""
    plain = name.replace("\\", "/")
    strip = source.root == "robot" if source.strip is None else source.strip
    if not strip or what in ("include", "model"):
        yield plain
    yield plain.rpartition("/")[2]


def _inside(source: Source, what: str, name: str) -> bool:
    parts = name.replace("\\", "/").split("/")
    if name.startswith(("/", "\\", "~")) or ".." in parts or ":" in name or "\0" in name:
        source.refuse(f"{what} {show(name)} is not in the model's own folder; allowed: files there or in folders below")
    return bool(name)


def _checked(source: Source, what: str, path: Path) -> bool:
    """Whether it is there to be read; refuses what is a link out of the folder, a pipe or a device."""
    real = Path(os.path.realpath(path))
    if source.folder not in (real, *real.parents):
        source.refuse(f"{what} {show(path.name)} is a link out of the model's own folder; allowed: files inside")
    try:
        mode = os.stat(real).st_mode
    except OSError:
        return False
    if not stat.S_ISREG(mode):
        if what != "include" and stat.S_ISDIR(mode):
            return False
        source.refuse(f"{what} {show(path.name)} is not a regular file")
    return True


def _pixels(path: Path) -> int:
    """How many pixels a PNG file says that it has; 0 of any other file."""
    with open(path, "rb") as file:
        head = file.read(24)
    is_png = head.startswith(b"\x89PNG") and len(head) == 24
    return int.from_bytes(head[16:20], "big") * int.from_bytes(head[20:24], "big") if is_png else 0
