"""Small kernels, which only other kernels can call, for tests that call them from Python."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from pendbench.base.compiled import compiled


@cache
def called(kernel: Any) -> Callable[..., Any]:
    """The kernel in one that does nothing else."""

    @compiled
    def call(*arguments: Any) -> Any:
        return kernel(*arguments)

    return call
