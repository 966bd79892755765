"""Which program this is, and on what it runs."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Final

from pendbench.base.processes import processor

_PACKAGE: Final = Path(__file__).resolve().parents[1]
#: How results are told is no part of what they are; of a kind of study only its measurements count.
_TOLD: Final = ("report/**/*.py", "commands/**/*.py", "kinds/**/*.py")
_MEASURED: Final = ("kinds/*/work*.py",)
#: What our own numbers are computed with: another version may round otherwise, or take another time.
_LIBRARIES: Final = ("numpy", "scipy", "numba", "llvmlite")


@cache
def source_digest() -> str:
    """A hash of the project's own source: results of other code are not taken for results of this one."""
    digest = hashlib.sha256()
    for source in sorted(_measuring()):
        digest.update(source.relative_to(_PACKAGE).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


@cache
def _measuring() -> frozenset[Path]:
    """The files that decide what a result is."""
    told = {file for pattern in _TOLD for file in _PACKAGE.glob(pattern)}
    measured = {file for pattern in _MEASURED for file in _PACKAGE.glob(pattern)}
    return frozenset(set(_PACKAGE.rglob("*.py")) - told | measured)


@cache
def measures(module: str) -> bool:
    """Whether the source of a module is in the digest; not asked of modules from outside the project."""
    package, *inner = module.split(".")
    return package != _PACKAGE.name or _PACKAGE.joinpath(*inner).with_suffix(".py") in _measuring()


@cache
def surroundings() -> tuple[str, ...]:
    """What the program runs on: numbers may round otherwise there, and times are of one machine."""
    return platform.python_version(), processor(), *(f"{name} {metadata.version(name)}" for name in _LIBRARIES)
