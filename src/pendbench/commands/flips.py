"""The map of flip times of a double pendulum, as a page that one can look into."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendbench import __version__
from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.engines.analytic.ensemble import first_flips
from pendbench.measures.flips import grid_angles
from pendbench.report.numbers import number_text
from pendbench.report.stage.records import FlipStage
from pendbench.report.styles import engine_hue
from pendbench.scene.scene import Scene

_SIZE: Final = 320
_TOLERANCE: Final = 1e-8  # a pixel is 0.02 rad wide


def flip_stage(scene: Scene, size: int = _SIZE) -> FlipStage:
    """The map of the scene's chain, released at rest from size x size pairs of angles, over the scene's duration.

    Raises `InputError` for a chain that the page cannot run by itself: any but two point masses under gravity.
    """
    gravity = scene.effects.gravity
    if scene.n != 2 or set(scene.terms) != {"gravity"} or gravity is None:
        raise InputError(f"--flips of {scene.name!r}; allowed: two point masses under gravity, and nothing else")
    grid = grid_angles(size)
    starts = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2)
    times = first_flips(scene, starts, tolerance=_TOLERANCE).reshape(size, size)
    share = float(np.mean(np.isfinite(times)))
    return FlipStage(
        title="When does a double pendulum flip?",
        name=scene.name,
        duration=scene.duration,
        masses=(float(scene.masses[0]), float(scene.masses[1])),
        lengths=(float(scene.lengths[0]), float(scene.lengths[1])),
        gravity=float(gravity),
        times=times,
        start=(2.0, 2.5),
        colour=engine_hue("analytic"),
        words=_words(scene, share, times),
        facts=(("pendbench", __version__), ("scene", f"{scene.name}, {scene.digest}"), ("map", f"{size} x {size}")),
    )


def _words(scene: Scene, share: float, times: FloatArray) -> tuple[str, ...]:
    known = times[np.isfinite(times)]
    first = float(known.min()) if known.size else math.nan
    return (
        f"{number_text(share, '.0%')} of all releases from rest flip within {number_text(scene.duration)} s; "
        f"the first after {number_text(first)} s.",
        "Near the middle of the map, where the energy is too small, nothing flips.",
        "What is finer than the map is computed in the page, by RK4 with a step of 2.5 ms.",
    )
