"""The command line: ``python -m pendbench.study NAME-or-FILE``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pendbench.errors import InputError

if TYPE_CHECKING:
    from pendbench.study.api import Finished, Request

OK, REGRESSION, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> None:  # type: ignore[override]
        raise InputError(message)


def parser() -> argparse.ArgumentParser:
    """The options of the command line."""
    options = _Parser(
        prog="python -m pendbench.study",
        description="Run a study of physics engines against the analytic reference, and write its report.",
        epilog="Exit code: 0 the study ran, whatever the engines did; 1 --check found a regression; 2 bad input.",
    )
    options.add_argument("study", nargs="?", metavar="NAME-or-FILE", help="a bundled study, or a path to a .toml file")
    options.add_argument("--list", action="store_true", help="list the bundled studies and leave")
    options.add_argument("--out", type=Path, metavar="DIR", help="folder for the report (default: results/NAME)")
    options.add_argument("--quick", action="store_true", help="the study's small variant: seconds instead of minutes")
    options.add_argument("--engines", metavar="A,B", default="", help="only these of the study's engines")
    options.add_argument("--jobs", type=int, metavar="N", help="worker processes (default: one per processor)")
    options.add_argument("--check", action="store_true", help="fail where a result got worse than the study's baseline")
    options.add_argument("--fresh", action="store_true", help="run again what is already in the folder")
    options.add_argument("--update-baseline", action="store_true", help="make these results the study's baseline")
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    try:
        chosen = parser().parse_args(arguments)
        if chosen.list:
            return _list()
        if chosen.study is None:
            raise InputError("which study? a bundled name (--list shows them) or a path to a .toml file")
        return _run(_request(chosen))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("\nstopped; what was finished is kept: run the same line again to go on", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        print(f"error: {error}; what was finished is kept", file=sys.stderr)
        return BAD_INPUT


def _list() -> int:
    import tomllib

    from pendbench.bundled import bundled, bundled_names

    for name in bundled_names("studies"):
        with open(bundled("studies") / f"{name}.toml", "rb") as file:
            print(f"{name:12} {tomllib.load(file)['title']}")
    return OK


def _request(chosen: argparse.Namespace) -> Request:
    from pendbench.study.api import Request

    return Request(
        study=chosen.study,
        out=chosen.out,
        quick=chosen.quick,
        engines=tuple(name.strip() for name in chosen.engines.split(",") if name.strip()),
        jobs=chosen.jobs,
        check=chosen.check,
        fresh=chosen.fresh,
        update_baseline=chosen.update_baseline,
    )


def _run(request: Request) -> int:
    from pendbench.study.api import run_request
    from pendbench.study.progress import Progress

    with Progress() as progress:
        finished = run_request(request, progress)
    return _tell(finished)


def _tell(finished: Finished) -> int:
    from rich.console import Console

    from pendbench.report import answer, summary_table

    console = Console()
    console.print(summary_table(finished.results))
    console.print(answer(finished.results), markup=False)
    console.print(f"Report: {finished.out / 'report.md'}", markup=False)
    for line in finished.regressions:
        print(f"regression: {line}", file=sys.stderr)
    return REGRESSION if finished.regressions else OK


if __name__ == "__main__":
    sys.exit(main())
