"""How the processes of a pool start: as copies of one that has loaded what all of them need, where the system can.

To load numba takes most of a third of a second of processor time, which each worker would spend again, and each that
starts in place of one that crashed or used up its time. On other systems than Linux, where a copy of a process may lack
what its libraries had, a worker starts from nothing.
"""

from __future__ import annotations

import os
import sys
from multiprocessing import get_context
from multiprocessing.context import BaseContext, ForkServerContext, SpawnContext
from typing import Any, Final

from pendbench.base.processes import THREAD_VARIABLES

#: How the variables begin that libraries and kernels look at as they are loaded, and never again.
_READ_ONCE: Final = ("NUMBA_", "PYTHON", "XDG_CACHE_HOME", "HOME", *THREAD_VARIABLES)
_TOLD: Final = "PYTHONPATH"  # a copy is told where to import from

_loaded: list[str] = ["pendbench.execution.loaded"]  # the modules that are loaded before a process is copied
_read: dict[str, str] | None = None  # those variables, as they were when the process that is copied was started


class _KeepingLocks(BaseContext):
    """Keeps the locks that were made for processes.

    The pool drops its locks before it ends its processes: one that is just starting would look for them, find none, and
    print a traceback.
    """

    def __init__(self) -> None:
        self.locks: list[Any] = []

    def RLock(self) -> Any:  # noqa: N802, the name is multiprocessing's
        self.locks.append(super().RLock())
        return self.locks[-1]


class FromNothing(_KeepingLocks, SpawnContext):
    """Starts processes with an interpreter of their own."""


class AsCopies(_KeepingLocks, ForkServerContext):
    """Starts processes as copies of one that has loaded what they need."""


def load_before(module: str) -> None:
    """Have a module loaded before processes are copied: one that the jobs of most pools need."""
    _loaded.append(module)


def way_to_start() -> FromNothing | AsCopies:
    """How a pool's processes start now: a copy would not know what has changed since in the variables read there."""
    global _read  # noqa: PLW0603
    if sys.platform != "linux":
        return FromNothing()
    now = {name: value for name, value in os.environ.items() if name.startswith(_READ_ONCE) and name != _TOLD}
    if _read is None:
        get_context("forkserver").set_forkserver_preload(_loaded)
        _read = now
    return AsCopies() if now == _read else FromNothing()


def take_over(environment: dict[str, str]) -> None:
    """In a new process: have these variables, as who asked for it has, and not those of whom it is a copy of."""
    os.environ.clear()
    os.environ.update(environment)
