"""Pools that tests of studies use one after the other: to start one takes longer than what most studies have it do.

How pools start and end is what `execution/test_jobs.py` and the command lines in other files are about. A worker keeps
the modules that it has loaded: an engine that a test edits in place needs another path, or a process of its own.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator

from pendbench.execution.pool import Job, LocalPool, Outcome

#: Of each number of workers the pool that is there, and what its processes have from this one.
_there: dict[int, tuple[LocalPool, object]] = {}


class LentPool:
    """Stands for `LocalPool`. A process that is where this one is, and has its variables and path, serves again."""

    def __init__(self, workers: int) -> None:
        self.workers, self._lost_workers = workers, False

    def __enter__(self) -> LentPool:
        pool, had = _there.get(self.workers, (None, None))
        if pool is None or had != _handed_on() or not pool._pool.active:
            _end(self.workers)
            _there[self.workers] = LocalPool(self.workers).__enter__(), _handed_on()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None or self._lost_workers:  # whoever takes their place may start in the middle of the next test
            _end(self.workers, kind)

    def run(self, jobs: Iterable[Job], *, alone: bool = False) -> Iterator[Outcome]:
        for outcome in _there[self.workers][0].run(jobs, alone=alone):
            self._lost_workers |= outcome.fault is not None and outcome.fault.status in ("crashed", "timed out")
            yield outcome


def _end(workers: int, kind: type[BaseException] | None = None) -> None:
    if workers in _there:
        _there.pop(workers)[0].__exit__(kind, None, None)


def _handed_on() -> object:
    variables = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    return variables, os.getcwd(), list(sys.path)


def end_pools() -> None:
    """End those that are there."""
    for workers in list(_there):
        _end(workers)
