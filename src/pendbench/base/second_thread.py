"""A thread beside the one that asks, for kernels that let others run.

With `concurrent.futures` an interrupt at the wrong moment becomes an error of another kind, and its threads end before
a program's others do.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from functools import cache
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any, Generic, TypeVar

_Result = TypeVar("_Result")


class _Task(Generic[_Result]):
    """A call, and what became of it."""

    def __init__(self, kernel: Callable[..., _Result], args: tuple[Any, ...]) -> None:
        self._kernel, self._args, self._over, self._ended = kernel, args, False, Lock()
        self._values: list[_Result] = []
        self._error: BaseException | None = None
        self._ended.acquire()

    def call(self) -> None:
        """In the second thread."""
        try:
            self._values.append(self._kernel(*self._args))
        except BaseException as error:
            self._error = error

    def end(self) -> None:
        """In the second thread."""
        self._over = True
        self._ended.release()

    def wait(self) -> None:
        """Until it is over, whatever interrupts: it writes into arrays of the one who asked."""
        interrupt = None
        while not self._over:
            try:
                self._ended.acquire()
            except BaseException as error:
                interrupt = error
        if interrupt is not None:
            raise interrupt

    def result(self) -> _Result:
        """What the kernel returned; raises what it raised."""
        if self._error is not None:
            raise self._error
        return self._values[0]


class _Second:
    """The thread, which does one task after another. spent: its processor time, s, up to the end of the last."""

    def __init__(self) -> None:
        self.spent, self._tasks = 0.0, SimpleQueue[_Task[Any]]()
        Thread(target=self._work, name="pendbench-second", daemon=True).start()

    def do(self, task: _Task[Any]) -> None:
        self._tasks.put(task)

    def _work(self) -> None:
        while True:
            task = self._tasks.get()
            task.call()
            self.spent = time.thread_time()
            task.end()


@cache
def _second() -> _Second:
    """It is started with its first task and kept: to start one takes longer than its work."""
    return _Second()


# A forked process has none of its parent's threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_second.cache_clear)


def both(kernel: Callable[..., _Result], here: tuple[Any, ...], there: tuple[Any, ...]) -> tuple[_Result, _Result]:
    """What the kernel returns for these arguments in this thread, and for those in the other at the same time."""
    task = _Task(kernel, there)
    _second().do(task)
    try:
        first = kernel(*here)
    finally:
        task.wait()
    return first, task.result()


def spent_beside() -> float:
    """Processor time of the second thread so far, s."""
    return _second().spent if _second.cache_info().currsize else 0.0
