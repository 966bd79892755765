"""Engines of another environment: each runs in a process of that environment's Python, which has pendbench as well.

An engine may want another version of a package than the others do. `use` is told which Python has it; from then on
`registry.engine` gives a stand-in of the same methods and effects, here and in worker processes, whose runs take place
there. Each call is one message there and one back, some tens of microseconds; the other process ends with this one.
"""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import IO, Any, Final, cast

from pendbench import __version__
from pendbench.base.errors import InputError, MissingEngineError, printable
from pendbench.base.faults import Fault
from pendbench.base.source import source_digest
from pendbench.base.strict import show
from pendbench.engines.protocol import AdaptiveSimulation, Mapped, Method, Simulation, State
from pendbench.engines.registry import PYTHONS
from pendbench.scene.scene import Scene

_CHILD: Final = "pendbench.engines.elsewhere_child"
_ASKS: Final = (
    "import pendbench, sys; from pendbench.base.source import source_digest as d; print(d(), pendbench.__file__)"
)
_PATIENCE_S: Final = 120.0


def use(asked: Sequence[str], known: Sequence[str]) -> None:
    """Have engines run elsewhere; each is asked for as ``ENGINE=PATH``, PATH a Python.

    Raises `InputError`, one line, for what is none: an unknown engine, a path that is no Python, one without pendbench
    or with another version of it.
    """
    found: dict[str, str] = {}
    for each in asked:
        name, equals, path = each.partition("=")
        if not equals or not path or name not in known:
            allowed = f"ENGINE=PATH, ENGINE one of {', '.join(known)}"
            raise InputError(f"--python is {show(each)}; allowed: {allowed}")
        _check(name, path)
        found[name] = os.path.abspath(path)
    os.environ[PYTHONS] = json.dumps(found)


def _check(name: str, path: str) -> None:
    at = f"--python {name}={printable(path)[:200]}"
    if not os.path.isfile(path) or not os.access(path, os.X_OK):
        raise InputError(f"{at}: no such program; allowed: the Python of an environment with pendbench and {name}")
    try:
        said = subprocess.run([path, "-c", _ASKS], capture_output=True, timeout=_PATIENCE_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        raise InputError(f"{at}: not a Python; allowed: that of an environment with pendbench and {name}") from None
    told = said.stdout.decode(errors="replace").split()
    if b"No module named 'pendbench'" in said.stderr:
        raise InputError(f"{at}: it has no pendbench; allowed: one with pendbench {__version__}")
    if said.returncode != 0 or not told:
        raise InputError(f"{at}: not a Python with pendbench; allowed: one with pendbench {__version__}")
    if told[0] != source_digest():
        raise InputError(f"{at}: it has another pendbench than this one; install this one there, {__version__}")


@cache
def stand_in(name: str, path: str) -> Elsewhere:
    """The engine of that name, of another Python. Raises `MissingEngineError` where it is not there."""
    return Elsewhere(name, _Process(name, path))


class _Process:
    """The other process: started when it is first asked, and again where it has died."""

    def __init__(self, name: str, path: str) -> None:
        self._name, self._path = name, path
        self._child: Any = None

    def ask(self, verb: str, *arguments: Any) -> Any:
        """What it answers. Raises `MissingEngineError` for an engine that is not there, and what engines raise."""
        if self._child is None or self._child.poll() is not None:
            self.close()
            own = {key: value for key, value in os.environ.items() if key != PYTHONS}
            command = [self._path, "-m", _CHILD, self._name, str(os.getpid())]
            self._child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=own)
            self._end = weakref.finalize(self, _end, self._child)
        try:
            pickle.dump((verb, arguments, _time_left()), self._child.stdin)
            self._child.stdin.flush()
            kind, value, used = pickle.load(self._child.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise RuntimeError(self._ending()) from None
        _charge(used)
        if kind == "missing":
            raise MissingEngineError(f"engine {self._name!r} of {self._path}: {value}")
        if kind == "error":
            raise RuntimeError(value)
        return value

    def forget(self, number: int) -> None:
        """Let it drop a run; one that has ended has none, and is not started for that."""
        if self._child is not None and self._child.poll() is None:
            self.ask("drop", number)

    def close(self) -> None:
        """End the other process."""
        if self._child is not None:
            self._end()
            self._child = None

    def _ending(self) -> str:
        code = self._child.wait()
        self.close()
        if hasattr(signal, "SIGPROF") and code == -signal.SIGPROF:
            signal.raise_signal(signal.SIGPROF)  # the job has used up its time
        return f"the process of engine {self._name!r} ended with {code}"


def _end(child: subprocess.Popen[bytes]) -> None:
    """End a process that has nothing to lose."""
    child.kill()
    child.wait()
    for stream in (child.stdin, child.stdout):
        with suppress(OSError):  # what was not sent is of no use any more
            cast(IO[bytes], stream).close()


def _time_left() -> float:
    """How much processor time the job has left, s; 0 where it has no limit."""
    return signal.getitimer(signal.ITIMER_PROF)[0] if hasattr(signal, "getitimer") else 0.0


def _charge(seconds: float) -> None:
    """Take what the other process has used from the job's processor time."""
    if left := _time_left():
        signal.setitimer(signal.ITIMER_PROF, max(1e-6, left - seconds))


class _Run:
    """A run in the other process."""

    def __init__(self, process: _Process, number: int) -> None:
        self._process, self._number = process, number

    def __del__(self) -> None:
        try:
            self._process.forget(self._number)
        except Exception:  # it is gone, and so is the run
            return

    def state(self) -> State:
        return cast(State, self._process.ask("state", self._number))

    def health(self) -> Fault | None:
        return cast("Fault | None", self._process.ask("health", self._number))


class _Fixed(_Run):
    def advance(self, steps: int) -> None:
        self._process.ask("advance", self._number, steps)


class _Adaptive(_Run):
    def advance_to(self, time: float) -> int:
        return cast(int, self._process.ask("advance_to", self._number, time))


class Elsewhere:
    """An engine of another Python."""

    def __init__(self, name: str, process: _Process) -> None:
        self.name, self._process = name, process
        about = process.ask("describe")
        self.methods: Mapping[str, Method] = about["methods"]
        self.effects: Mapping[str, Mapped] = about["effects"]
        self.fingerprint: str = about["fingerprint"]
        self._version: str = about["version"]

    def version(self) -> str:
        """The version there."""
        return self._version

    def refuses(self, scene: Scene) -> str | None:
        """What it says there."""
        return cast("str | None", self._process.ask("refuses", scene))

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation | AdaptiveSimulation:
        """A run there, at time 0."""
        number = self._process.ask("build", scene, method, dt, settings)
        return (_Adaptive if self.methods[method].adaptive else _Fixed)(self._process, number)
