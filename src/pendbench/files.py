"""Files that are there whole or not at all, and folders that one program at a time writes to."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO


def write_whole(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file so that it is there whole or not at all, whenever the program stops."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}.")
    try:
        with os.fdopen(handle, "wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


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
