"""What a user did wrong, said in one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """Input that cannot be used. The message is one line: where, what was found, what is allowed.

    >>> import pendbench as pb
    >>> try:
    ...     pb.simulate("double", method="rk5", dt=0.01)
    ... except pb.InputError as error:
    ...     print(str(error)[:64])
    engine 'analytic': unknown method 'rk5'; did you mean 'rk4'? all
    """


class MissingEngineError(InputError):
    """An engine that is known but cannot be loaded. The message holds the command that installs it."""


def choose(kind: str, found: object, allowed: Iterable[str]) -> str:
    """Say that `found` is not one of `allowed`, with the nearest of them: ``unknown engine 'mujco'; ...``."""
    names = sorted(allowed)
    near = difflib.get_close_matches(str(found), names, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"unknown {kind} {str(found)[:80]!r}; {hint}allowed: {', '.join(names) or 'none'}"


def printable(text: str) -> str:
    """The text on one line: control characters, line ends and lone surrogates are written as escapes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def describe(error: BaseException) -> str:
    """An exception in one line: its type, and the first line of its message."""
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {printable(lines[0][:200])}" if lines else type(error).__name__
