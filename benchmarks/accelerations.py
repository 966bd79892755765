"""How fast and how exact the analytic engine is, against its targets. By hand: python benchmarks/accelerations.py

Three tables in Markdown: what the accelerations of a chain cost, beside MuJoCo's and Pinocchio's in the same minute;
how many digits they keep where masses and lengths make it hard; and what that comes to over the scenes of the study
"chaos". Pinocchio's columns are empty where it is not installed: pip install "pendbench[pinocchio]".
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import NamedTuple

import mujoco
import numba
import numpy as np
import psutil
from scipy.linalg import LinAlgError

import pendbench as pb
from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled
from pendbench.engines.mujoco.mjcf import alone, compile_chain, joint_values
from pendbench.physics import dense
from pendbench.physics.energy import energy, energy_scale
from pendbench.physics.geometry import distance
from pendbench.physics.kernels.both_ends import write_accelerations
from pendbench.physics.kernels.recursion import accelerations, system_of
from pendbench.physics.kernels.system import System
from pendbench.scene.scene import Scene

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))
from hard_chains import HARD, exact_accelerations, hard_chains, relative_error  # noqa: E402
from scenes import chain  # noqa: E402

try:
    import pinocchio

    from pendbench.engines import pinocchio as aba
except ImportError:
    pinocchio = None

SIZES = (2, 10, 50, 100, 1000, 10_000)
MUJOCO_UP_TO = 1000  # links; its compiler refuses 1024
# Short samples, and many: on a busy machine most of them are then spared, and the median is theirs.
SAMPLE_S = 0.002
REPEATS = 61
NOISY = 0.1

MOST_NS_PER_LINK = 45.0
LEAST_SPEEDUP = 10.0
LEAST_SPEEDUP_OF_ABA, FROM_LINKS = 5.0, 50  # and 1 below that
LARGEST_ERROR = 1e-13
LARGEST_DRIFT = 1e-12
LARGEST_DISTANCE = 1e-10


class Cost(NamedTuple):
    """The median time of a call, s, and the spread of the samples: the middle half of them, over the median."""

    call: float
    spread: float

    @property
    def noise(self) -> str:
        """The spread, and whether it is too large."""
        return f"{self.spread:.0%}{' noisy' if self.spread > NOISY else ''}"


def table(heads: list[str], rows: list[list[str]]) -> None:
    """Print a table in Markdown, aligned for those who read it as it is."""
    widths = [max(len(row[i]) for row in [heads, *rows]) for i in range(len(heads))]
    for row in [heads, ["-" * width for width in widths], *rows]:
        print("| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |", flush=True)
    print()


def verdict(found: float, *, most: float = np.inf, least: float = -np.inf) -> str:
    """Whether a number keeps within its target."""
    return "met" if least <= found <= most else "MISSED"


@compiled
def _accelerate(system: System, theta: FloatArray, omega: FloatArray, out: FloatArray, times: int) -> None:
    """Each call waits for the one before it, as the steps of a solver do."""
    for _ in range(times):
        write_accelerations(system, 0.0, theta, omega, out)
        theta[0] += 1e-15 * out[0]


def ours(scene: Scene) -> Callable[[int], None]:
    """That many calls of the recursion."""
    system, theta, omega, out = system_of(scene), scene.angles.copy(), scene.rates.copy(), np.empty(scene.n)
    return lambda times: _accelerate(system, theta, omega, out, times)


def mujoco_data(scene: Scene) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The chain in MuJoCo, with all that it does not call for disabled."""
    model = compile_chain(scene)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = joint_values(scene.angles), joint_values(scene.rates)
    return model, data


def aba_case(scene: Scene) -> tuple[object, ...]:
    """The arguments of Pinocchio's ABA for the chain."""
    model = aba.chain_model(scene)
    values = aba.joint_values(scene.angles), aba.joint_values(scene.rates)
    return model, model.createData(), *values, np.zeros(scene.n)


def by_aba(arguments: tuple[object, ...]) -> Callable[[int], None]:
    """That many calls of Pinocchio's ABA, from Python."""

    def accelerate(times: int) -> None:
        for _ in range(times):
            pinocchio.aba(*arguments)

    return accelerate


def theirs(scene: Scene) -> Callable[[int], None]:
    """That many calls of MuJoCo's forward dynamics, from Python: there is no native call that makes several."""
    model, data = mujoco_data(scene)

    def forward(times: int) -> None:
        for _ in range(times):
            mujoco.mj_forward(model, data)

    return forward


