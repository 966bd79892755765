"""Machine code of kernels on disk: a file for each kernel and each set of types of its arguments.

numba's own cache has an index for each kernel, which two processes that save at once write over each other's, and a
place for each path that the source has. Here the name of a file says what it is for, and what it says is compared; so
no process is in another's way, and copies of the project use the same files.
"""

from __future__ import annotations

import hashlib
import pickle
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import llvmlite.binding as llvm
from numba.core import compiler, serialize
from numba.core.runtime.nrt import rtsys
from numba.experimental import function_type  # noqa: F401, with it numba knows a function of C as an argument

from pendbench.base.files import write_whole

_RESULT: Final[Any] = compiler.CompileResult
_NUMBA: Final[Any] = serialize
_DIGEST_SIZE: Final = hashlib.sha256().digest_size
_ADDRESS: Final = re.compile(r"\b0x[0-9a-fA-F]+")
_NO_NAME: Final = re.compile(r"[^\w.]")  # as <locals>, which no file may be called on some systems

Function = Callable[..., Any]


def load(folder: Path, function: Function, signature: Any, context: Any) -> Any:
    """What `save` kept of this function for arguments of these numba types; None for nothing that can be used.

    numba would first import its whole library, which takes half a second. But machine code needs no more of it than the
    modules of the functions that were compiled into it, and those are imported as it is read.
    """
    key = _key(function, signature, context.codegen())
    try:
        content = _path(folder, function, key).read_bytes()
        digest, packed = content[:_DIGEST_SIZE], content[_DIGEST_SIZE:]
        kept, needed, parts = pickle.loads(packed) if digest == _digest(packed) else (None, (), ())
    except Exception:  # no such file, or one that speaks of what is no longer there: it is written again
        return None
    rtsys.initialize(context)  # so that the memory of arrays is among what can be called
    if kept != key or any(llvm.address_of_symbol(name) is None for name in needed):
        return None
    return _RESULT._rebuild(context, *parts)


def save(folder: Path, function: Function, signature: Any, compiled: Any) -> None:
    """Keep what numba compiled, where that can be done: what is not kept is compiled again."""
    if compiled.library.has_dynamic_globals:  # addresses of this process
        return
    key = _key(function, signature, compiled.library.codegen)
    packed = _NUMBA.dumps((key, _needed(compiled), compiled._reduce()))
    with suppress(OSError):
        write_whole(_path(folder, function, key), lambda file: file.write(_digest(packed) + packed), lasting=False)


def _digest(packed: bytes) -> bytes:
    return hashlib.sha256(packed).digest()


def _needed(compiled: Any) -> list[str]:
    """The names of what the machine code calls that is not in it: it would end a process that does not know them.

    Kernels that call each other in a circle cannot be loaded alone: numba has a name for that which nothing ever gets.
    """
    if compiled.reload_init:  # it brings what it calls itself
        return []
    module = compiled.library._final_module
    values = (*module.functions, *module.global_variables)
    return [its.name for its in values if its.is_declaration and not its.name.startswith("llvm.")]


def _key(function: Function, signature: Any, codegen: Any) -> tuple[Any, ...]:
    """What must be equal for the machine code to be right, beside the source: types, machine, Python, and constants."""
    closure = tuple(cell.cell_contents for cell in function.__closure__ or ())
    digest = hashlib.sha256(function.__code__.co_code + _NUMBA.dumps(closure)).hexdigest()
    return signature, codegen.magic_tuple(), (*sys.version_info[:2], sys.abiflags), digest


def _path(folder: Path, function: Function, key: tuple[Any, ...]) -> Path:
    words = _ADDRESS.sub("", repr(key))
    name = f"{_NO_NAME.sub('', function.__qualname__)[-60:]}-{function.__code__.co_firstlineno}"
    return folder / f"{name}-{hashlib.sha256(words.encode()).hexdigest()[:16]}.kernel"
