"""What a rope's motion through the cracks of a whip costs with RATTLE's steps of either kind, and its energy. By hand:

    python benchmarks/ropes.py [LINKS ...]

One metre and one kilogram in so many links, released horizontally, for 10 s, looked at every 1/40 s; steps of 1/480 s
that each method divides as it sees fit. Methods take turns. Each row: the processor time of stepping, and by how much
the energy was off at most, over its scale.
"""

from __future__ import annotations

import sys
from typing import Any, Final

from long_chains import END, rope

from pendbench.engines.recording import simulate
from pendbench.engines.registry import engine
from pendbench.measures.clock import timed
from pendbench.physics.energy import energy, energy_scale
from pendbench.scene.scene import Scene

SIZES: Final = (20, 50, 100, 200, 500)
METHODS: Final = ("rattle", "frame", "adaptive_rattle")
STEPS: Final = 12  # between two looks
DT: Final = 1 / (40 * STEPS)


def measured(scene: Scene, method: str) -> str:
    """Processor time, s, and the largest error in energy."""
    simulation: Any = engine("analytic").build(scene, method, DT)
    start, spent, worst = float(energy(scene, scene.angles, scene.rates)), 0.0, 0.0
    for _ in range(40 * END):
        spent += timed(lambda: simulation.advance(STEPS))[1]
        state = simulation.state()
        worst = max(worst, abs(float(energy(scene, state.theta, state.omega)) - start))
    return f"{spent:.3g} s {worst / energy_scale(scene):.2%}" if simulation.health() is None else "fails"


def main() -> None:
    """Print the table."""
    for method in METHODS:  # what is compiled or loaded is not timed
        simulate(rope(3), method=method, dt=1e-3, times=[1e-3])
    print(f"| links | {' | '.join(METHODS)} |")
    print(f"|---:|{'---|' * len(METHODS)}")
    for n in map(int, sys.argv[1:] or SIZES):
        print(f"| {n} | {' | '.join(measured(rope(n), method) for method in METHODS)} |", flush=True)


if __name__ == "__main__":
    main()
