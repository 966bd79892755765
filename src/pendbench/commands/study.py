"""`pendbench study`: run a study of physics engines against the analytic reference, and write its report.

``python -m pendbench.study NAME-or-FILE`` is the same.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pendbench.base.errors import InputError
from pendbench.commands.completing import scene_names, study_names
from pendbench.commands.shell import OK, REGRESSION, WIDTH, Parser, chosen, exit_code, names, say

if TYPE_CHECKING:
    from pendbench.commands.run import Finished, Request


def add_options(options: argparse.ArgumentParser) -> None:
    """What the command takes."""
    options.epilog = "Exit code: 0 the study ran, whatever the engines did; 1 --check found a regression; 2 bad input."
    study = options.add_argument("study", nargs="?", metavar="NAME-or-FILE", help="a bundled study, or a .toml file")
    study.completer = study_names  # type: ignore[attr-defined]
    options.add_argument("--list", action="store_true", help="list the bundled studies and leave")
    options.add_argument("--out", metavar="DIR", help="folder for the report (default: results/NAME)")
    options.add_argument("--quick", action="store_true", help="the study's small variant: seconds instead of minutes")
    options.add_argument("--engines", metavar="A,B", help="only these of the study's engines")
    scenes = options.add_argument("--scenes", metavar="A,B.toml", help="these scenes in place of the study's")
    scenes.completer = scene_names  # type: ignore[attr-defined]
    options.add_argument("--jobs", type=int, metavar="N", help="worker processes (default: one per processor)")
    options.add_argument("--cluster", metavar="ADDRESS", help="run on this Dask cluster; `local` starts one here")
    options.add_argument("--bare", action="store_true", help="write tables only: no report, no plots")
    options.add_argument(
        "--python", metavar="ENGINE=PATH", action="append", default=[], help="run an engine with this other Python"
    )
    options.add_argument("--check", action="store_true", help="fail where a result got worse than the study's baseline")
    options.add_argument("--fresh", action="store_true", help="run again what is already in the folder")
    options.add_argument("--update-baseline", action="store_true", help="make these results the study's baseline")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``python -m pendbench.study`` and return its exit code."""
    options = Parser(
        prog="python -m pendbench.study",
        description="Run a study of physics engines against the analytic reference, and write its report.",
    )
    add_options(options)
    given = sys.argv[1:] if arguments is None else arguments
    return exit_code(lambda: run(chosen(options, given)))


def run(chosen: argparse.Namespace) -> int:
    """Do what was chosen, and return the exit code."""
    if chosen.list:
        return _list()
    if chosen.study is None:
        raise InputError("which study? a bundled name (--list shows them) or a path to a .toml file")
    return _study(_request(chosen))


def _list() -> int:
    from pendbench.base.bundled import bundled, bundled_names
    from pendbench.base.strict import read_toml

    known = bundled_names("studies")
    width = max(map(len, known), default=0)
    say(*(f"{name:{width}}  {read_toml(bundled('studies') / f'{name}.toml')['title']}" for name in known))
    return OK


def _request(chosen: argparse.Namespace) -> Request:
    from pendbench.commands.run import Request

    if chosen.out == "":
        raise InputError("--out is empty; allowed: a folder")
    return Request(
        study=chosen.study,
        out=None if chosen.out is None else Path(chosen.out),
        quick=chosen.quick,
        engines=names("--engines", chosen.engines, "names of engines"),
        scenes=names("--scenes", chosen.scenes, "names of scenes and files"),
        jobs=chosen.jobs,
        check=chosen.check,
        fresh=chosen.fresh,
        update_baseline=chosen.update_baseline,
        cluster=chosen.cluster,
        bare=chosen.bare,
        pythons=tuple(chosen.python),
    )


def _study(request: Request) -> int:
    from pendbench.commands.progress import StageBars
    from pendbench.commands.run import run_request

    with StageBars() as bars:
        finished = run_request(request, bars)
    return _tell(finished, request.bare)


def _tell(finished: Finished, bare: bool) -> int:
    from rich.console import Console

    from pendbench.report.terminal import summary_table

    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    with console.capture() as shown:
        console.print(summary_table(finished.report))
        console.print(finished.report.answer, markup=False)
    written = f"Tables: {finished.out}" if bare else f"Report: {finished.out / 'report.md'}"
    report = f"{shown.get()}{written}"
    say(*finished.notes, report, *_checked(finished), *_unused(finished))
    for line in finished.regressions:
        print(f"regression: {line}", file=sys.stderr)
    return REGRESSION if finished.regressions else OK


def _checked(finished: Finished) -> Iterator[str]:
    """What was compared with the baseline, and how much of it is older than this run."""
    if finished.compared is not None:
        worse, (kept, total) = len(finished.regressions), finished.report.results.kept
        found = f"{worse} regression{'' if worse == 1 else 's'}" if worse else "no regressions"
        against = f"{finished.compared} rows against the baseline, {found}"
        yield f"Checked: {against}; {kept} of {total} results are from before"


def _unused(finished: Finished) -> Iterator[str]:
    """That what an earlier run left is not what this one asks for."""
    if unused := finished.report.results.unused:
        why = "of another study, or of another version of pendbench, an engine, a library or the machine"
        yield f"Not used: {unused} results in {finished.out / 'work'}, {why}; --fresh removes them"
