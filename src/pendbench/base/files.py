"""Files that are there whole or not at all, and folders that one program at a time writes to."""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from pendbench.base.errors import InputError
from pendbench.base.strict import show, shown_path


def user_cache() -> Path:
    """Where what can be made again is kept for this user. Raises RuntimeError for one without a home."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pendbench"


def write_whole(path: Path, write: Callable[[IO[bytes]], object], *, lasting: bool = True) -> None:
    """Write a file so that it is there whole or not at all, whenever the program stops.

    lasting: and whenever the machine does, which takes time; without it for what can be told from a broken one.

    A device or a pipe, as /dev/stdout, is written to, and not replaced by a file; nor is a link, but what it leads to.
    """
    if path.exists() and not path.is_file():
        path.write_bytes(_content(write))
        return
    path = Path(os.path.realpath(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}.")
    try:
        with os.fdopen(handle, "wb") as file:
            write(file)
            if lasting:
                file.flush()
                os.fsync(file.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _content(write: Callable[[IO[bytes]], object]) -> bytes:
    content = io.BytesIO()
    write(content)
    return content.getvalue()


def file_path(out: str | os.PathLike[str], option: str) -> Path:
    """Where a file goes, before the work that fills it. Raises `InputError` for what is no file that can be written."""
    try:
        path = Path(out)
    except TypeError:
        raise InputError(f"{option} is {show(out)}; allowed: a file to write") from None
    if out == "":
        raise InputError(f"{option} is empty; allowed: a file to write")
    if reason := _unwritable(path):
        raise InputError(f"{option} {shown_path(path)}: {reason}; allowed: a file to write")
    return path


def _unwritable(path: Path) -> str:
    try:
        if path.is_dir():
            return "is a folder"
        if path.exists() and not path.is_file():
            return "" if os.access(path, os.W_OK) else "not writable"
        folder = next(parent for parent in path.absolute().parents if parent.exists())
        if not folder.is_dir():
            return "lies below a file"
        tempfile.TemporaryFile(dir=folder).close()  # a drive can refuse what the permissions of a folder allow
    except (OSError, ValueError) as error:
        return getattr(error, "strerror", None) or str(error)
    return ""


@contextmanager
def alone_in(folder: Path, waiting: Callable[[], object]) -> Iterator[None]:
    """In this block no other program is in such a block for the same folder; where one is, say so by `waiting` first.

    The system lets go of the folder when this process ends, however it does. Where it has no such locks, on Windows and
    on some network drives, nobody waits.
    """
    handle = _locked(folder, waiting)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _locked(folder: Path, waiting: Callable[[], object]) -> int | None:
    try:
        import fcntl
    except ImportError:
        return None
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            waiting()
            fcntl.flock(handle, fcntl.LOCK_EX)
    except OSError:
        pass  # no locks here
    except BaseException:
        os.close(handle)
        raise
    return handle