def nothing(scene: Scene) -> Callable[[int], None]:
    """That many calls of what MuJoCo does for tendons, of which there are none: what a call from Python costs."""
    model, data = mujoco_data(scene)

    def tendons(times: int) -> None:
        for _ in range(times):
            mujoco.mj_tendon(model, data)

    return tendons


def seconds(calls: Callable[[int], None], times: int) -> float:
    """How long that many calls take. Both candidates have one thread, whose clock stops while others have its place."""
    begun = time.thread_time()
    calls(times)
    return time.thread_time() - begun


def costs(*candidates: Callable[[int], None]) -> list[Cost]:
    """What a call of each costs: taken in turn, so that a busy minute strikes all of them."""
    counts = []
    for calls in candidates:
        calls(1)
        times = 1
        while (taken := min(seconds(calls, times) for _ in range(3))) < SAMPLE_S / 8:
            times *= 2
        counts.append(max(1, round(times * SAMPLE_S / taken)))
    samples: list[list[float]] = [[] for _ in candidates]
    for _ in range(REPEATS):
        for i, calls in enumerate(candidates):
            samples[i].append(seconds(calls, counts[i]) / counts[i])
    return [Cost(median(each), float(np.subtract(*np.quantile(each, (0.75, 0.25)))) / median(each)) for each in samples]


def moving_chain(n: int) -> Scene:
    """A chain of n links in disorder."""
    rng = np.random.default_rng(n)
    return chain(n, angle=rng.uniform(-np.pi, np.pi, n), rate=rng.uniform(-5.0, 5.0, n), mass=rng.uniform(0.5, 2.0, n))


def fits_pinocchio(n: int) -> bool:
    """Whether Pinocchio is there, and its data, 32 n^3 bytes, takes less than half of the memory that is free."""
    return pinocchio is not None and 32 * n**3 < psutil.virtual_memory().available / 2


def cells(own: Cost, whole: Cost | None, call: Cost | None, least: float) -> list[str]:
    """What another takes for the same, less what its call from Python costs; five cells, empty where it has none."""
    if whole is None or call is None:
        return [""] * 5
    work = max(whole.call - call.call, 0.0)
    ratio = work / own.call
    return [f"{work * 1e6:.2f}", whole.noise, f"{ratio:.1f}", f"{least:g}", verdict(ratio, least=least)]


def speed_row(n: int) -> list[str]:
    """Cost of the accelerations of one chain."""
    scene, candidates = moving_chain(n), {}
    candidates["own"] = ours(scene)
    if n <= MUJOCO_UP_TO:
        candidates |= {"mujoco": theirs(scene), "a call of it": nothing(scene)}
    if fits_pinocchio(n):
        empty = pinocchio.Model()
        candidates["aba"] = by_aba(aba_case(scene))
        candidates["a call of that"] = by_aba((empty, empty.createData(), *[np.zeros(0)] * 3))
    found = dict(zip(candidates, costs(*candidates.values()), strict=True))
    own = found["own"]
    link = own.call * 1e9 / n
    return [
        str(n),
        f"{own.call * 1e6:.3f}",
        f"{link:.1f}",
        f"{MOST_NS_PER_LINK:g}",
        own.noise,
        verdict(link, most=MOST_NS_PER_LINK),
        *cells(own, found.get("mujoco"), found.get("a call of it"), LEAST_SPEEDUP),
        *cells(own, found.get("aba"), found.get("a call of that"), LEAST_SPEEDUP_OF_ABA if n >= FROM_LINKS else 1.0),
    ]


def speed_table() -> None:
    """Cost of the accelerations."""
    print(f"### Cost of the accelerations (time of one thread, medians of {REPEATS} samples, in turn)\n")
    heads = ["n", "us", "ns per link", "at most", "spread", "verdict"]
    beside = ["spread", "ratio", "at least", "verdict"]
    table([*heads, "MuJoCo, us", *beside, "Pinocchio, us", *beside], [speed_row(n) for n in SIZES])
    print("MuJoCo: mj_forward, all that the chain does not call for disabled, less what a call from Python costs.")
    print("Pinocchio: aba, less what a call for a model without joints costs; its data takes 32 n^3 bytes.\n")


