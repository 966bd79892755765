"""Engines for the gate, each without arguments: a right one that is quick, and some that do harm."""

from __future__ import annotations

import os
import time
from typing import Any

import numpy as np

from pendbench.physics.dense import accelerations
from support.tampered import Passing, Tampered, wrapping
from support.zoo import Beast, Rules, dies_at_once, hangs, knowing, leaves, raises

__all__ = ["Passing", "Tampered"]


def right() -> Tampered:
    """The analytic engine's `rk4`, under gravity alone."""
    return wrapping(Passing)


def wrong() -> Tampered:
    """The same, of which a higher order is claimed."""
    return wrapping(Passing, order=5)


def hanging() -> Beast:
    return Beast(Rules(scene=hangs), effects=knowing())


def sleeping() -> Beast:
    """Does nothing, for ever, and uses no processor for it."""
    return Beast(Rules(scene=lambda scene: time.sleep(1000) if scene.n == 5 else scene), effects=knowing())


def crashing() -> Beast:
    return Beast(Rules(scene=dies_at_once), effects=knowing())


def leaving() -> Beast:
    return Beast(Rules(scene=leaves), effects=knowing())


def raising() -> Beast:
    return Beast(Rules(scene=raises), effects=knowing())


def exiting_at_once() -> Beast:
    raise SystemExit(7)


def dying_at_once() -> Beast:
    os._exit(7)


def printing_at_once() -> Tampered:
    print("hello from a library")
    return right()


def step(world: Any) -> None:
    """Semi-implicit Euler, of any chain: one of the two functions of an engine that has no adapter."""
    if health(world):
        return
    world.omega = world.omega + world.dt * accelerations(world.scene, world.theta, world.omega)
    world.theta = world.theta + world.dt * world.omega


def state(world: Any) -> tuple[Any, Any]:
    """The other."""
    return world.theta, world.omega


def health(world: Any) -> str | None:
    return None if np.all(np.isfinite(world.omega)) and np.abs(world.omega).max() < 1e6 else "it blew up"
