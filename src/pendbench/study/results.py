"""What a study found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

Found = TypeVar("Found")


@dataclass(frozen=True)
class Results(Generic[Found]):
    """title, name, kind: of the study. found: what its kind measured, typed by the kind. options: the study's keys,
    checked. provenance: what the numbers come from. quick: whether it was the quick variant. kept: how many of how many
    results were there from an earlier run. unused: how many others the folder had, where none of them could be used.
    """

    name: str
    title: str
    kind: str
    found: Found
    options: Any = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    quick: bool = False
    kept: tuple[int, int] = (0, 0)
    unused: int = 0