def mujoco_accelerations(scene: Scene) -> FloatArray:
    """The rods' angular accelerations (n,) as MuJoCo has them."""
    with alone():
        model, data = mujoco_data(scene)
        mujoco.mj_forward(model, data)
    found: FloatArray = np.cumsum(data.qacc)
    return found


def aba_accelerations(scene: Scene) -> FloatArray:
    """The rods' angular accelerations (n,) as Pinocchio's ABA has them."""
    found: FloatArray = np.cumsum(pinocchio.aba(*aba_case(scene)))
    return found


def worst_error(function: Callable[[Scene], FloatArray], cases: list[tuple[Scene, list]]) -> tuple[float, float]:
    """The largest and the median error; inf where there is no result at all."""
    errors = []
    for scene, exact in cases:
        try:
            found = function(scene)
        except LinAlgError:
            errors.append(np.inf)
        else:
            errors.append(relative_error(found, exact) if np.isfinite(found).all() else np.inf)
    return max(errors), median(errors)


def error_table(seeds: int) -> None:
    """Errors of the accelerations over the table of hard chains."""
    rows = []
    for kind in HARD:
        cases = [(scene, exact_accelerations(scene)) for scene in hard_chains(kind, range(seeds))]
        worst, middle = worst_error(lambda s: accelerations(s, s.angles, s.rates), cases)
        with np.errstate(all="ignore"):
            cholesky, _ = worst_error(lambda s: dense.accelerations(s, s.angles, s.rates), cases)
            other, _ = worst_error(mujoco_accelerations, cases)
            by_joints = f"{worst_error(aba_accelerations, cases)[0]:.1e}" if pinocchio else ""
        rows.append(
            [
                kind,
                f"{worst:.1e}",
                f"{middle:.1e}",
                f"{LARGEST_ERROR:.0e}",
                verdict(worst, most=LARGEST_ERROR),
                f"{cholesky:.1e}",
                f"{other:.1e}",
                by_joints,
            ]
        )
    print(f"### Relative error against 50 digits ({len(cases)} states each, n = 5 to 20; largest component)\n")
    table(["masses and shape", "worst", "median", "at most", "verdict", "dense Cholesky", "MuJoCo", "Pinocchio"], rows)


def scene_table() -> None:
    """Energy drift over the whole scene, and distance from the truth up to half its horizon."""
    study = tomllib.loads((ROOT / "studies/chaos.toml").read_text(encoding="utf-8"))
    rows = []
    for name in study["scenes"]:
        scene = pb.load_scene(name)
        truth = pb.reference(scene)
        run = pb.simulate(scene, engine="analytic", times=truth.t)
        whole = pb.simulate(scene, engine="analytic")
        for failed in (run, whole):
            if failed.status != "ok":
                sys.exit(f"{name}: {failed.status}: {failed.reason}")
        found = energy(scene, whole.theta, whole.omega)
        drift = float(np.abs(found - found[0]).max() / energy_scale(scene))
        apart = distance(scene.lengths, truth.theta, truth.offset(run.theta))
        error = float(apart[truth.t <= truth.horizon / 2].max())
        rows.append(
            [
                name,
                str(whole.steps),
                f"{drift:.1e}",
                f"{LARGEST_DRIFT:.0e}",
                verdict(drift, most=LARGEST_DRIFT),
                f"{truth.horizon:.2f}",
                f"{truth.error:.0e}",
                f"{error:.1e}",
                f"{LARGEST_DISTANCE:.0e}",
                verdict(error, most=LARGEST_DISTANCE),
            ]
        )
    print("### Method `adaptive` with its defaults, on the scenes of the study `chaos`\n")
    table(
        [
            "scene",
            "steps",
            "energy drift",
            "at most",
            "verdict",
            "horizon, s",
            "truth's error",
            "e up to half of it",
            "at most",
            "verdict",
        ],
        rows,
    )


def main(argv: list[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100, help="states of each kind and size (default: %(default)s)")
    seeds = parser.parse_args(argv).seeds
    versions = f"pendbench {pb.__version__}, numba {numba.__version__}, MuJoCo {mujoco.__version__}"
    versions += f", Pinocchio {pinocchio.__version__}" if pinocchio else ""
    print(f"{versions}, Python {platform.python_version()}, {platform.machine()}, {os.cpu_count()} processors", end="")
    print(f", load {os.getloadavg()[0]:.1f}\n" if hasattr(os, "getloadavg") else "\n")
    speed_table()
    error_table(seeds)
    scene_table()


if __name__ == "__main__":
    main()
