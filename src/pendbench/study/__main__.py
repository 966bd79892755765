"""The command line: ``python -m pendbench.study NAME-or-FILE``."""

from __future__ import annotations

import argparse
import io
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pendbench.errors import InputError, choose, printable

if TYPE_CHECKING:
    from pendbench.study.api import Finished, Request

_WIDTH = 160  # of tables in a log, where nothing says how wide it is
OK, REGRESSION, BAD_INPUT, INTERRUPTED, TERMINATED = 0, 1, 2, 130, 143


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> None:  # type: ignore[override]
        raise InputError(message)


def parser() -> argparse.ArgumentParser:
    """The options of the command line."""
    options = _Parser(
        allow_abbrev=False,
        prog="python -m pendbench.study",
        description="Run a study of physics engines against the analytic reference, and write its report.",
        epilog="Exit code: 0 the study ran, whatever the engines did; 1 --check found a regression; 2 bad input.",
    )
    options.add_argument("study", nargs="?", metavar="NAME-or-FILE", help="a bundled study, or a path to a .toml file")
    options.add_argument("--list", action="store_true", help="list the bundled studies and leave")
    options.add_argument("--out", metavar="DIR", help="folder for the report (default: results/NAME)")
    options.add_argument("--quick", action="store_true", help="the study's small variant: seconds instead of minutes")
    options.add_argument("--engines", metavar="A,B", help="only these of the study's engines")
    options.add_argument("--jobs", type=int, metavar="N", help="worker processes (default: one per processor)")
    options.add_argument("--cluster", metavar="ADDRESS", help="run on this Dask cluster; `local` starts one here")
    options.add_argument("--check", action="store_true", help="fail where a result got worse than the study's baseline")
    options.add_argument("--fresh", action="store_true", help="run again what is already in the folder")
    options.add_argument("--update-baseline", action="store_true", help="make these results the study's baseline")
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal that knows few letters shows others as escapes
            stream.reconfigure(errors="backslashreplace")
    try:
        return _run(_chosen(arguments))
    except InputError as error:
        return _refuse(str(error))
    except KeyboardInterrupt:
        print("\nstopped; what was finished is kept: run the same line again to go on", file=sys.stderr)
        return INTERRUPTED
    except MemoryError:
        return _refuse("not enough memory; what was finished is kept")
    except OSError as error:
        return _refuse(f"{error}; what was finished is kept")


def _chosen(arguments: Sequence[str] | None) -> argparse.Namespace:
    options = parser()
    chosen, rest = options.parse_known_args(arguments)
    if rest and rest[0].startswith("-"):
        known = [name for action in options._actions for name in action.option_strings]
        raise InputError(choose("option", rest[0], known))
    if rest:
        raise InputError(f"{rest[0]!r} after {chosen.study!r}; allowed: one study")
    return chosen


def _refuse(message: str) -> int:
    print(f"error: {printable(message)}", file=sys.stderr)
    return BAD_INPUT


def _run(chosen: argparse.Namespace) -> int:
    if chosen.list:
        return _list()
    if chosen.study is None:
        raise InputError("which study? a bundled name (--list shows them) or a path to a .toml file")
    return _study(_request(chosen))


def _list() -> int:
    from pendbench.bundled import bundled, bundled_names
    from pendbench.strict import read_toml

    names = bundled_names("studies")
    width = max(map(len, names), default=0)
    _print(*(f"{name:{width}}  {read_toml(bundled('studies') / f'{name}.toml')['title']}" for name in names))
    return OK


def _print(*lines: str) -> None:
    """Print to whoever listens: a reader that has left (`| head`) is no error."""
    try:
        print(*lines, sep="\n", flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or the interpreter complains at its end


def _request(chosen: argparse.Namespace) -> Request:
    from pendbench.study.api import Request

    if chosen.out == "":
        raise InputError("--out is empty; allowed: a folder")
    return Request(
        study=chosen.study,
        out=None if chosen.out is None else Path(chosen.out),
        quick=chosen.quick,
        engines=_names(chosen.engines),
        jobs=chosen.jobs,
        check=chosen.check,
        fresh=chosen.fresh,
        update_baseline=chosen.update_baseline,
        cluster=chosen.cluster,
    )


def _names(text: str | None) -> tuple[str, ...]:
    names = tuple(name.strip() for name in (text or "").split(",") if name.strip())
    if text is not None and not names:
        raise InputError(f"--engines is {text!r}; allowed: names of engines, separated by commas")
    return names


def _study(request: Request) -> int:
    from pendbench.study.api import run_request
    from pendbench.study.progress import Progress

    with Progress() as progress:
        finished = run_request(request, progress)
    return _tell(finished)


def _tell(finished: Finished) -> int:
    from rich.console import Console

    from pendbench.report import answer, summary_table

    console = Console(width=None if sys.stdout.isatty() else _WIDTH)
    with console.capture() as shown:
        console.print(summary_table(finished.results))
        console.print(answer(finished.results), markup=False)
    _print(f"{shown.get()}Report: {finished.out / 'report.md'}")
    for line in finished.regressions:
        print(f"regression: {line}", file=sys.stderr)
    return REGRESSION if finished.regressions else OK


def _terminate(*_: object) -> None:
    sys.exit(TERMINATED)  # an exception, so that the workers are stopped before


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, _terminate)
    sys.exit(main())
