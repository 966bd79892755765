"""The tests of the modules that differ from what is committed: what is run for each mutant.

`tests/mutants.toml` says which tests these are, as arguments of pytest, for each module below src/pendbench.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = "src/pendbench"


def changed() -> list[str]:
    """The modules that differ, as paths below src/pendbench."""
    command = ["git", "diff", "--name-only", f"--relative={MODULES}", "--", MODULES]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()


def main() -> int:
    """Run the tests of what differs, of all modules where nothing does; 0 where they pass."""
    tests = tomllib.loads((ROOT / "tests/mutants.toml").read_text())["tests"]
    asked = [tests[module] for module in changed() or tests]
    return max(int(pytest.main(["-q", "-x", *arguments])) for arguments in asked)


if __name__ == "__main__":
    sys.exit(main())
