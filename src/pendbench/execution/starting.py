"""How worker processes start: as forks of a server that has loaded what each of them needs; elsewhere, from nothing.

A process that starts from nothing takes half a second to load numba. A study has a worker for each processor, and one
more for each that is ended. The server has one thread and has run nothing, so its forks are as good as new. It is
multiprocessing's own, one for all pools of this process.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from multiprocessing.context import SpawnContext
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING or sys.platform == "linux":
    from multiprocessing.context import ForkServerContext as Context
else:
    Context = SpawnContext  # libraries of other systems are not made to be forked

_LOADED: Final = ("numba.core.event", "pendbench.execution.pool")


class Starting(Context):
    """Starts processes, and keeps the locks that were made for them.

    The pool drops its locks before it ends its processes: one that is just starting would look for them, find none, and
    print a traceback.
    """

    def __init__(self) -> None:
        self.locks: list[Any] = []
        if self.get_start_method() == "forkserver":
            self.set_forkserver_preload([*_LOADED])

    def RLock(self) -> Any:  # noqa: N802, the name is multiprocessing's
        self.locks.append(super().RLock())
        return self.locks[-1]


def take_over(variables: Mapping[str, str]) -> None:
    """Have the environment of whoever started the pool: in a fork it is that of the server as it started."""
    if dict(os.environ) == variables:
        return
    os.environ.clear()
    os.environ.update(variables)
    from numba.core import config

    its: Any = config
    its.reload_config()  # what numba has read of them
