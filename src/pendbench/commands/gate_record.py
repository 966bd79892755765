"""What a gate found, as its users have it, and the JSON that it is kept in: docs/gate.md says what is in there."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from pendbench import __version__
from pendbench.base.errors import InputError
from pendbench.base.files import file_path, write_whole
from pendbench.base.strict import show, shown_path
from pendbench.engines.conformance.check import FAILED, PASSED, SKIPPED, Finding
from pendbench.engines.gating.gate import Gated

#: The name of the schema, and its version: a key that is added does not change it, one that goes or means another does.
SCHEMA: Final = "pendbench.gate"
SCHEMA_VERSION: Final = 1


@dataclass(frozen=True)
class Gate:
    """What a gate found. engine, version: of whom. precision: which it declares. checks: all findings, in order.

    seed: of the random states. isolated: whether each check ran in a process of its own. made_by: which pendbench.
    """

    engine: str
    version: str
    precision: str
    seed: int
    isolated: bool
    checks: tuple[Finding, ...] = field(repr=False)
    made_by: str = __version__

    @classmethod
    def of(cls, found: Gated) -> Gate:
        """The record of what was found."""
        its = found.engine
        return cls(its.name, its.version, its.precision, found.seed, found.isolated, found.findings)

    @property
    def passed(self) -> bool:
        """Whether no check failed or could not be run."""
        return all(each.good for each in self.checks)

    @property
    def failures(self) -> tuple[str, ...]:
        """What is wrong, a line each."""
        return tuple(each.line for each in self.checks if not each.good)

    def count(self, status: str) -> int:
        """How many findings have this status."""
        return sum(each.status == status for each in self.checks)

    def to_json(self, path: str | os.PathLike[str]) -> None:
        """Write it as JSON. Raises InputError where it cannot be written."""
        write_text(path, json_text(self))

    def to_junit(self, path: str | os.PathLike[str]) -> None:
        """Write it as a JUnit report. Raises InputError where it cannot be written."""
        from pendbench.commands.gate_formats import junit_text

        write_text(path, junit_text(self))

    def to_badge(self, path: str | os.PathLike[str]) -> None:
        """Write a badge, SVG. Raises InputError where it cannot be written."""
        from pendbench.commands.gate_formats import badge_text

        write_text(path, badge_text(self))

    def _repr_html_(self) -> str:
        from pendbench.commands.gate_formats import summary_html

        return summary_html(self)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a file whole. Raises InputError where it cannot be written."""
    file_path(path, "path")
    try:
        write_whole(Path(path), lambda file: file.write(text.encode("utf-8", "backslashreplace")))
    except OSError as error:
        raise InputError(f"{shown_path(Path(path))}: {error.strerror}; allowed: a file that can be written") from None


def json_text(gate: Gate) -> str:
    """The JSON of a gate: a number that there is not is null."""
    content = {
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "pendbench": gate.made_by,
        "engine": {"name": gate.engine, "version": gate.version, "precision": gate.precision},
        "passed": gate.passed,
        "seed": gate.seed,
        "isolated": gate.isolated,
        "checks": [_as_json(each) for each in gate.checks],
    }
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


_KEYS: Final = ("method", "check", "about", "status", "value", "limit", "unit", "limit_from", "cause")


def _as_json(found: Finding) -> dict[str, str | float | None]:
    values = {key: getattr(found, key) for key in _KEYS}
    return {key: None if isinstance(its, float) and not math.isfinite(its) else its for key, its in values.items()}


def read_gate(path: str | os.PathLike[str]) -> Gate:
    """A gate from its JSON. Raises InputError, one line, for a file that is none or of another version."""
    shown = shown_path(Path(path))
    try:
        content = json.loads(Path(path).read_text("utf-8"))
    except OSError as error:
        raise InputError(f"{shown}: {error.strerror}; allowed: the JSON of a gate") from None
    except ValueError:
        raise InputError(f"{shown}: is not JSON; allowed: the JSON of a gate") from None
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"{shown}: is not the JSON of a gate; allowed: what `pendbench gate --json` writes")
    if content.get("schema_version") != SCHEMA_VERSION:
        found = show(content.get("schema_version"))
        raise InputError(f"{shown}: schema_version is {found}; allowed: {SCHEMA_VERSION}")
    try:
        return _gate(content)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{shown}: {error} is missing or wrong; allowed: what `pendbench gate --json` writes"
        ) from None


def _gate(content: dict[str, Any]) -> Gate:
    its, checks = content["engine"], tuple(map(_finding, content["checks"]))
    about = its["name"], its["version"], its["precision"], content["seed"], content["isolated"]
    return Gate(*about, checks, content["pendbench"])


def _finding(content: dict[str, Any]) -> Finding:
    values = {key: content[key] for key in _KEYS}
    for key in ("value", "limit"):
        beyond = math.inf if key == "value" and content["status"] == FAILED else math.nan
        values[key] = beyond if values[key] is None else float(values[key])
    if values["status"] not in (PASSED, FAILED, SKIPPED, "error"):
        raise ValueError(f"status {show(values['status'])}")
    return Finding(**values)
