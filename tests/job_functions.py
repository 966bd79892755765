"""What test_jobs.py has worker processes do."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

from pendbench.errors import InputError


def identity(value: object) -> object:
    return value


def process() -> tuple[int, int]:
    return os.getpid(), os.getppid()


def fail() -> None:
    raise ValueError("first line\nsecond line")


class AwkwardError(Exception):
    """Comes out of a pickle as no exception does: it wants two arguments."""

    def __init__(self, one: str, two: str) -> None:
        super().__init__(f"{one} {two}")


def fail_awkwardly() -> None:
    raise AwkwardError("one", "two")


def refuse() -> None:
    raise InputError("dt is 0; allowed: above 0")


def time_out_by_itself() -> None:
    raise TimeoutError("the other side did not answer")


def exhaust() -> None:
    raise MemoryError


def leave() -> None:
    sys.exit("done")


def kill_itself() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def leave_at_once() -> None:
    os._exit(7)


def sleep(seconds: float) -> str:
    time.sleep(seconds)
    return "woke"


def sleep_deaf(seconds: float) -> None:
    """As code that never returns to the interpreter does: no polite signal ends it."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    time.sleep(seconds)


def unpicklable() -> object:
    return lambda: None


def unpicklable_here() -> object:
    class Local:
        pass

    return Local()


def print_much() -> int:
    text = "x" * 1_000_000
    print(text)
    print(text, file=sys.stderr)
    return len(text)


def interrupt_group() -> str:
    """What Ctrl-C in a terminal does to a worker."""
    os.kill(os.getpid(), signal.SIGINT)
    return "went on"


def stay(folder: str, name: str) -> list[str]:
    """Who else was in the folder at any time while this was."""
    mine = Path(folder, name)
    mine.touch()
    seen: set[str] = set()
    for _ in range(30):
        seen |= {path.name for path in Path(folder).iterdir()}
        time.sleep(0.005)
    mine.unlink()
    return sorted(seen - {name})


def meet(folder: str, name: str, others: int) -> int:
    """Wait for `others` to be in the folder at the same time."""
    Path(folder, name).touch()
    while len(list(Path(folder).iterdir())) < others + 1:
        time.sleep(0.01)
    return others
