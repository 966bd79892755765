"""The conformance kit on every engine that is installed, each method of each: what CI does for the light ones.

    python benchmarks/league_kit.py [ENGINE ...] [--python ENGINE=PATH ...]

For people who have them; with no engine named, all that are there. It says how many checks each passed, and every one
that failed with its number and cause; what is not installed is said and left out. Exit code 1 if any failed. Engines
that compile for each chain, as Newton and MJX, take many minutes: the first of their checks may be given up for time,
and is passed when asked again.
"""

from __future__ import annotations

import argparse
import sys

sys.path.pop(0)  # this folder's: its profile.py is not the one that an engine imports

import pendbench as pb
from pendbench.engines.elsewhere import use
from pendbench.engines.registry import engine_names
from pendbench.study.absent import why_absent

TIME_LIMIT_S = 120.0


def main() -> int:
    """Ask each engine, one after the other."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("engines", nargs="*", metavar="ENGINE")
    options.add_argument("--python", action="append", default=[], metavar="ENGINE=PATH")
    chosen = options.parse_args()
    use(chosen.python, engine_names())
    names = chosen.engines or engine_names()
    absent = why_absent(names, apart=True)
    for name, why in absent.items():
        print(f"{name}: not here, {why}", flush=True)
    return 1 if sum([_failed(name) for name in names if name not in absent]) else 0


def _failed(name: str) -> int:
    """How many checks an engine failed."""
    found = pb.gate(name, time_limit=TIME_LIMIT_S)
    print(f"{name} {found.version}: {len(found.checks) - len(found.failures)} of {len(found.checks)} checks passed")
    for each in found.failures:
        print(f"  {each}", flush=True)
    return len(found.failures)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except pb.InputError as error:
        sys.exit(f"error: {error}")
