"""The chain as the compiled kernels see it.

The *type* of a system says which effects it has, so a kernel compiled for it holds their arithmetic and no other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.scene import Scene
from pendbench.trajectory import FloatArray

_SCRATCH_ROWS = 4


class System(NamedTuple):
    """A chain under gravity or free of it.

    masses (n,) kg; lengths (n,) m; gravity m/s^2 (0 where the scene has none: it enters once, at the pivot, and costs
    the same); scratch (4, n): room for the recursion, so that a call allocates nothing. One thread, one system.
    """

    masses: FloatArray
    lengths: FloatArray
    gravity: float
    scratch: FloatArray


def system_of(scene: Scene) -> System:
    """The scene's chain and effects, ready for the kernels."""
    gravity = scene.effects.gravity
    return System(
        masses=np.array(scene.masses),
        lengths=np.array(scene.lengths),
        gravity=0.0 if gravity is None else float(gravity),
        scratch=np.empty((_SCRATCH_ROWS, scene.n)),
    )
