"""How the project compiles its kernels: one decorator, one cache on disk.

numba looks only at the file of the outermost function to decide whether a cached kernel is stale, but our solvers have
the equations of motion compiled into them. So each file of kernels has a folder in the cache that is named after a hash
of all sources that its kernels can hold. A kernel reaches what it holds in two ways: by a name, so through the imports
of its file; or by the type of an argument (`chosen_by_type`, `specialise`), from a file that it need not know. The
first differ from file to file, the second are in every hash: an edited solver leaves the kernels of the others alone,
and edited physics leaves none.

A plug-in's system brings its kernels by type as well. What is compiled for it is kept apart, in a folder named after
its class and the files that gave it its kernels, too; the common one can be read by processes that do not know it. A
file that those import is not looked at: kernels of a plug-in that call each other belong in one file.
"""

from __future__ import annotations

import atexit
import hashlib
import inspect
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite.binding as llvm
import numba
import numpy
from numba.core import config as numba_config
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher, cpu_target
from numba.extending import overload

from pendbench.base import machine_code
from pendbench.base.files import user_cache

config: Any = numba_config  # its attributes are set while it is imported
types: Any = numba.types
Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parents[1]
_KERNEL_SOURCES = ("base/compiled.py", "base/machine_code.py", "effects/*.py", "physics/**/*.py", "solvers/**/*.py")

#: Division by zero gives inf or nan, as in numpy: a test before each division would cost time and catch nothing.
#: A product and a sum may be rounded once instead of twice.
_OPTIONS: Any = {"error_model": "numpy", "fastmath": {"contract"}, "no_cfunc_wrapper": True}

#: How the names begin that numba gives to the variables in which kernels find what they need of Python.
_ENVIRONMENT = "_ZN08NumbaEnv"


class _Linked(JITCodeLibrary):
    """The code of a kernel that only others call.

    They take its optimised code into their own and make machine code of all of it, so nobody runs machine code of it
    alone, which takes a seventh of the time to compile. numba makes that of what is left here: the variables in which
    kernels find what they need of Python.
    """

    def _finalize_final_module(self) -> None:
        its: Any = self
        its._finalize_dynamic_globals()
        its._finalized = True  # as far as those want it who take its code
        names = [variable.name for variable in its._get_module_for_linking().global_variables]
        left = its._codegen._create_empty_module(self.name)
        for name in names:
            if name.startswith(_ENVIRONMENT):
                cpu_target.target_context.declare_env_global(left, name)
        its._final_module = llvm.parse_assembly(str(left))
        super()._finalize_final_module()  # type: ignore[no-untyped-call]


class _ForOthers(Compiler):
    """numba's compiler, for such kernels."""

    def compile_extra(self, func: Any) -> Any:
        if self.state.library is None:
            library: Any = _Linked(self.state.targetctx.codegen(), func.__qualname__)  # type: ignore[no-untyped-call]
            library.enable_object_caching()
            self.state.library = library
        return super().compile_extra(func)  # type: ignore[no-untyped-call]


#: `_Linked` builds on what numba does not promise to keep, so it is used with the version that it was tried with. With
#: any other, parts are compiled as everything is.
LINKED_WITH = (0, 68)
_COMPILER = _ForOthers if numba.version_info.short == LINKED_WITH else Compiler

#: Such a kernel cannot be called but by others: what Python would need is a tenth of the time to compile it.
_PART: Any = {**_OPTIONS, "no_cpython_wrapper": True, "pipeline_class": _COMPILER}
_INLINED: Any = {**_PART, "forceinline": True}

_IMPORT = re.compile(r"^[ \t]*(?:from|import)[ \t]+([\w.]+)(?=(.*?)(?:\n[ \t]*\n|\Z))", re.DOTALL | re.MULTILINE)
_WORD = re.compile(r"\w+")
#: What gives kernels to others by type.
_BY_TYPE = ("chosen_by_type", "specialise")

#: Of the sources outside the package that give kernels by type, what they were as they came: those that give them to
#: types of their own, and those that may give them to any.
_for_their_own: dict[Path, bytes] = {}
_for_any: dict[Path, bytes] = {}


def cache_name(source: Path, apart: frozenset[str] | None = None, own: bytes = b"") -> str:
    """The name of a folder with machine code of the kernels in that file: the common one.

    apart: or the one of what is kept apart, for what comes from outside the package by these names. own: what a source
    outside the package was when its kernel was made.
    """
    digest = hashlib.sha256(_digest(source) + own + b"".join(sorted(_for_any.values())))
    if apart is not None:
        digest.update(b"apart" + b"".join(sorted(_for_their_own.values())) + repr(sorted(apart)).encode())
    return f"{source.stem}-{digest.hexdigest()[:16]}"


