"""What a study found: tables for people and programs. The report knows this and nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pandas as pd


@dataclass(frozen=True)
class Results:
    """title, name, kind: of the study. cases: one row per case, in the columns of `report.columns`.

    tables: other tables by name (`scenes`, `causes`, `starts`, `curves`, ...). provenance: what the numbers come from.
    quick: whether it was the quick variant.
    """

    name: str
    title: str
    kind: str
    cases: pd.DataFrame
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    quick: bool = False
