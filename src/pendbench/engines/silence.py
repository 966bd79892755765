"""Programs that write to the terminal while they are imported."""

from __future__ import annotations

import ctypes
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress


@contextmanager
def silenced() -> Iterator[None]:
    """Nothing is written to the process's standard output and standard error, by compiled code either."""
    libc = ctypes.CDLL(None)
    _flush(libc)
    kept = [os.dup(number) for number in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for number in (1, 2):
            os.dup2(nowhere, number)
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            yield
    finally:
        _flush(libc)  # what is in buffers would be written later
        for number, before in zip((1, 2), kept, strict=True):
            os.dup2(before, number)
            os.close(before)
        os.close(nowhere)


def _flush(libc: ctypes.CDLL) -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, ValueError, OSError):  # there may be none, or one that is closed
            stream.flush()
    libc.fflush(None)
