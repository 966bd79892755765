"""Which of our methods that choose their steps is cheaper, and so is what `simulate` takes by default. By hand:

    python benchmarks/default_method.py

Chains of a metre, released horizontally, up to the end and without a stop. Each cell: what `adaptive` costs at the
error of `taylor` with this tolerance, by interpolation between its own, over what `taylor` costs. Processor time, the
best of five.
"""

from __future__ import annotations

import sys
import time
from typing import Final

import numpy as np

from pendbench.engines.recording import simulate
from pendbench.physics.geometry import distance
from pendbench.scene.scene import Scene, load_scene

SIZES: Final = (1, 2, 3, 5, 10, 20, 50, 100, 200, 300)
TOLERANCES: Final = (1e-3, 1e-6, 1e-9, 1e-12, 1e-14)
FLOOR: Final = 1e-14  # an error below this is rounding


def measured(scene: Scene, method: str, tolerance: float, truth: np.ndarray) -> tuple[float, float]:
    """Processor time, s, and error, in lengths."""
    spent, times = [], [scene.duration]
    for _ in range(5):
        begun = time.thread_time()
        run = simulate(scene, method=method, times=times, tolerance=tolerance)
        spent.append(time.thread_time() - begun)
    return min(spent), max(FLOOR, float(distance(scene.lengths, truth, run.theta[-1] - truth)))


def row(n: int) -> str:
    """A row of the table."""
    scene = load_scene(f"rope{n}").with_(duration=3.0 if n <= 10 else 1.0 if n <= 100 else 0.5)
    truth = simulate(scene, method="taylor", times=[scene.duration], tolerance=1e-15).theta[-1]
    both = {name: [measured(scene, name, tol, truth) for tol in TOLERANCES] for name in ("adaptive", "taylor")}
    costs, errors = (np.log([each[i] for each in both["adaptive"]]) for i in (0, 1))
    cells = []
    for cost, error in both["taylor"]:
        equal = np.exp(np.interp(-np.log(error), np.maximum.accumulate(-errors), costs))
        cells.append(f"{equal / cost:.1f}")
    return f"| {n} | {' | '.join(cells)} |"


def main() -> None:
    """Print the table."""
    for method in ("adaptive", "taylor"):  # what is compiled or loaded is not timed
        simulate(load_scene("rope3"), method=method, times=[1e-3])
    print("| links | " + " | ".join(f"{tolerance:.0e}" for tolerance in TOLERANCES) + " |")
    print("|---:|" + "---:|" * len(TOLERANCES))
    for n in map(int, sys.argv[1:] or SIZES):
        print(row(n), flush=True)


if __name__ == "__main__":
    main()
