"""Which optional engines cannot be had, and why."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Final

from pendbench.base.errors import InputError, MissingEngineError, printable
from pendbench.base.processes import processors
from pendbench.engines.fingerprint import installed
from pendbench.engines.registry import comes_along, engine, is_foreign, python_of

_HANGS_S: Final = 300.0
_TOLD: Final = 3  # the exit code of a process that says why there is no such engine
_LOAD: Final = f"""\
import sys
from pendbench.base.errors import InputError
from pendbench.engines.registry import engine
try:
    engine(sys.argv[1]).version()
except InputError as error:
    print(error)
    sys.stdout.flush()
    sys.exit({_TOLD})
"""


def why_absent(names: Iterable[str], *, apart: bool) -> dict[str, str]:
    """Of these engines those that cannot be loaded, each with the reason, sorted. An unknown name is none of them.

    apart: each is first loaded in a process of its own, to its end: an engine that crashes there, hangs or ends the
    process is absent, too. What it prints is nobody's business.
    """
    asked = sorted(set(names))
    suspects = [name for name in asked if apart and not comes_along(name)]
    with ThreadPoolExecutor(max(1, min(len(suspects), processors()))) as threads:
        found = dict(zip(suspects, threads.map(_why_apart, suspects), strict=True))
    reasons = ((name, found.get(name) or _why(name)) for name in asked)
    return {name: why for name, why in reasons if why}


def _why(name: str) -> str:
    """Why an engine cannot be loaded here; of an unknown name that is said where it is read."""
    try:
        engine(name)
    except MissingEngineError as error:
        return str(error)
    except InputError:
        pass
    return ""


def _why_apart(name: str) -> str:
    """The same, as a process says that loads it. What can change under this one's feet is asked each time."""
    return _ask(name) if is_foreign(name) or python_of(name) else _ask_once(name, installed())


@cache
def _ask_once(name: str, installed: tuple[tuple[str, int], ...]) -> str:
    """The answer for what is installed now: the processes take seconds, and a study may be read many times."""
    del installed
    return _ask(name)


def _ask(name: str) -> str:
    command = [sys.executable, "-c", _LOAD, name]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    try:
        ended = subprocess.run(command, capture_output=True, timeout=_HANGS_S, env=environment, check=False)
    except subprocess.TimeoutExpired:
        return f"engine {name!r} hangs while it is loaded: {_HANGS_S:g} s"
    if ended.returncode == 0:
        return ""
    if ended.returncode == _TOLD:
        return printable(ended.stdout.decode(errors="replace").strip().splitlines()[-1])
    return f"engine {name!r} ends the process that loads it, {_ending(ended.returncode)}"


def _ending(code: int) -> str:
    if code >= 0 or -code not in signal.valid_signals():
        return f"with exit code {code}"
    return f"of {signal.Signals(-code).name}"
