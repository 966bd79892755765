"""The other side of `engines.elsewhere`: serves one engine of this environment to the process that started it.

``python -m pendbench.engines.elsewhere_child ENGINE PARENT`` reads messages from its input and answers on its output,
until its input or the process PARENT ends. Whatever the engine prints goes elsewhere.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
from typing import Any, BinaryIO

from pendbench.base.errors import InputError, describe
from pendbench.engines.fingerprint import fingerprint
from pendbench.engines.protocol import mapped_effects
from pendbench.engines.registry import engine
from pendbench.scene.scene import Scene


class Served:
    """An engine, and its runs by number."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._runs: dict[int, Any] = {}
        self._count = 0

    def describe(self) -> dict[str, Any]:
        """What is known of it without a scene."""
        its = engine(self._name)
        return {
            "methods": dict(its.methods),
            "effects": dict(mapped_effects(its)),
            "version": str(its.version()),
            "fingerprint": fingerprint(self._name),
        }

    def refuses(self, scene: Scene) -> str | None:
        """Why it refuses a scene."""
        return engine(self._name).refuses(scene)

    def build(self, scene: Scene, method: str, dt: float | None, settings: dict[str, float]) -> int:
        """The number of a new run."""
        self._count += 1
        self._runs[self._count] = engine(self._name).build(scene, method, dt, **settings)
        return self._count

    def drop(self, number: int) -> None:
        """Forget a run."""
        self._runs.pop(number, None)

    def of_run(self, verb: str, number: int, *arguments: Any) -> Any:
        """What a run answers."""
        return getattr(self._runs[number], verb)(*arguments)


def answer(served: Served, verb: str, arguments: tuple[Any, ...]) -> tuple[str, Any]:
    """How a question ended, and its answer or the reason in words."""
    try:
        if verb in ("describe", "refuses", "build", "drop"):
            return "ok", getattr(served, verb)(*arguments)
        return "ok", served.of_run(verb, *arguments)
    except InputError as error:
        return "missing", str(error)
    except BaseException as error:
        return "error", describe(error)


def _used() -> float:
    """The processor time that this process has used, s."""
    return sum(os.times()[:2])


def serve(name: str, asked: BinaryIO, told: BinaryIO) -> None:
    """Answer until nobody asks any more."""
    served = Served(name)
    while True:
        try:
            verb, arguments, limit = pickle.load(asked)
        except EOFError:
            return
        begun = _used()
        if limit:
            signal.setitimer(signal.ITIMER_PROF, limit)
        kind, value = answer(served, verb, arguments)
        if limit:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        pickle.dump((kind, value, _used() - begun), told)
        told.flush()


def _end_with(parent: int) -> None:
    """End when whoever started this process has ended, also in the middle of an answer that takes long."""
    waiting = threading.Event()
    while os.getppid() == parent:
        waiting.wait(1.0)
    os._exit(0)


def main() -> None:
    """Serve the engine that is named."""
    threading.Thread(target=_end_with, args=(int(sys.argv[2]),), daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever asks decides when it is over
    told = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    serve(sys.argv[1], sys.stdin.buffer, told)


if __name__ == "__main__":
    main()