@cache
def _inside() -> dict[str, Path]:
    """The sources of kernels in the package, by the names of their modules."""
    found = {path for pattern in _KERNEL_SOURCES for path in _PACKAGE.glob(pattern)}
    names = {path: ".".join((_PACKAGE.name, *path.relative_to(_PACKAGE).with_suffix("").parts)) for path in found}
    return {names[path].removesuffix(".__init__"): path for path in sorted(found)}


@cache
def _imported(source: Path) -> frozenset[Path]:
    """The sources of kernels that a source imports, anywhere in it, and the packages that they are in.

    Rather too many: whatever stands between an import and the next empty line may be a name that it imports. To parse
    all sources would take every process a quarter of a second.
    """
    found = set()
    for module, block in _IMPORT.findall(source.read_text("utf-8")):
        parts = module.split(".")
        found |= {".".join(parts[:end]) for end in range(1, len(parts) + 1)}
        found |= {f"{module}.{word}" for word in _WORD.findall(block)}
    return frozenset(path for name, path in _inside().items() if name in found)


def _with_imports(sources: Iterable[Path]) -> set[Path]:
    found, left = set(), set(sources)
    while left:
        found |= left
        left = set().union(*map(_imported, left)) - found
    return found


@cache
def _arriving_by_type() -> frozenset[Path]:
    """The sources of what any kernel may hold without knowing it."""
    texts = {path: path.read_text("utf-8") for path in _inside().values()}
    return frozenset(_with_imports(path for path in texts if any(name in texts[path] for name in _BY_TYPE)))


def sources_of(source: Path) -> set[Path]:
    """The sources in the package of all that kernels in this file can hold: all there are for a file outside it."""
    inside = set(_inside().values())
    if source not in inside:
        return inside
    return _with_imports({source, _PACKAGE / "base/compiled.py"}) | _arriving_by_type()


@cache
def _digest(source: Path) -> bytes:
    digest, its = hashlib.sha256(f"numba {numba.__version__}, numpy {numpy.__version__}".encode()), sources_of(source)
    for path in _inside().values():
        if path in its:
            digest.update(_digest_alone(path))
    return digest.digest()


@cache
def _digest_alone(source: Path) -> bytes:
    return hashlib.sha256(source.read_bytes()).digest()


def _digest_outside(source: Path) -> bytes:
    """As it is now, and its place: what else it has constants from is not known, but likely to be beside it.

    What was typed at a prompt has no file to compare: nothing that was compiled before is used for it.
    """
    content = source.read_bytes() if source.is_file() else os.urandom(16)
    return str(source).encode() + hashlib.sha256(content).digest()


@cache
def _home() -> Path:
    """A folder below NUMBA_CACHE_DIR or the user's cache; where that cannot be, one for this process only."""
    try:
        home = Path(config.CACHE_DIR) / "pendbench" if config.CACHE_DIR else user_cache()
        home.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=home).close()
    except (OSError, RuntimeError):  # RuntimeError: this user has no home
        home = Path(tempfile.mkdtemp(prefix="pendbench-kernels-"))
        atexit.register(shutil.rmtree, home, ignore_errors=True)
    return home


