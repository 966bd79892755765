"""`pendbench gate`: whether an engine may pass, by numbers, for its CI."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from pendbench.base.errors import InputError
from pendbench.commands.shell import OK, REGRESSION, names, number, output_files, say

if TYPE_CHECKING:
    from pendbench.commands.gate_record import Gate

#: What --time-limit may be.
LIMIT: Final = (1.0, 1e6, "s")
_FILES: Final = ("json", "junit", "badge")


def add_options(options: argparse.ArgumentParser) -> None:
    """What the command takes."""
    options.add_argument("engine", metavar="ENGINE", help="an engine's name, or module:Class")
    options.add_argument("--methods", metavar="A,B", help="only these methods (default: all)")
    options.add_argument("--json", metavar="F", help="write the findings as JSON")
    options.add_argument("--junit", metavar="F", help="write them as a JUnit report")
    options.add_argument("--badge", metavar="F", help="write a badge, SVG")
    options.add_argument("--seed", type=int, default=0, metavar="N", help="of the random states (0)")
    options.add_argument("--jobs", type=int, metavar="N", help="worker processes (default: one per processor)")
    options.add_argument("--time-limit", type=float, default=30.0, metavar="S", help="s of processor time a check (30)")


def run(chosen: argparse.Namespace) -> int:
    """Do what was chosen, and return the exit code."""
    from pendbench.base.processes import processors
    from pendbench.commands.gating import run_gate
    from pendbench.commands.progress import StageBars
    from pendbench.engines.gating.gate import Asked

    output_files({kind: getattr(chosen, kind) for kind in _FILES})
    workers = processors() if chosen.jobs is None else chosen.jobs
    if not 1 <= workers <= 64:
        raise InputError(f"--jobs is {workers}; allowed: 1 to 64")
    if chosen.seed < 0:
        raise InputError(f"--seed is {chosen.seed}; allowed: a whole number from 0 on")
    methods = names("--methods", chosen.methods, "names of methods")
    limit = number("--time-limit", chosen.time_limit, LIMIT)
    with StageBars() as bars:
        found = run_gate(Asked(chosen.engine, methods, chosen.seed, workers, limit), bars)
    tell(found, {kind: getattr(chosen, kind) for kind in _FILES})
    return OK if found.passed else REGRESSION


def tell(found: Gate, files: dict[str, str | None]) -> None:
    """Print what was found, write the files that were asked for, and tell the CI that this runs in."""
    from pendbench.commands.gate_formats import annotation_lines, one_line, summary_text

    for kind, path in files.items():
        if path is not None:
            getattr(found, f"to_{kind}")(path)
    say(*found.failures, one_line(found), *_written(list(files.values())))
    if os.environ.get("GITHUB_ACTIONS") == "true":
        say(*annotation_lines(found))
    if summary := os.environ.get("GITHUB_STEP_SUMMARY"):
        with open(summary, "a", encoding="utf-8") as file:
            file.write(summary_text(found))


def _written(paths: Sequence[str | None]) -> list[str]:
    return [f"Written: {path}" for path in paths if path is not None]
