"""One interface for "run these": jobs in, outcomes out as they finish, whatever became of them.

The local pool runs each job in a process of its own pool, with a limit of processor time and one of memory; a job that
raises, hangs, takes too much or takes its process with it is an outcome with a status, and the others go on. The same
on the machines of a Dask cluster: `execution.cluster`.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import pickle
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from dataclasses import dataclass, replace
from multiprocessing.context import SpawnContext
from types import TracebackType
from typing import Any, Final, Protocol, Self

from pendbench.base.errors import InputError, describe
from pendbench.base.faults import Fault
from pendbench.base.processes import deaf_to_interrupts, one_thread_each, refuse_without_guard
from pendbench.execution import limits
from pendbench.execution.limits import GB, held

_STOPPING_S: Final = 0.5  # how long a worker has to end by itself; it holds nothing that could be lost
_NO_WORKERS: Final = "the worker processes died as they started; what was finished is kept"
_USED_UP: Final = 87  # the exit code of a worker that makes room for a new one
_LEAST_WALL_S: Final = 600.0
_WALL_TO_PROCESSOR: Final = 20.0
_HEARD_S: Final = 2.0  # after so long the pool knows which worker has which job

OUT_OF_MEMORY: Final = "out of memory"


@dataclass(frozen=True)
class Job:
    """A call that can be made in another process: `function(*arguments)`.

    time_limit: how much processor time it may use, s; compiling does not count. memory_limit: how many GB (1e9 bytes)
    it may take beside what its process has already; None for any number. wall_limit: after how long by the clock, s, it
    is taken to hang; None for a time that no job comes near on a busy machine.
    """

    key: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    time_limit: float
    memory_limit: float | None = None
    wall_limit: float | None = None

    @property
    def hangs_after(self) -> float:
        """After how long by the clock it is given up, s."""
        return self.wall_limit or max(_LEAST_WALL_S, _WALL_TO_PROCESSOR * self.time_limit)


@dataclass(frozen=True)
class Outcome:
    """What a job returned, or the fault that kept it from returning."""

    job: Job
    value: Any = None
    fault: Fault | None = None


class Executor(Protocol):
    """Anything that can run jobs."""

    def run(self, jobs: Iterable[Job], *, alone: bool = False) -> Iterator[Outcome]:
        """The outcome of each job, in the order in which they finish. alone: one at a time, for timings."""


class _Starting(SpawnContext):
    """Starts processes from nothing, and keeps the locks that were made for them.

    Forks of multiprocessing's server would start sooner, by half a second of a processor. But they have what it began
    with: variables and threads of arithmetic, the processors it may use, its random numbers. And it is the user's too.

    The pool drops its locks before it ends its processes: one that is just starting would look for them, find none, and
    print a traceback.
    """

    def __init__(self) -> None:
        self.locks: list[Any] = []

    def RLock(self) -> Any:  # noqa: N802, the name is multiprocessing's
        self.locks.append(super().RLock())
        return self.locks[-1]


class LocalPool:
    """Processes of this machine, from `with` to its end."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._pool: Any = None
        self._starting, self._threads = _Starting(), ExitStack()

    def __enter__(self) -> Self:
        from pebble import CONSTS, ProcessPool

        refuse_without_guard()
        CONSTS.term_timeout = _STOPPING_S
        with ExitStack() as undone:
            undone.enter_context(one_thread_each())
            self._pool = ProcessPool(max_workers=self.workers, context=self._starting, initializer=_begin)
            with deaf_to_interrupts():
                self._start()
            self._threads = undone.pop_all()
        return self

    def _start(self) -> None:
        try:
            assert self._pool.active  # asking starts it
        except BrokenProcessPool as error:
            self._pool.stop()  # those that could be
            self._pool.join()
            raise InputError(f"worker processes cannot be started: {describe(error.__cause__ or error)}") from None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with self._threads:
            if kind is None:
                self._pool.close()
            else:
                _share_stopping_time(self.workers)
                self._pool.stop()
            self._pool.join()
        self._starting.locks.clear()

    def run(self, jobs: Iterable[Job], *, alone: bool = False) -> Iterator[Outcome]:
        """The outcome of each job, in the order in which they finish.

        Raises InputError for a job that does, and where worker processes cannot be started.
        """
        queue = iter(jobs)
        running: dict[Any, Job] = {}
        again: Counter[str] = Counter()
        room = 1 if alone else 2 * self.workers
        while True:
            for job in itertools.islice(queue, room - len(running)):
                running[self._schedule(job)] = job
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                job = running.pop(future)
                if _met_a_used_up_worker(future) and again[job.key] < self.workers:
                    again[job.key] += 1
                    running[self._schedule(job)] = job
                else:
                    yield _outcome(job, future)

    def _schedule(self, job: Job) -> Any:
        packed = pickle.dumps((job.function, job.arguments))
        try:
            return self._pool.schedule(_call, args=(packed, job.time_limit, job.memory_limit), timeout=job.hangs_after)
        except RuntimeError:
            raise InputError(_NO_WORKERS) from None


