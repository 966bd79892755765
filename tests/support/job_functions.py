"""What test_jobs.py has worker processes do."""

from __future__ import annotations

import ctypes
import math
import multiprocessing
import os
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np

from pendbench.base.errors import InputError
from pendbench.execution.limits import uncounted


def identity(value: object) -> object:
    return value


def process() -> tuple[int, int]:
    return os.getpid(), parent()


def surroundings(variable: str) -> tuple[str | None, str, str]:
    """What a variable is here, the folder, and where kernels are kept."""
    from pendbench.base import compiled

    return os.environ.get(variable), os.getcwd(), str(compiled._home())


def threads_of_arithmetic() -> tuple[str | None, float]:
    """What libraries are told, and what part of a product's processor time others than the thread that asked took."""
    square = np.ones((800, 800))
    whole, own = time.process_time(), time.thread_time()
    for _ in range(5):
        square = square @ square / 800
    whole, own = time.process_time() - whole, time.thread_time() - own
    return os.environ.get("OPENBLAS_NUM_THREADS"), 1.0 - own / whole


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


_kept: list[object] = []
_PIECE = 100_000_000


def take(gigabytes: float) -> int:
    """Take memory piece by piece, and give it back at the end."""
    return len(_pieces(gigabytes))


def take_and_keep(gigabytes: float) -> int:
    """Take memory and never give it back. Returns in which process."""
    _kept.extend(_pieces(gigabytes))
    return os.getpid()


def _pieces(gigabytes: float) -> list[object]:
    return [np.empty(_PIECE, np.uint8) for _ in range(round(gigabytes * 1e9 / _PIECE))]  # never written to: no harm


def take_or_abort(gigabytes: float) -> None:
    """As a C++ program does that nobody has told about memory."""
    malloc = ctypes.CDLL(None).malloc
    malloc.argtypes, malloc.restype = [ctypes.c_size_t], ctypes.c_void_p
    if malloc(int(gigabytes * 1e9)) is None:
        os.abort()


def reserve(gigabytes: float) -> str:
    """Reserve address space, as compilers do, without any memory behind it."""
    mmap = ctypes.CDLL(None, use_errno=True).mmap
    mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
    mmap.restype = ctypes.c_void_p
    private_and_anonymous = 0x22
    found = mmap(None, int(gigabytes * 1e9), 0, private_and_anonymous, -1, 0)
    return "failed" if found == ctypes.c_void_p(-1).value else "reserved"


@dataclass(frozen=True)
class Record:
    status: str
    reason: str = ""


def record_of_exhaustion() -> Record:
    """What a run returns that had too little memory and lived to tell."""
    return Record("out of memory", "MemoryError")


def leave() -> None:
    sys.exit("done")


def kill_itself() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def leave_at_once() -> None:
    os._exit(7)


def leave_used_up() -> None:
    os._exit(87)


def sleep(seconds: float) -> str:
    time.sleep(seconds)
    return "woke"


def spin(seconds: float = math.inf) -> str:
    """Use so much processor time."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass
    return "done"


def spin_compiled() -> None:
    """As a kernel does that comes to no end: the interpreter gets no turn."""

    @numba.njit
    def shift_until_zero(bits):  # which it never is
        while bits:
            bits ^= bits << np.uint64(13)
            bits ^= bits >> np.uint64(7)
            bits ^= bits << np.uint64(17)
        return bits

    shift_until_zero(np.uint64(1))


def compile_for(seconds: float) -> float:
    """Compile kernels, from nothing, until that has taken so much processor time. Returns how much it was."""
    begun = time.process_time()
    while (taken := time.process_time() - begun) < seconds:
        numba.njit(lambda x: [str(x), np.sort(np.array([x, x + 1.0])), {x: np.zeros(2)}][0])(2.0)
    return taken


def prepare_and_work(preparing: float, working: float) -> str:
    """Four times each, in turn."""
    for _ in range(4):
        with uncounted(), uncounted():
            spin(preparing)
        spin(working)
    return "done"


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


def parent() -> int:
    """The process that has the pool: what this one is a fork of can be another."""
    process = multiprocessing.parent_process()
    assert process is not None
    return int(process.pid or 0)


def kill_parent() -> None:
    """What no pool can guard against: the process that has it goes, too."""
    os.kill(parent(), signal.SIGKILL)
    time.sleep(600.0)


def nap(value: object, seconds: float) -> object:
    time.sleep(seconds)
    return value


def call(function, *arguments):
    return function(*arguments)
