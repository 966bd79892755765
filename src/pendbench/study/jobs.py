"""One interface for "run these": jobs in, outcomes out as they finish, whatever became of them.

The local pool runs each job in a process of its own pool, with a time limit; a job that raises, hangs or takes its
process with it is an outcome with a status, and the others go on.
"""

from __future__ import annotations

import itertools
import multiprocessing
import pickle
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from types import TracebackType
from typing import Any, Final, Protocol, Self

from pendbench.engines.protocol import Fault
from pendbench.errors import InputError, describe

_STOPPING_S: Final = 0.5  # how long a worker has to end by itself; it holds nothing that could be lost
_NO_WORKERS: Final = "the worker processes died as they started; what was finished is kept"


@dataclass(frozen=True)
class Job:
    """A call that can be made in another process: `function(*arguments)`, at most `time_limit` seconds."""

    key: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    time_limit: float


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


class LocalPool:
    """Processes of this machine, from `with` to its end."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._pool: Any = None

    def __enter__(self) -> Self:
        from pebble import CONSTS, ProcessPool

        if getattr(multiprocessing.current_process(), "_inheriting", False):
            # A worker runs the user's script again to know its functions, and the script has come here again.
            raise SystemExit('error: a script that runs a study needs the line `if __name__ == "__main__":` before it')
        CONSTS.term_timeout = _STOPPING_S
        self._pool = ProcessPool(max_workers=self.workers, context=multiprocessing.get_context("spawn"))
        with _deaf_to_interrupts():
            assert self._pool.active  # asking starts it
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is None:
            self._pool.close()
        else:
            self._pool.stop()
        self._pool.join()

    def run(self, jobs: Iterable[Job], *, alone: bool = False) -> Iterator[Outcome]:
        """The outcome of each job, in the order in which they finish.

        Raises InputError for a job that does, and where worker processes cannot be started.
        """
        queue = iter(jobs)
        running: dict[Any, Job] = {}
        room = 1 if alone else 2 * self.workers
        while True:
            for job in itertools.islice(queue, room - len(running)):
                running[self._schedule(job)] = job
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield _outcome(running.pop(future), future)

    def _schedule(self, job: Job) -> Any:
        packed = pickle.dumps((job.function, job.arguments))
        try:
            return self._pool.schedule(_call, args=(packed,), timeout=job.time_limit)
        except RuntimeError:
            raise InputError(_NO_WORKERS) from None


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
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


def _call(packed: bytes) -> tuple[str, Any]:
    """Make a call in the worker: how it ended, and what it returned, packed, or the reason in words.

    Only bytes and text travel back, so no value and no exception can break the way.
    """
    try:
        function, arguments = pickle.loads(packed)
        return "ok", pickle.dumps(function(*arguments))
    except InputError as error:
        return "bad input", str(error)
    except MemoryError as error:
        return "out of memory", describe(error)
    except BaseException as error:
        return "error", describe(error)


def _outcome(job: Job, future: Any) -> Outcome:
    from pebble import ProcessExpired

    error = future.exception()
    if error is None:
        return _returned(job, *future.result())
    if isinstance(error, TimeoutError):
        return Outcome(job, fault=Fault("timed out", f"took longer than {job.time_limit:g} s"))
    if isinstance(error, ProcessExpired):
        return Outcome(job, fault=Fault("crashed", f"the process died {_of(error.exitcode)}"))
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


def _of(exitcode: int | None) -> str:
    """What a process died of."""
    if exitcode is not None and -exitcode in signal.valid_signals():
        return f"of {signal.Signals(-exitcode).name}"
    return f"with exit code {exitcode}"
