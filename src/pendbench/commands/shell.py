"""What all commands share at the command line: one line for what is wrong, exit codes, and what they print."""

from __future__ import annotations

import argparse
import atexit
import io
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NoReturn

from pendbench.base.errors import InputError, choose, printable

_KEPT: Final = "what was finished is kept"
OK, REGRESSION, BAD_INPUT, INTERRUPTED, TERMINATED = 0, 1, 2, 130, 143
_TYPES: Final = {"int": "a whole number", "float": "a number"}
_ILL_TYPED: Final = re.compile(r"argument (\S+): invalid (int|float) value: (.*)", re.DOTALL)  # argparse's own words
WIDTH: Final = 160  # of tables in a log, where nothing says how wide it is


class Parser(argparse.ArgumentParser):
    """Options that are written in full. What is wrong with them is an `InputError`."""

    def __init__(self, **settings: object) -> None:
        super().__init__(**{"allow_abbrev": False, **settings})  # type: ignore[arg-type]

    def error(self, message: str) -> NoReturn:
        raise InputError(_ILL_TYPED.sub(lambda its: f"{its[1]} is {its[3]}; allowed: {_TYPES[its[2]]}", message))


def chosen(options: argparse.ArgumentParser, arguments: Sequence[str]) -> argparse.Namespace:
    """What was chosen of the options. Raises `InputError` for an option there is not, and for one argument too many."""
    found, rest = options.parse_known_args(list(arguments))
    if rest and rest[0].startswith("-"):
        raise InputError(choose("option", rest[0], options._option_string_actions))
    if rest:
        last = [action.dest for action in options._actions if not action.option_strings][-1]
        raise InputError(f"{rest[0]!r} after {getattr(found, last)!r}; allowed: one {last}")
    return found


def exit_code(work: Callable[[], int], keeps: Callable[[], bool] = lambda: True) -> int:
    """Do the work of a command, which keeps what was finished or not. What goes wrong is one line on standard error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal that knows few letters shows others as escapes
            stream.reconfigure(errors="backslashreplace")
    try:
        return work()
    except InputError as error:
        return _refuse(str(error))
    except KeyboardInterrupt:
        kept = f"{_KEPT}: run the same line again to go on" if keeps() else "the same line begins anew"
        print(f"\nstopped; {kept}", file=sys.stderr)
        return INTERRUPTED
    except MemoryError:
        return _refuse(f"not enough memory{f'; {_KEPT}' if keeps() else ''}")
    except OSError as error:
        return _refuse(f"{error}{f'; {_KEPT}' if keeps() else ''}")


def _refuse(message: str) -> int:
    print(f"error: {printable(message)}", file=sys.stderr)
    return BAD_INPUT


def say(*lines: str) -> None:
    """Print to whoever listens: a reader that has left (`| head`) is no error."""
    try:
        print(*lines, sep="\n", flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or the interpreter complains at its end


def names(option: str, text: str | None, what: str) -> tuple[str, ...]:
    """The names in an option's value, which are separated by commas; none where it was not given."""
    found = tuple(name.strip() for name in (text or "").split(",") if name.strip())
    if text is not None and not found:
        raise InputError(f"{option} is {text!r}; allowed: {what}, separated by commas")
    return found


def output_files(given: Mapping[str, str | None], source: str = "") -> dict[str, Path]:
    """Where the files go that were asked for, by option. source: what is read, which none may replace.

    Raises `InputError` before any work is done.
    """
    from pendbench.base.files import file_path

    found = {option: file_path(out, f"--{option}") for option, out in given.items() if out is not None}
    taken = {Path(source).absolute(): "what is read"} if source else {}
    for option, path in found.items():
        if (its := path.absolute()) in taken and (path.is_file() or not path.exists()):
            raise InputError(f"--{option} {path}: is {taken[its]}; allowed: a file of its own")
        taken[its] = f"--{option}, too"
    return found


def number(name: str, value: object, allowed: tuple[float, float, str]) -> float:
    """The value of an option or an argument. allowed: from, to, and the unit."""
    from pendbench.base.ranges import Range  # loads numpy, which no help needs
    from pendbench.base.strict import show

    try:
        return Range(*allowed).read(value)
    except ValueError as problem:
        raise InputError(f"{name} is {show(value)}; allowed: {problem}") from None


def leave(code: int) -> NoReturn:
    """End the process with this exit code.

    An interrupted one at once: to take apart all that was loaded costs a quarter of a second of the processor, and on a
    busy machine that is two by the clock.
    """
    if code == INTERRUPTED:
        atexit._run_exitfuncs()
        with suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def terminate(*_: object) -> None:
    """End as one ends who is asked to: what a signal calls."""
    sys.exit(TERMINATED)  # an exception, so that the workers are stopped before
