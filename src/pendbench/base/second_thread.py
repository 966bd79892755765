"""A thread beside the one that asks, for kernels that let others run."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar

_Result = TypeVar("_Result")


@cache
def _second() -> ThreadPoolExecutor:
    """It is kept: to start one takes longer than its work."""
    return ThreadPoolExecutor(1, "pendbench-second")


# A forked process has none of its parent's threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_second.cache_clear)


def both(kernel: Callable[..., _Result], here: tuple[Any, ...], there: tuple[Any, ...]) -> tuple[_Result, _Result]:
    """What the kernel returns for these arguments in this thread, and for those in the other at the same time."""
    second = _second().submit(kernel, *there)
    first = kernel(*here)
    return first, second.result()
