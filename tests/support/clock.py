"""Which columns depend on the clock, and so differ from run to run."""

from __future__ import annotations

from pendbench.study.kinds import part_of_kind


def clocked(kind: str = "chaos", table: str = "cases") -> set[str]:
    """The names of these columns in a table of a kind of study."""
    return {column.name for column in part_of_kind(kind, "columns").COLUMNS[table] if column.is_time}
