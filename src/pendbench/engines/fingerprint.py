"""Which program an engine is, to the byte: results of an engine are not taken for results of its next build."""

from __future__ import annotations

import hashlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from functools import cache, lru_cache
from importlib import metadata
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path

from pendbench.engines.registry import engine


def fingerprint(name: str) -> str:
    """A hash of the code behind an engine: of its adapter's package, and of the library that the adapter drives.

    A library that was installed is known by the record of its distribution, which has a hash of each file; one that is
    installed from a folder where it is being worked on, or not at all, by the content of its files.

    Raises what loading the engine raises.
    """
    its = engine(name)
    if (own := getattr(its, "fingerprint", None)) is not None:
        return str(own)  # of an engine of another environment
    adapter = type(its).__module__.partition(".")[0]
    return _of_libraries(frozenset({adapter, *getattr(its, "libraries", (its.name,))} - {"pendbench"}))


def installed() -> tuple[tuple[str, int], ...]:
    """Where modules are found: each folder, and when something was last put there or taken away, ns."""
    return tuple((path, os.stat(path).st_mtime_ns) for path in sys.path if os.path.isdir(path))


@lru_cache(maxsize=1)
def _records(where: tuple[tuple[str, int], ...]) -> tuple[tuple[metadata.Distribution, str], ...]:
    """Every distribution that has a record of its files, with that record, for what is installed now.

    importlib.metadata's own table of packages takes five times as long.
    """
    del where
    return tuple((each, record) for each in metadata.distributions() if (record := _record(each)))


def _record(distribution: metadata.Distribution) -> str | None:
    try:
        return distribution.read_text("RECORD")
    except (OSError, UnicodeDecodeError):
        return None


@cache
def _of_libraries(libraries: frozenset[str]) -> str:
    digest = hashlib.sha256()
    for library in sorted(libraries):
        for part in _parts(library):
            digest.update(part)
    return digest.hexdigest()[:16]


def _parts(library: str) -> Iterator[bytes]:
    """What a top-level package is made of; nothing of one that is not there."""
    try:
        spec = find_spec(library)
    except (ImportError, ValueError):
        return
    if spec is None:
        return
    holds = re.compile(rf"^{re.escape(library)}(?:/|\.py,|\.[^/,]*(?:so|pyd),)", re.MULTILINE)
    found = [(each.name or "", record, each) for each, record in _records(installed()) if holds.search(record)]
    if _is_explained(spec, library, [each for _, _, each in found]):
        yield from (record.encode() for _, record in sorted((name, record) for name, record, _ in found))
        return
    folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
    files = {file for folder in folders for file in folder.rglob("*") if file.suffix != ".pyc" and file.is_file()}
    for file in sorted(files | ({Path(spec.origin)} if spec.origin and Path(spec.origin).is_file() else set())):
        yield file.name.encode()
        yield file.read_bytes()


def _is_explained(spec: ModuleSpec, library: str, found: Iterable[metadata.Distribution]) -> bool:
    """Whether all that an import would find is where these distributions have put theirs.

    It is not where a package is worked on in its folder, or another copy comes first on the path.
    """
    whole = spec.submodule_search_locations
    run = [Path(spec.origin or "").parent] if whole is None else whole
    put = [each.locate_file("" if whole is None else library) for each in found]
    return {os.path.realpath(place) for place in run} <= {os.path.realpath(str(place)) for place in put}
