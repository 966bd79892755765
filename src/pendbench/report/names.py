"""Cases and rows as people name, pick and sort them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol, TypeVar

from pendbench.report.numbers import number_text
from pendbench.study.case import Case

Key = TypeVar("Key")


class Ended(Protocol):
    """A row that says how it ended."""

    @property
    def status(self) -> str: ...

    @property
    def reason(self) -> str: ...


class OfRun:
    """A row that ended as its `run` did."""

    run: Ended

    @property
    def status(self) -> str:
        """How the run ended."""
        return self.run.status

    @property
    def reason(self) -> str:
        """Why it did not end well."""
        return self.run.reason


class OfTruth:
    """A row of a scene: it ended as the scene's `truth` did."""

    truth: Ended

    @property
    def status(self) -> str:
        """How the truth ended."""
        return self.truth.status

    @property
    def reason(self) -> str:
        """Why it ended early."""
        return self.truth.reason


class OfCase(Protocol):
    """A row of a case."""

    @property
    def case(self) -> Case: ...


class CaseRow(Ended, OfCase, Protocol):
    """A row of a case that says how it ended."""


R = TypeVar("R")
C = TypeVar("C", bound=OfCase)


def distinct(rows: Iterable[R], of: Callable[[R], Key]) -> list[Key]:
    """What the rows have, each once, in the order in which it first appears."""
    return list(dict.fromkeys(map(of, rows)))


def grouped(rows: Iterable[R], of: Callable[[R], Key]) -> dict[Key, list[R]]:
    """The rows by what they have in common."""
    groups: dict[Key, list[R]] = {}
    for row in rows:
        groups.setdefault(of(row), []).append(row)
    return groups


def finite(values: Iterable[float | None]) -> list[float]:
    """The finite ones of some numbers."""
    return [value for value in values if value is not None and math.isfinite(value)]


def is_ok(row: Ended) -> bool:
    """Whether a row ended well."""
    return row.status == "ok"


def scene_of(row: OfCase) -> str:
    """The name of the row's scene."""
    return row.case.scene.name


def engine_of(row: OfCase) -> str:
    """The name of the row's engine."""
    return row.case.engine


def method_name(case: Case) -> str:
    """A method with its settings: ``tuned iterations=50``."""
    return " ".join(part for part in (case.method, case.settings_text) if part)


def pair_name(case: Case) -> str:
    """An engine and its method: ``mujoco rk4``."""
    return f"{case.engine} {method_name(case)}"


def pair_of(row: OfCase) -> str:
    """The engine and method of a row."""
    return pair_name(row.case)


def case_name(case: Case, *, with_scene: bool = True) -> str:
    """A case in a sentence: ``double: mujoco rk4, step 0.001 s``."""
    name = pair_name(case) + ("" if case.dt is None else f", step {number_text(case.dt)} s")
    return f"{case.scene.name}: {name}" if with_scene else name


def in_one_scene(cases: Iterable[Case]) -> list[Case]:
    """Those of the scene that has most of them; of several such scenes the first."""
    groups = grouped(cases, lambda case: case.scene.name)
    return max(groups.values(), key=len, default=[])


def in_order(rows: Iterable[C]) -> list[C]:
    """Rows by engine, method, settings and step, the coarsest step first."""

    def place(row: C) -> tuple[str, str, str, float]:
        case = row.case
        return case.engine, case.method, case.settings_text, -math.inf if case.dt is None else -case.dt

    return sorted(rows, key=place)


def finest(rows: Iterable[C]) -> list[C]:
    """Of each scene, engine, method and settings, the row with the finest step."""
    groups = grouped(rows, lambda row: (row.case.scene.name, pair_name(row.case)))
    return [min(own, key=lambda row: row.case.dt or 0.0) for own in groups.values()]


def spanned(values: Sequence[float], shown: Callable[[Any], str]) -> str:
    """``2.1 to 3.4`` of some numbers, or one number where they read the same."""
    low, high = shown(min(values)), shown(max(values))
    return low if low == high else f"{low} to {high}"
