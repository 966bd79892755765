"""How the project compiles its kernels: one decorator, one cache on disk.

numba looks only at the file of the outermost function to decide whether a cached kernel is stale, but our solvers have
the equations of motion compiled into them. So the cache's folder is named after a hash of all sources of kernels.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config
from numba.extending import overload

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent
_KERNEL_SOURCES = ("compiled.py", "physics/*.py", "solvers/*.py")

#: Division by zero gives inf or nan, as in numpy: a test before each division would cost time and catch nothing.
_OPTIONS = {"error_model": "numpy"}


@cache
def _cache_folder() -> str:
    digest = hashlib.sha256(f"numba {numba.__version__}".encode())
    for pattern in _KERNEL_SOURCES:
        for source in sorted(_PACKAGE.glob(pattern)):
            digest.update(source.read_bytes())
    home = config.CACHE_DIR or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(home) / "pendbench" / digest.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return tempfile.mkdtemp(prefix="pendbench-kernels-")
    return str(folder)


def compiled(function: Kernel) -> Kernel:
    """Compile `function` when it is first called, and keep the machine code on disk."""
    before = config.CACHE_DIR
    config.CACHE_DIR = _cache_folder()
    try:
        kernel: Kernel = numba.njit(cache=True, **_OPTIONS)(function)
    finally:
        config.CACHE_DIR = before
    return kernel


def specialise(generic: Callable[..., None], system: type, kernel: Callable[..., None]) -> None:
    """Have `generic(s, *rest)`, called in a kernel, be `kernel(s, *rest)` where s is of the NamedTuple class `system`.

    The choice is made while compiling, by the type of s.
    """

    def choose(s: Any, *rest: Any) -> Callable[..., None] | None:  # noqa: ARG001
        if getattr(s, "instance_class", None) is not system:
            return None

        def call(s: Any, *rest: Any) -> None:
            kernel(s, *rest)

        return call

    overload(generic, jit_options=_OPTIONS, strict=False)(choose)
