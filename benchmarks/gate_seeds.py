"""Does the gate blame a sound engine whose only fault is other random states?

By hand: python benchmarks/gate_seeds.py [SEEDS] [ENGINES]. Of the gate's checks two draw from the seed; all others
ask the same whatever it is, so each seed is asked these of every method, one after the other. A line for each blame,
and for each engine how many seeds it was asked and how near to a limit it came.
"""

from __future__ import annotations

import sys

from pendbench.base.errors import MissingEngineError
from pendbench.engines.conformance import checks_of
from pendbench.engines.conformance.check import SKIPPED, Subject, findings
from pendbench.engines.registry import engine

DRAWS = ("is the same system", "is smooth")


def main(seeds: int, names: list[str]) -> int:
    """Ask, and return how often an engine was blamed."""
    blamed = asked = 0
    for name in names:
        try:
            its = engine(name)
        except MissingEngineError:
            print(f"{name}: not installed")
            continue
        nearest, where, own = 0.0, "", 0
        for seed in range(1, seeds + 1):
            bad = 0
            for method in its.methods:
                for one in (each for each in checks_of(method) if each.name in DRAWS):
                    for found in findings(one, Subject(its, method, seed)):
                        bad += not found.good
                        if not found.good:
                            print(f"blamed: {name} seed {seed}: {found.line}", flush=True)
                        if found.status != SKIPPED and found.limit > 0 and found.value / found.limit > nearest:
                            nearest = found.value / found.limit
                            where = f"{method}, {found.check}, {found.about}, seed {seed}"
            own += bad > 0
        asked, blamed = asked + seeds, blamed + own
        print(f"{name}: {seeds} seeds, {own} blamed; at most {nearest:.2g} of a limit ({where})", flush=True)
    print(f"{asked} runs, {blamed} blamed")
    return blamed


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    chosen = sys.argv[2].split(",") if len(sys.argv) > 2 else ["analytic", "mujoco", "pymunk", "scipy", "xpbd"]
    sys.exit(1 if main(count, chosen) else 0)
