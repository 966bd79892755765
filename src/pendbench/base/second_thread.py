"""A thread beside the one that asks, for kernels that let others run.

With `concurrent.futures` an interrupt at the wrong moment becomes an error of another kind, and its threads end before
a program's others do.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from queue import SimpleQueue
from threading import Lock, Thread, get_ident
from typing import Any, Generic, TypeVar

_Result = TypeVar("_Result")


class _Task(Generic[_Result]):
    """A call, and what became of it. Whoever takes it up first calls it: the second thread, or who asked."""

    def __init__(self, kernel: Callable[..., _Result], args: tuple[Any, ...]) -> None:
        self._kernel, self._args, self._over = kernel, args, False
        self._takers: dict[str, int] = {}
        self._ended = Lock()
        self._values: list[_Result] = []
        self._error: BaseException | None = None
        self._ended.acquire()

    def take_up(self) -> bool:
        """Whether this thread is the first to."""
        return self._takers.setdefault("first", get_ident()) == get_ident()

    def call(self) -> None:
        """By whoever took it up."""
        try:
            self._values.append(self._kernel(*self._args))
        except BaseException as error:
            self._error = error

    def end(self) -> None:
        """In the second thread."""
        self._over = True
        self._ended.release()

    def wait(self) -> None:
        """Until the second thread, which took it up, has done it, interrupt or not: it writes into others' arrays."""
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
        self.spent, self.tasks = 0.0, SimpleQueue[_Task[Any]]()
        Thread(target=self._work, name="pendbench-second", daemon=True).start()

    def _work(self) -> None:
        while True:
            self._do(self.tasks.get())  # and keeps nothing of it

    def _do(self, task: _Task[Any]) -> None:
        if task.take_up():
            task.call()
            self.spent = time.thread_time()
            task.end()


class _Home:
    """Where it is: started with its first task and kept, since to start one takes longer than its work."""

    second: _Second | None
    _starting: Lock

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """After a fork: there is none of the parent's threads, and nobody to open a lock."""
        self.second, self._starting = None, Lock()

    def do(self, task: _Task[Any]) -> None:
        with self._starting:
            self.second = self.second or _Second()
        self.second.tasks.put(task)


_home = _Home()

if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_home.forget)


def both(kernel: Callable[..., _Result], here: tuple[Any, ...], there: tuple[Any, ...]) -> tuple[_Result, _Result]:
    """What the kernel returns for these arguments in this thread, and for those in the other at the same time.

    Where the other has not begun when this one is done, this one does both. Neither is left at work by an error or an
    interrupt of the other.
    """
    task = _Task(kernel, there)
    try:
        _home.do(task)
        first = kernel(*here)
        if task.take_up():
            task.call()
        else:
            task.wait()
    except BaseException:
        if not task.take_up():
            task.wait()
        raise
    return first, task.result()


def spent_beside() -> float:
    """Processor time of the second thread so far, s."""
    return _home.second.spent if _home.second else 0.0
