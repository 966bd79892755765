"""What an engine does to the process that it runs in, besides what it is asked."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from pendbench.base.heard import heard
from pendbench.base.strict import show


@contextmanager
def surroundings_kept() -> Iterator[list[str]]:
    """Put back what the block changes; the list, full when it ends, says what that was, and what it printed."""
    flaws: list[str] = []
    before, errors = os.getcwd(), np.geterr()
    with heard() as said:
        yield flaws
    if said:
        flaws.append(f"it prints {show(said[0][:60])}")
    if os.getcwd() != before:
        os.chdir(before)
        flaws.append("it changes the working folder")
    if np.geterr() != errors:
        np.seterr(**errors)
        flaws.append("it changes numpy's error state")