def _share_stopping_time(workers: int) -> None:
    """Workers are stopped one after the other: many together should take no longer than one."""
    from pebble import CONSTS

    CONSTS.term_timeout = _STOPPING_S / workers


# In the worker.

_at_start = 0


def _begin() -> None:
    """What a worker does first."""
    global _at_start  # noqa: PLW0603
    limits.prepare()
    _at_start = held() or 0
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    """End this process with the one that started it: killed, that cannot end its workers."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _call(packed: bytes, time_limit: float, memory_limit: float | None) -> tuple[str, Any]:
    """Make a call in the worker: how it ended, and what it returned, packed, or the reason in words.

    Only bytes and text travel back, so no value and no exception can break the way.
    """
    limit = None if held() is None else memory_limit
    if limit is not None and (held() or 0) - _at_start > limit * GB:
        threading.Event().wait(_HEARD_S)
        os._exit(_USED_UP)  # what earlier jobs left behind should not be this one's burden, nor grow for ever
    try:
        with limits.memory(limit):
            function, arguments = pickle.loads(packed)
            with limits.processor_time(time_limit):
                value = function(*arguments)
            return "ok", pickle.dumps(_with_limit_named(value, limit))
    except InputError as error:
        return "bad input", str(error)
    except MemoryError as error:
        return OUT_OF_MEMORY, describe(error) + _naming(limit)
    except BaseException as error:
        return "error", describe(error)


def _with_limit_named(value: Any, limit: float | None) -> Any:
    """The value; where it is the record of a run without enough memory, with the limit in its reason."""
    if getattr(value, "status", None) == OUT_OF_MEMORY:
        return replace(value, reason=value.reason + _naming(limit))
    return value


def _naming(limit: float | None) -> str:
    return "" if limit is None else f"; the limit is {limit:g} GB"


# What came back from it.


def _met_a_used_up_worker(future: Any) -> bool:
    return getattr(future.exception(), "exitcode", None) == _USED_UP


def _outcome(job: Job, future: Any) -> Outcome:
    from pebble import ProcessExpired

    error = future.exception()
    if error is None:
        return _returned(job, *future.result())
    if isinstance(error, TimeoutError):
        return Outcome(job, fault=Fault("timed out", f"took longer than {job.hangs_after:g} s by the clock"))
    if isinstance(error, ProcessExpired) and limits.ended_for_time(error.exitcode):
        return Outcome(job, fault=Fault("timed out", f"took longer than {job.time_limit:g} s of processor time"))
    if isinstance(error, ProcessExpired):
        limit = None if held() is None else job.memory_limit
        return Outcome(job, fault=Fault("crashed", f"the process died {_of(error.exitcode, limit)}"))
    if isinstance(error, BrokenProcessPool):
        raise InputError(_NO_WORKERS)
    return Outcome(job, fault=Fault("error", describe(error)))


def _returned(job: Job, status: str, content: Any) -> Outcome:
    if status == "bad input":
        raise InputError(content)
    if status != "ok":
        return Outcome(job, fault=Fault(status, content))
    try:
        return Outcome(job, pickle.loads(content))
    except Exception as error:
        return Outcome(job, fault=Fault("error", describe(error)))


def _of(exitcode: int | None, memory_limit: float | None) -> str:
    """What a process died of. A program that aborts where it gets no memory, or is killed by the system, cannot say."""
    if exitcode is None or -exitcode not in signal.valid_signals():
        return f"with exit code {exitcode}"
    name = signal.Signals(-exitcode).name
    perhaps = memory_limit is not None and name in {"SIGABRT", "SIGKILL"}
    return f"of {name}" + (f", perhaps for want of memory{_naming(memory_limit)}" if perhaps else "")
