"""What a second thread gains for the implicit methods of long chains. By hand:

    python benchmarks/two_threads.py [LINKS ...]

One metre and one kilogram in so many links, released horizontally, in steps of 1/240 s. Milliseconds for a step by the
clock with one thread and with two, medians of runs that take turns.
"""

from __future__ import annotations

import sys
import time
from typing import Final

import numpy as np

from pendbench.engines.registry import engine
from pendbench.scene.scene import Effects, Scene

SIZES: Final = (5_000, 10_000, 20_000, 50_000, 100_000, 200_000)
METHODS: Final = ("implicit_euler", "bdf2", "energy_momentum")
FRAME: Final = 1 / 240  # s
STEPS: Final = 60
TURNS: Final = 5


def rope(links: int) -> Scene:
    """The chain, and its start."""
    return Scene(
        name="rope",
        title="A rope released horizontally",
        duration=1.0,
        masses=np.full(links, 1.0 / links),
        lengths=np.full(links, 1.0 / links),
        angles=np.full(links, np.pi / 2),
        rates=np.zeros(links),
        effects=Effects(gravity=9.81),
    )


def milliseconds(scene: Scene, method: str, threads: int) -> float:
    """What a step takes, the first one left out."""
    run = engine("analytic").build(scene, method, FRAME, threads=threads)
    run.advance(1)
    begun = time.perf_counter()
    run.advance(STEPS)
    taken = time.perf_counter() - begun
    if run.health() is not None:
        raise RuntimeError(f"{method} with {scene.n} links: {run.health()}")
    return 1e3 * taken / STEPS


def main() -> None:
    """Print the table."""
    print(f"{'links':>8} {'method':<16} {'one':>8} {'two':>8}  gain")
    for links in map(int, sys.argv[1:]) if len(sys.argv) > 1 else SIZES:
        scene = rope(links)
        for method in METHODS:
            turns = [[milliseconds(scene, method, threads) for threads in (1, 2)] for _ in range(TURNS)]
            one, two = np.median(turns, axis=0)
            print(f"{links:>8} {method:<16} {one:8.3f} {two:8.3f}  {one / two:.2f}")


if __name__ == "__main__":
    main()
