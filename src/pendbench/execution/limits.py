"""What a job may use of its process: processor time and memory. Called in the worker, around the job.

Time by the clock says more about the machine than about the job, so it is processor time that counts, of all threads,
without what compiling takes. The system keeps the count and ends the process: nothing in it has to be able to run.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

#: What a job may take where nothing else is said: s of processor time, and GB of memory.
TIME_LIMIT_S: Final = 120.0
MEMORY_LIMIT_GB: Final = 4.0
GB: Final = 1e9

# How much of the limit was left when a block began whose time does not count; 0 where none was in force.
_left: list[float] = []


def ended_for_time(exitcode: int | None) -> bool:
    """Whether a process ended because its job had used up its processor time."""
    return hasattr(signal, "SIGPROF") and exitcode == -signal.SIGPROF


def prepare() -> None:
    """Make a worker ready for limits of processor time, where the system has them."""
    if not hasattr(signal, "setitimer"):
        return
    import numba.core.event

    events: Any = numba.core.event

    class Compiling(events.Listener):  # type: ignore[misc]
        """Compiling a kernel, and loading one that is on disk."""

        def on_start(self, event: Any) -> None:  # noqa: ARG002
            _stop()

        def on_end(self, event: Any) -> None:  # noqa: ARG002
            _go_on()

    signal.signal(signal.SIGPROF, signal.SIG_DFL)  # whoever started this process may have had it ignored
    events.register("numba:compiler_lock", Compiling())


@contextmanager
def processor_time(seconds: float) -> Iterator[None]:
    """In this block, the process can use so much processor time, s; then the system ends it."""
    if not hasattr(signal, "setitimer"):
        yield
        return
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        _left.clear()


@contextmanager
def uncounted() -> Iterator[None]:
    """The processor time of this block does not count against the job's limit: it prepares for the work."""
    if not hasattr(signal, "setitimer"):
        yield
        return
    _stop()
    try:
        yield
    finally:
        _go_on()


def _stop() -> None:
    _left.append(signal.setitimer(signal.ITIMER_PROF, 0.0)[0])


def _go_on() -> None:
    """Of blocks in one another, or in several threads, the last to end goes on with what the first has left."""
    left = _left.pop() if _left else 0.0
    if left:
        signal.setitimer(signal.ITIMER_PROF, left)


def held() -> int | None:
    """How many bytes of writable memory this process has to itself. None where the system does not limit that."""
    if sys.platform != "linux":
        return None
    try:
        with open("/proc/self/statm", "rb") as file:
            return int(file.read().split()[5]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return None


@contextmanager
def memory(gigabytes: float | None) -> Iterator[None]:
    """In this block, the process can take so much more memory than it has: any allocation beyond it fails.

    It is writable memory that counts, not address space: compilers and libraries reserve far more of that than they
    ever use.
    """
    if gigabytes is None:
        yield
        return
    import resource

    before = resource.getrlimit(resource.RLIMIT_DATA)
    wanted = (held() or 0) + int(gigabytes * GB)
    least = min([wanted, *(limit for limit in before if limit != resource.RLIM_INFINITY)])
    resource.setrlimit(resource.RLIMIT_DATA, (least, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)
