"""Which of the engine's methods is run where none is named: the cheapest for the scene and its tolerance."""

from __future__ import annotations

from typing import Final

from pendbench.scene.scene import Scene

#: Up to so many links, with a tolerance of so much or less, `taylor` costs less than `adaptive`: docs/speed.md.
CHEAPER: Final = ((10, 1e-9), (100, 1e-13))


def cheapest(scene: Scene, tolerance: float) -> str:
    """`taylor` or `adaptive`: whichever reaches an error of the size of the tolerance at less cost.

    `taylor` knows gravity alone. At looser tolerances than these its errors are several times those of `adaptive`.
    """
    fits = set(scene.terms) <= {"gravity"}
    return "taylor" if fits and any(scene.n <= n and tolerance <= least for n, least in CHEAPER) else "adaptive"
