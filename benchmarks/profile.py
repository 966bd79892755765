"""Where the time of the accelerations goes, and what many chains at once cost. By hand: python benchmarks/profile.py

Two tables in Markdown. The first takes one chain's recursion apart: sines and cosines of the bends, the tensions
from both ends, and what follows from them. The second runs many chains in vector registers, on one thread and on two.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from statistics import median
from typing import Any, Final

import numpy as np

from pendbench.base.compiled import compiled_for_threads
from pendbench.physics.kernels.both_ends import write_accelerations, write_tensions
from pendbench.physics.kernels.ensemble import write_ensemble_accelerations
from pendbench.physics.kernels.scratch import ACROSS, COSINE, SINE
from pendbench.physics.kernels.table import ensemble_system_of, system_of
from pendbench.scene.scene import Effects, Scene
from pendbench.solvers.trigonometry import write_bends

SIZES: Final = (2, 10, 100, 1000, 10_000, 100_000)
MANY: Final = (2, 10, 100)
LANES: Final = 64
REPEATS: Final = 15
SAMPLE_LINKS: Final = 1_000_000  # in one sample


@compiled_for_threads
def bends(system: Any, theta: Any, omega: Any, out: Any, times: int) -> None:  # noqa: ARG001
    """Sines and cosines alone."""
    for _ in range(times):
        write_bends(theta, system.scratch, COSINE, SINE)
        theta[0] += 1e-12


@compiled_for_threads
def tensions(system: Any, theta: Any, omega: Any, out: Any, times: int) -> None:  # noqa: ARG001
    """Sines and cosines, and the tensions."""
    tip = len(theta) - 1
    for _ in range(times):
        write_bends(theta, system.scratch, COSINE, SINE)
        system.scratch[COSINE, tip], system.scratch[ACROSS, tip] = 0.0, 1.0
        write_tensions(system, omega, 1.0)
        theta[0] += 1e-12


@compiled_for_threads
def whole(system: Any, theta: Any, omega: Any, out: Any, times: int) -> None:
    """All of it."""
    for _ in range(times):
        write_accelerations(system, 0.0, theta, omega, out)
        theta[0] += 1e-12


@compiled_for_threads
def side_by_side(system: Any, theta: Any, omega: Any, out: Any, times: int) -> None:
    """Many chains at once."""
    for _ in range(times):
        write_ensemble_accelerations(system, theta, omega, out)
        theta[0, 0] += 1e-12


def chain(n: int) -> Scene:
    """One metre of bent chain in motion."""
    each = np.full(n, 1.0 / n)
    return Scene("chain", "", 1.0, each, each, np.linspace(0.0, 2.0, n), np.ones(n), Effects(gravity=9.81))


def per_link(call: Callable[[int], None], links: float) -> float:
    """The median time, ns, for each link of a call that is told how often to repeat itself."""
    times = max(1, round(SAMPLE_LINKS / links))
    call(1)
    samples = []
    for _ in range(REPEATS):
        begun = time.perf_counter()
        call(times)
        samples.append((time.perf_counter() - begun) / times / links)
    return 1e9 * median(samples)


def phases(n: int) -> list[float]:
    """For each link, ns: bends, tensions, what follows from them, all."""
    scene = chain(n)
    arguments = (system_of(scene), scene.angles.copy(), scene.rates.copy(), np.zeros(n))
    first, second, third = (per_link(lambda times, f=f: f(*arguments, times), n) for f in (bends, tensions, whole))
    return [first, second - first, third - second, third]


def many(n: int) -> tuple[float, float]:
    """For each link and chain, ns, on one thread, and how many times as much two threads do."""
    scene, rng = chain(n), np.random.default_rng(1)

    def arguments() -> tuple[Any, ...]:
        theta, omega = rng.uniform(-3, 3, (n, LANES)), rng.uniform(-3, 3, (n, LANES))
        return ensemble_system_of(scene, LANES), theta, omega, np.zeros((n, LANES))

    mine = [arguments(), arguments()]
    one = per_link(lambda times: side_by_side(*mine[0], times), n * LANES)
    with ThreadPoolExecutor(2) as pool:

        def both(times: int) -> None:
            list(pool.map(lambda each: side_by_side(*each, times), mine))

        two = per_link(both, n * LANES / 20)  # as many times longer: threads take a while to start
    return one, 2.0 * one / (two / 20)


def main() -> None:
    """Print the tables."""
    print(f"{os.cpu_count()} processors; load {os.getloadavg()[0]:.1f}; ns for each link, medians of {REPEATS}.\n")
    print("| n | sines and cosines | tensions | accelerations | all |\n| ---: | ---: | ---: | ---: | ---: |")
    for n in SIZES:
        print(f"| {n} | " + " | ".join(f"{value:.2f}" for value in phases(n)) + " |", flush=True)
    print(
        f"\n{LANES} chains side by side:\n\n| n | ns for each link and chain | two threads do |\n| ---: | ---: | ---: |"
    )
    for n in MANY:
        cost, gain = many(n)
        print(f"| {n} | {cost:.2f} | {gain:.2f} times as much |", flush=True)


if __name__ == "__main__":
    main()
