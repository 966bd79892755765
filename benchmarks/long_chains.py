"""Which method moves a long chain well, at the step of a picture, and what it costs. By hand:

    OPENBLAS_NUM_THREADS=1 python benchmarks/long_chains.py [LINKS ...]

One metre and one kilogram in so many links, released horizontally, for 10 s or until stepping took 20 s of processor
time. Each row: what a simulated second costs, what becomes of the energy, and how far the coarse motion is off in the
first swing. What moves well is defined in docs/measuring.md, "Coarse motion".
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pendbench.engines.recording import simulate
from pendbench.engines.registry import engine
from pendbench.measures.clock import timed
from pendbench.measures.coarse_motion import (
    KNOWN,
    Coarse,
    CoarseErrors,
    coarse_errors,
    coarse_motion,
    first_turn,
    largest_rise,
    why_it_moves_badly,
)
from pendbench.physics.energy import energy, energy_scale
from pendbench.scene.scene import Effects, Scene

SIZES: Final = (100, 1000, 10_000, 30_000)
FRAMES: Final = (240, 100)
END: Final = 10  # s of motion
MOST: Final = 20.0  # s of processor time
SWING: Final = 1.0  # s, in which the rope turns
ACCURATE: Final = 1000  # links, up to which accurate steps are cheap
TOLERANCE: Final = 5e-4  # of the adaptive method, that of the study `scaling`
FINER: Final = 8


def rope(n: int) -> Scene:
    """The chain."""
    each = np.full(n, 1.0 / n)
    return Scene("rope", "", float(END), each, each, np.full(n, 0.5 * math.pi), np.zeros(n), Effects(gravity=9.81))


def truth(scene: Scene, rate: int) -> Coarse | None:
    """The coarse motion at 1/rate s, up to its first turn; None where two finer solutions do not agree."""
    times = np.arange(round(SWING * rate) + 1) / rate
    if scene.n <= ACCURATE:
        runs = [simulate(scene, times=times, tolerance=tolerance) for tolerance in (1e-6, 1e-8)]
    else:
        steps = [1.0 / (rate * finer) for finer in (FINER, 2 * FINER)]
        runs = [simulate(scene, method="bdf2", dt=dt, times=times) for dt in steps]
    if any(run.status != "ok" for run in runs):
        return None
    rough, best = (coarse_motion(scene, run.theta) for run in runs)
    until = first_turn(best) + 1
    best = first(best, until)
    agree = coarse_errors(first(rough, until), best, 1.0).worst
    print(
        f"<!-- {scene.n} links, 1/{rate} s: turns at {times[until - 1]:.3f} s, solutions agree to {agree:.1e} -->",
        flush=True,
    )
    return best if agree < KNOWN else None


def first(motion: Coarse, samples: int) -> Coarse:
    """The first samples of a motion."""
    return Coarse(*(part[:samples] for part in motion))


@dataclass
class Run:
    """How a method fared. reached, spent: simulated and processor time, s. energies: J, at every sample."""

    status: str
    reached: float
    spent: float
    energies: np.ndarray
    gap: float
    swing: Coarse


def run_of(scene: Scene, method: str, dt: float | None, rate: int) -> Run:
    """Run a method, and look at it every 1/rate s; only stepping counts."""
    settings = {"tolerance": TOLERANCE} if dt is None else {}
    simulation: Any = engine("analytic").build(scene, method, dt, **settings)
    stepping: Callable[[int], Any] = (
        (lambda i: simulation.advance_to(i / rate))
        if dt is None
        else (lambda _: simulation.advance(round(1.0 / (rate * dt))))
    )
    spent, worst, status, i = 0.0, 0.0, "ok", 0
    thetas, energies = [scene.angles], [float(energy(scene, scene.angles, scene.rates))]
    while i < END * rate and spent < MOST and status == "ok":
        i += 1
        spent += timed(lambda: stepping(i))[1]  # noqa: B023
        state, fault = simulation.state(), simulation.health()
        with np.errstate(all="ignore"):
            energies.append(float(energy(scene, state.theta, state.omega)))
        worst = max(worst, state.gap)
        if len(thetas) <= SWING * rate:
            thetas.append(state.theta)
        strayed = abs(energies[-1] - energies[0]) > energy_scale(scene)
        status = fault.status if fault else "energy lost" if strayed else "ok"
    return Run(status, i / rate, spent, np.array(energies), worst, coarse_motion(scene, np.array(thetas)))


def row(scene: Scene, method: str, dt: float | None, rate: int, right: Coarse | None) -> str:
    """A row of the table."""
    run, scale = run_of(scene, method, dt, rate), energy_scale(scene)
    samples = len(right.lowest) if right else 0
    known = right is not None and len(run.swing.lowest) >= samples
    errors = coarse_errors(first(run.swing, samples), right, 1.0) if right and known else CoarseErrors()
    lost, rise = (run.energies[0] - run.energies[-1]) / scale, largest_rise(run.energies) / scale
    step = "its own" if dt is None else f"1/{1 / dt:.0f}"
    told = why_it_moves_badly(run.status, rise, run.gap, errors) or "well"
    shares = [lost, rise, *errors] if run.status == "ok" else [math.nan] * 5
    texts = ("" if math.isnan(share) else f"{share:.2%}" for share in shares)
    numbers = f"{run.reached:.3g} | {run.spent / run.reached:.3g} | {' | '.join(texts)}"
    return f"| {scene.n} | {method} | {step} | {numbers} | {told} |"


def main() -> None:
    """Print the table."""
    for method in ("bdf2", "implicit_euler", "rk4", "adaptive"):  # what is compiled or loaded is not timed
        simulate(rope(3), method=method, dt=None if method == "adaptive" else 1e-3, times=[1e-3])
    print("| links | method | step, s | reached, s | s per s | lost | risen | centre | tip | lowest | moves |")
    print("|---:|---|---|---:|---:|---:|---:|---:|---:|---:|---|")
    for n in map(int, sys.argv[1:] or SIZES):
        scene = rope(n)
        for rate in FRAMES:
            right = truth(scene, rate)
            for method in ("bdf2", "implicit_euler", "rk4"):
                print(row(scene, method, 1.0 / rate, rate, right), flush=True)
        right = truth(scene, FRAMES[0])  # rk4's stable step falls like 1/n
        for method, dt in (("rk4", 1.0 / (FRAMES[0] * -(-n // 5))), ("adaptive", None)):
            print(row(scene, method, dt, FRAMES[0], right), flush=True)


if __name__ == "__main__":
    main()
