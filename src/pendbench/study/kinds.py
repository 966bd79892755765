"""The kinds of study: each is a folder of `pendbench.kinds`, and there is no list of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol, cast

if TYPE_CHECKING:
    from pendbench.execution.runner import Runner
    from pendbench.study.plan import Plan
    from pendbench.study.study_file import StudyFile

_ROOM: Final = Path(__file__).resolve().parents[1] / "kinds"


class Kind(Protocol):
    """What a kind's module `study` offers."""

    Options: type[StudyFile]
    check: Callable[[Plan], None]  # raises InputError, one line, for what only the kind can see
    measure: Callable[[Plan, Runner], Any]  # what it found, typed by the kind


@cache
def kinds() -> tuple[str, ...]:
    """The names of all kinds, sorted."""
    return tuple(sorted(file.parent.name for file in _ROOM.glob("*/study.py")))


def part_of_kind(name: str, part: str) -> Any:
    """The module `part` of a kind's folder; None where it has none."""
    module = ".".join(("pendbench", _ROOM.name, name, part))
    return import_module(module) if name in kinds() and find_spec(module) else None


def kind(name: str) -> Kind:
    """What a kind studies and how."""
    return cast(Kind, part_of_kind(name, "study"))
