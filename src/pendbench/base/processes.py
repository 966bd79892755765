"""What every part of the project that starts processes has to mind."""

from __future__ import annotations

import ast
import ctypes
import gc
import multiprocessing
import os
import platform
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from pathlib import Path
from types import FrameType
from typing import Final


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


def memory_held() -> int:
    """The memory that this process has, bytes."""
    import psutil

    return int(psutil.Process().memory_info().rss)


def machine_memory() -> int:
    """The memory that this machine has, bytes."""
    import psutil

    return int(psutil.virtual_memory().total)


def refuse_without_guard() -> None:
    """Leave where a script starts processes on a line that each of them would run, too.

    A worker runs the user's script again to know its functions: the script must not start workers then.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False) or _unguarded():
        raise SystemExit('error: a script that runs a study needs the line `if __name__ == "__main__":` before it')


def _unguarded() -> bool:
    """Whether the main script is at a line now that does not ask whether it is the main one. In doubt it does."""
    main = vars(sys.modules["__main__"])
    frame: FrameType | None = sys._getframe()
    while frame is not None and not (frame.f_globals is main and frame.f_code.co_name == "<module>"):
        frame = frame.f_back
    if frame is None or "__file__" not in main:
        return False
    try:
        script = ast.parse(Path(main["__file__"]).read_bytes())
    except (OSError, SyntaxError, ValueError):
        return False
    at = [part for part in script.body if part.lineno <= frame.f_lineno <= (part.end_lineno or 0)]
    return bool(at) and not any(isinstance(each, ast.Name) and each.id == "__name__" for each in ast.walk(at[0]))


def _start_tracker() -> None:
    """Start what tidies up after a study that was killed. That it had to is no news: it is not to warn of it."""
    quiet = "ignore:resource_tracker:UserWarning"  # an argument of its interpreter
    sys.warnoptions.append(quiet)
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.remove(quiet)


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Processes and threads that are started in this block never see a Ctrl-C; it is the main process that acts on it.

    Otherwise each worker that is still starting would print a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    _start_tracker()  # starting it would lift the block
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


#: What libraries ask, as they are loaded, for how many threads to do their arithmetic in.
THREAD_VARIABLES: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Processes that are started in this block do their arithmetic in one thread, unless the user wants it otherwise.

    More would take the processors of those beside them, and a library's idle threads wait by spinning: that would count
    as processor time of whatever is timed meanwhile.
    """
    unset = [name for name in THREAD_VARIABLES if name not in os.environ]
    os.environ.update(dict.fromkeys(unset, "1"))
    try:
        yield
    finally:
        for name in unset:
            os.environ.pop(name, None)


def processor() -> str:
    """The name of this machine's processor."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
        return names[0] if names else platform.processor()
    except OSError:
        return platform.processor()
