"""One interface for "run these": jobs in, outcomes out as they finish, whatever became of them.

The local pool runs each job in a process of its own pool, with a time limit; a job that raises, hangs or takes its
process with it is an outcome with a status, and the others go on.
"""

from __future__ import annotations

import itertools
import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Protocol, Self

from pendbench.engines.protocol import Fault
from pendbench.errors import InputError, describe


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
        from pebble import ProcessPool

        self._pool = ProcessPool(max_workers=self.workers, context=multiprocessing.get_context("spawn"))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is None:
            self._pool.close()
        else:
            self._pool.stop()
        self._pool.join()

    def run(self, jobs: Iterable[Job], *, alone: bool = False) -> Iterator[Outcome]:
        """The outcome of each job, in the order in which they finish."""
        queue = iter(jobs)
        running: dict[Any, Job] = {}
        room = 1 if alone else 2 * self.workers
        while True:
            for job in itertools.islice(queue, room - len(running)):
                running[self._pool.schedule(job.function, args=job.arguments, timeout=job.time_limit)] = job
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield _outcome(running.pop(future), future)


def _outcome(job: Job, future: Any) -> Outcome:
    from pebble import ProcessExpired

    error = future.exception()
    if error is None:
        return Outcome(job, future.result())
    if isinstance(error, InputError):
        raise error
    if isinstance(error, TimeoutError):
        return Outcome(job, fault=Fault("timed out", f"took longer than {job.time_limit:g} s"))
    if isinstance(error, ProcessExpired):
        return Outcome(job, fault=Fault("crashed", f"the process died with exit code {error.exitcode}"))
    if isinstance(error, MemoryError):
        return Outcome(job, fault=Fault("out of memory", describe(error)))
    return Outcome(job, fault=Fault("error", describe(error)))
