"""What is written to standard output and standard error, by code of any language."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import Final

_MOST: Final = 10_000  # bytes that are kept


@contextmanager
def heard() -> Iterator[list[str]]:
    """What is written in this block, as one text after it, or none; nobody else hears it."""
    said: list[str] = []
    with tempfile.TemporaryFile() as file:
        _flush()
        before = [os.dup(number) for number in (1, 2)]
        for number in (1, 2):
            os.dup2(file.fileno(), number)
        try:
            # Python's own streams may be others: a notebook's, a test's.
            stream = open(file.fileno(), "w", encoding="utf-8", errors="replace", closefd=False)  # noqa: SIM115
            with stream, redirect_stdout(stream), redirect_stderr(stream):
                yield said
        finally:
            _flush()
            for number, own in zip((1, 2), before, strict=True):
                os.dup2(own, number)
                os.close(own)
            file.seek(0)
            text = file.read(_MOST).decode(errors="replace").strip()
            said.extend([text] if text else [])


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):  # a stream may be closed, or none
            stream.flush()
