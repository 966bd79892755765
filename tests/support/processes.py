"""Processes that tests start."""

from __future__ import annotations

import os
import threading


def assert_gone(pid: int) -> None:
    for _ in range(30_000):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return
        threading.Event().wait(0.01)
    raise AssertionError("it is still there")
