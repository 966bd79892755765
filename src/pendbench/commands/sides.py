"""What `pendbench compare` is given: folders of results, or the JSON of gates."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendbench.base.errors import InputError, describe
from pendbench.base.strict import input_error, read_regular, show, shown_path
from pendbench.commands.gate_record import Gate, read_gate

if TYPE_CHECKING:
    import pandas as pd

_CASES: Final = "cases.csv"
_LARGEST: Final = 1 << 28  # bytes
_ALLOWED: Final = "a study's results, a folder of several of them (repeated runs), or the JSON of a gate"


@dataclass(frozen=True)
class Results:
    """A study's results, or those of repeated runs of it. provenance: where the first are from."""

    where: str
    tables: tuple[pd.DataFrame, ...]
    provenance: Mapping[str, Any]

    @cached_property
    def kind(self) -> str:
        """The kind of study. Results of earlier versions do not say it: the one whose columns are most like theirs."""
        return str(self.provenance.get("kind") or _kind_of(self.tables[0]))

    def alike(self, other: Results) -> bool:
        """Whether both are of one kind; a study of one name is where it is not said."""
        if all(side.provenance.get("kind") for side in (self, other)) or "study" not in self.provenance:
            return self.kind == other.kind
        return self.provenance["study"] == other.provenance.get("study") or self.kind == other.kind

    def differs(self, other: Results, name: str) -> bool:
        """Whether both say where they are from, and it is not the same."""
        found = self.provenance.get(name), other.provenance.get(name)
        return None not in found and found[0] != found[1]


def read_side(path: str | os.PathLike[str]) -> Results | Gate:
    """What is there. Raises InputError, one line, for what cannot be compared."""
    try:
        place = Path(path)
        there = bool(os.fspath(path)) and place.exists()
    except (TypeError, ValueError):
        raise InputError(f"{show(path)} is no path; allowed: {_ALLOWED}") from None
    if not there:
        raise input_error(shown_path(path), f"there is nothing; allowed: {_ALLOWED}")
    if not place.is_dir():
        if place.suffix == ".csv":
            raise input_error(shown_path(path), "one table; allowed: the folder that it is in")
        if not place.is_file():
            raise input_error(shown_path(path), f"not a regular file; allowed: {_ALLOWED}")
        return read_gate(place)
    found = [place] if (place / _CASES).exists() else sorted(file.parent for file in place.glob(f"*/{_CASES}"))
    if not found:
        raise input_error(shown_path(path), f"no {_CASES} in there; allowed: {_ALLOWED}")
    runs = [_results(folder) for folder in found]
    first = runs[0]
    for each in runs[1:]:
        if not first.alike(each) or any(first.differs(each, name) for name in ("study", "study content")):
            raise input_error(shown_path(path), f"{each.where} and {first.where} are not runs of one study")
    return Results(shown_path(path), tuple(each.tables[0] for each in runs), first.provenance)


def _results(folder: Path) -> Results:
    from pendbench.study.case_table import read_cases
    from pendbench.study.changes import DIVERGES, REPRODUCED, TIMES
    from pendbench.study.spreads import SAYING

    file = folder / _CASES
    numbers = [*(measure.name for measure in (*REPRODUCED, *TIMES, DIVERGES)), *SAYING, "order_claimed"]
    try:
        table = read_cases(file, numbers)
    except (OSError, ValueError) as error:
        raise input_error(shown_path(file), f"not a study's cases: {describe(error)}") from None
    if table.empty:
        raise input_error(shown_path(file), "has no rows; allowed: a study's cases")
    provenance = _provenance(folder / "provenance.json")
    return Results(shown_path(folder), (table,), provenance)


def _provenance(path: Path) -> Mapping[str, Any]:
    """Where results are from; nothing where that was not kept."""
    if not path.exists():
        return {}
    try:
        found = json.loads(read_regular(path, shown_path(path), _LARGEST))
    except InputError:
        raise
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise input_error(shown_path(path), "not a study's provenance; allowed: what the study wrote")
    return found


def _kind_of(table: pd.DataFrame) -> str:
    """The kind of study whose columns are most like these."""
    from pendbench.study.kinds import kinds, part_of_kind

    own = set(table)

    def likeness(kind: str) -> float:
        its = {column.name for column in part_of_kind(kind, "columns").COLUMNS["cases"]}
        return len(own & its) / len(own | its)

    return max(kinds(), key=likeness)
