"""What every part of the project that starts processes has to mind."""

from __future__ import annotations

import ctypes
import gc
import multiprocessing
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker


def processors() -> int:
    """How many processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


def give_memory_back() -> None:
    """Return what this process has freed to the system, where that can be asked for: its size is then what it uses."""
    gc.collect()
    with suppress(OSError, AttributeError):  # of another system than Linux, or another C library than GNU's
        ctypes.CDLL(None).malloc_trim(0)


def refuse_without_guard() -> None:
    """Leave where a process that is being started has come here.

    A worker runs the user's script again to know its functions: the script must not start workers then.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise SystemExit('error: a script that runs a study needs the line `if __name__ == "__main__":` before it')


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Processes and threads that are started in this block never see a Ctrl-C; it is the main process that acts on it.

    Otherwise each worker that is still starting would print a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # starting it would lift the block
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
