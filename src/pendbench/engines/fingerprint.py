"""Which program an engine is, to the byte: results of an engine are not taken for results of its next build."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import metadata
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


@cache
def _distributions(where: tuple[tuple[str, int], ...]) -> Mapping[str, list[str]]:
    """The distributions of each top-level package, for what is installed now: to read all of them takes 0.2 s."""
    del where
    return metadata.packages_distributions()


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
    names = _distributions(installed()).get(library, [])
    records = [_record(distribution) for distribution in sorted(names)]
    if records and all(records):
        yield from (record.encode() for record in records if record)
        return
    folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
    files = {file for folder in folders for file in folder.rglob("*") if file.suffix != ".pyc" and file.is_file()}
    for file in sorted(files | ({Path(spec.origin)} if spec.origin and Path(spec.origin).is_file() else set())):
        yield file.name.encode()
        yield file.read_bytes()


def _record(name: str) -> str | None:
    """The hashes of a distribution's files, or None where they do not tell what is run."""
    distribution = metadata.distribution(name)
    source = json.loads(distribution.read_text("direct_url.json") or "{}")
    if source.get("dir_info", {}).get("editable"):
        return None
    return distribution.read_text("RECORD")
