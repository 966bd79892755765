"""MuJoCo without a word on the terminal, without a log file, and without a user's callbacks."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco

_one_at_a_time = threading.RLock()


@contextmanager
def alone() -> Iterator[None]:
    """Keep MuJoCo from printing warnings, from writing MUJOCO_LOG.TXT, and from calling the user for passive forces.

    MuJoCo has one of each callback for the whole process: other threads wait here. The user's own are put back
    afterwards, and miss what happens meanwhile: the warnings are counted in the data of the run, where the adapter
    reads them.
    """
    with _one_at_a_time:
        yield from _without_callbacks()


def _without_callbacks() -> Iterator[None]:
    warned, pushed = mujoco.get_mju_user_warning(), mujoco.get_mjcb_passive()
    mujoco.set_mju_user_warning(_ignore)
    mujoco.set_mjcb_passive(None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(warned)
        mujoco.set_mjcb_passive(pushed)


def _ignore(text: str) -> None:
    """Take a warning's text and drop it."""