class _OnDisk:
    """The cache of a kernel, as numba's dispatchers ask for one: the common one, and the one for what is kept apart."""

    def __init__(self, kernel: Any) -> None:
        self._function, self._source = kernel.py_func, _source(kernel)
        _digest(self._source)  # of the sources as they are now: that is what runs, whoever edits them later
        self._inside = self._source in _inside().values()
        self._own = b"" if self._inside else _digest_outside(self._source)

    @property
    def cache_path(self) -> str:
        """Where the common one is."""
        return str(_home() / cache_name(self._source, own=self._own))

    def load_overload(self, signature: Any, context: Any) -> Any:
        """What was compiled for these types, or None."""
        return machine_code.load(self._folder(signature), self._function, signature, context)

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled for these types."""
        machine_code.save(self._folder(signature), self._function, signature, compiled)

    def flush(self) -> None:
        """Keep what comes from now on where nothing was: what is around the kernel has changed."""
        self._own = os.urandom(16)

    def _folder(self, signature: Any) -> Path:
        foreign = frozenset(_from_outside(signature))
        apart = None if self._inside and not foreign else foreign
        return _home() / cache_name(self._source, apart, self._own)


def _from_outside(kinds: Iterable[Any]) -> Iterator[str]:
    """What may bring a kernel for values of these numba types code from outside the package, by name.

    That comes with its classes; and of types that are neither numbers nor made of them nobody can tell.
    """
    for kind in kinds:
        if isinstance(kind, types.BaseNamedTuple) and not _in_package(kind.instance_class):
            yield f"{kind.instance_class.__module__}.{kind.instance_class.__qualname__}"
        if isinstance(kind, types.BaseTuple):
            yield from _from_outside(kind)
        elif not isinstance(kind, types.Number | types.Boolean | types.Array | types.NoneType | types.Literal):
            yield type(kind).__name__


def _in_package(its: type) -> bool:
    return its.__module__.partition(".")[0] == _PACKAGE.name


def _source(function: Any) -> Path:
    return Path(inspect.getfile(inspect.unwrap(function))).resolve()


def compiled(function: Kernel) -> Kernel:
    """Compile `function` when it is first called, and keep the machine code on disk."""
    return _compiled(function, _OPTIONS)


def compiled_for_threads(function: Kernel) -> Kernel:
    """The same for a kernel beside which other threads of Python run."""
    return _compiled(function, {**_OPTIONS, "nogil": True})


def inlined(function: Kernel) -> Kernel:
    """The same for a small kernel that is made part of whatever calls it: passing arrays costs as much as it does."""
    return _part(function, _INLINED, _Inlined)


def part(function: Kernel) -> Kernel:
    """The same for a kernel of any size that only others call."""
    return _part(function, _PART, _Part)


def as_written(function: Kernel) -> Kernel:
    """The same for a kernel that lives by its rounding errors: every operation is rounded, and for itself."""
    return _compiled(function, {**_OPTIONS, "fastmath": False})


def part_as_written(function: Kernel) -> Kernel:
    """The same for one that only others call."""
    return _part(function, {**_PART, "fastmath": False}, _Part)


class _Part(CPUDispatcher):
    """A kernel that only others can call: without what Python would need, numba would end the process."""

    def __call__(self, *_: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is compiled into other kernels; allowed: a call in one of them")


class _Inlined(_Part):
    """One that becomes part of them."""


def _part(function: Kernel, options: Any, its: type[_Part]) -> Kernel:
    kernel: Any = _compiled(function, options)
    kernel.__class__ = its
    return cast(Kernel, kernel)


def _compiled(function: Kernel, options: Any) -> Kernel:
    kernel: Any = numba.njit(**options)(function)
    _home()  # as the settings are now
    kernel._cache = _OnDisk(kernel)
    return cast(Kernel, kernel)


def specialise(
    generic: Callable[..., None],
    system: type,
    kernel: Callable[..., None],
    where: Callable[[dict[str, Any]], bool] = lambda _: True,
) -> None:
    """Have `generic(s, *rest)`, called in a kernel, be `kernel(s, *rest)` where s is of the NamedTuple class `system`.

    where: and where this is true of the numba types of its fields. The choice is made while compiling, by the type of
    s: what a kernel asks for itself has both answers compiled, and one of them thrown away.
    """
    _know_source(_source(kernel), _for_any if _in_package(system) else _for_their_own)

    def choose(s: Any, *rest: Any) -> Callable[..., None] | None:  # noqa: ARG001
        if getattr(s, "instance_class", None) is not system or not where(dict(zip(s.fields, s.types, strict=True))):
            return None
        # Inlined as it is: a call in between would cost a third of a second, for each type that it is compiled for.
        return kernel.py_func if isinstance(kernel, _Inlined) else call

    def call(s: Any, *rest: Any) -> None:
        kernel(s, *rest)

    chosen_by_type(generic)(choose)


def chosen_by_type(generic: Callable[..., Any]) -> Callable[[Kernel], Kernel]:
    """Have a kernel that calls `generic` call what the decorated function returns for its arguments' types.

    That is a function of the same arguments, or None where the types are not its own.
    """

    def decorated(choose: Kernel) -> Kernel:
        _know_source(_source(choose), _for_any)
        return overload(generic, jit_options=_INLINED, strict=False)(choose)

    return decorated


def _know_source(source: Path, outside: dict[Path, bytes]) -> None:
    if source not in _inside().values() and _PACKAGE not in source.parents:
        outside.setdefault(source, _digest_outside(source))
