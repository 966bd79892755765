"""One interface for "run these": jobs in, outcomes out as they finish, whatever became of them.

The local pool runs each job in a process of its own pool, with a time limit; a job that raises, hangs or takes its
process with it is an outcome with a status, and the others go on.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass
from typing import Any, Protocol

from pendbench.engines.protocol import Fault
from pendbench.errors import InputError


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

    def run(self, jobs: Iterable[Job]) -> Iterator[Outcome]:
        """The outcome of each job, in the order in which they finish."""


def describe(error: BaseException) -> str:
    """An exception in one line."""
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0][:200]}" if lines else type(error).__name__


class LocalPool:
    """Processes of this machine."""

    def __init__(self, workers: int) -> None:
        self.workers = workers

    def run(self, jobs: Iterable[Job]) -> Iterator[Outcome]:
        """The outcome of each job. Closing the iterator ends the jobs that still run."""
        from pebble import ProcessPool

        with ProcessPool(max_workers=self.workers, context=multiprocessing.get_context("spawn")) as pool:
            waiting = {pool.schedule(j.function, args=j.arguments, timeout=j.time_limit): j for j in jobs}
            try:
                while waiting:
                    done, _ = wait(waiting, return_when=FIRST_COMPLETED)
                    for future in done:
                        yield _outcome(waiting.pop(future), future)
            finally:
                if waiting:
                    pool.stop()


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
