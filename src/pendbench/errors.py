"""What a user did wrong, said in one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """Input that cannot be used. The message is one line: where, what was found, what is allowed."""


class MissingEngineError(InputError):
    """An engine that is known but cannot be loaded. The message holds the command that installs it."""


def choose(kind: str, found: object, allowed: Iterable[str]) -> str:
    """Say that `found` is not one of `allowed`, with the nearest of them: ``unknown engine 'mujco'; ...``."""
    names = sorted(allowed)
    near = difflib.get_close_matches(str(found), names, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"unknown {kind} {str(found)[:80]!r}; {hint}allowed: {', '.join(names) or 'none'}"
