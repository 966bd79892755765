"""How the project compiles its kernels: one decorator, one cache on disk.

numba looks only at the file of the outermost function to decide whether a cached kernel is stale, but our solvers have
the equations of motion compiled into them. So the cache's folder is named after a hash of all sources of kernels.
"""

from __future__ import annotations

import atexit
import hashlib
import inspect
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config as numba_config
from numba.extending import overload

config: Any = numba_config  # its attributes are set while it is imported
Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parent
_KERNEL_SOURCES = ("compiled.py", "effects/*.py", "physics/*.py", "solvers/*.py")

#: Division by zero gives inf or nan, as in numpy: a test before each division would cost time and catch nothing.
#: A product and a sum may be rounded once instead of twice.
_OPTIONS: Any = {"error_model": "numpy", "fastmath": {"contract"}, "no_cfunc_wrapper": True}

_INLINED: Any = {**_OPTIONS, "forceinline": True}

_kernels: list[Any] = []
_sources_outside: list[Path] = []


def cache_folder() -> str:
    """Where this process keeps its machine code: it changes with whatever is compiled into the kernels."""
    return _writable_folder(_digest(tuple(_sources_outside)))


@cache
def _digest(outside: tuple[Path, ...]) -> str:
    digest = hashlib.sha256(f"numba {numba.__version__}".encode())
    inside = (source for pattern in _KERNEL_SOURCES for source in sorted(_PACKAGE.glob(pattern)))
    for source in (*inside, *outside):
        # What was typed at a prompt has no file to compare: nothing that was compiled before is used for it.
        digest.update(source.read_bytes() if source.is_file() else os.urandom(16))
    return digest.hexdigest()[:16]


@cache
def _writable_folder(name: str) -> str:
    """A folder below NUMBA_CACHE_DIR or the user's cache; where that cannot be, one for this process only."""
    try:
        home = config.CACHE_DIR or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(home) / "pendbench" / name
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, RuntimeError):  # RuntimeError: this user has no home
        temporary = tempfile.mkdtemp(prefix="pendbench-kernels-")
        atexit.register(shutil.rmtree, temporary, ignore_errors=True)
        return temporary
    return str(folder)


def _keep_on_disk(kernel: Any) -> None:
    folder, before = cache_folder(), config.CACHE_DIR
    config.CACHE_DIR = folder
    try:
        kernel.enable_caching()
    finally:
        config.CACHE_DIR = before


def compiled(function: Kernel) -> Kernel:
    """Compile `function` when it is first called, and keep the machine code on disk."""
    return _compiled(function, _OPTIONS)


def compiled_for_threads(function: Kernel) -> Kernel:
    """The same for a kernel beside which other threads of Python run."""
    return _compiled(function, {**_OPTIONS, "nogil": True})


def inlined(function: Kernel) -> Kernel:
    """The same for a small kernel that is made part of whatever calls it: passing arrays costs as much as it does."""
    return _compiled(function, _INLINED)


def as_written(function: Kernel) -> Kernel:
    """The same for a kernel that lives by its rounding errors: every operation is rounded, and for itself."""
    return _compiled(function, {**_OPTIONS, "fastmath": False})


def _compiled(function: Kernel, options: Any) -> Kernel:
    kernel: Kernel = numba.njit(**options)(function)
    _keep_on_disk(kernel)
    _kernels.append(kernel)
    return kernel


def specialise(generic: Callable[..., None], system: type, kernel: Callable[..., None]) -> None:
    """Have `generic(s, *rest)`, called in a kernel, be `kernel(s, *rest)` where s is of the NamedTuple class `system`.

    The choice is made while compiling, by the type of s.
    """
    _know_source(Path(inspect.getfile(inspect.unwrap(kernel))).resolve())

    def choose(s: Any, *rest: Any) -> Callable[..., None] | None:  # noqa: ARG001
        if getattr(s, "instance_class", None) is not system:
            return None

        def call(s: Any, *rest: Any) -> None:
            kernel(s, *rest)

        return call

    chosen_by_type(generic)(choose)


def chosen_by_type(generic: Callable[..., Any]) -> Callable[[Kernel], Kernel]:
    """Have a kernel that calls `generic` call what the decorated function returns for its arguments' types.

    That is a function of the same arguments, or None where the types are not its own.
    """
    return overload(generic, jit_options=_INLINED, strict=False)


def _know_source(source: Path) -> None:
    """Give a process that has a system from outside the package a cache of its own.

    In the common one nobody would notice that kernels for that system are stale, and the name of its type would keep
    every process that cannot import it from reading the cache at all.
    """
    if _PACKAGE in source.parents or source in _sources_outside:
        return
    _sources_outside.append(source)
    for kernel in _kernels:
        _keep_on_disk(kernel)
