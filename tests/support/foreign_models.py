"""Model files that other people wrote and ship in their packages; none of them is copied into this repository."""

from __future__ import annotations

import os
import sysconfig
from pathlib import Path

import pytest

#: Where packages may be that were unpacked and not installed: `pip install --no-deps --target FOLDER brax dm-control`.
FOLDER = "PENDBENCH_FOREIGN_MODELS"


def foreign(package: str, *parts: str) -> Path:
    """A file of a package, installed or unpacked; the test is skipped where there is neither."""
    for root in _roots(package):
        if (path := root.joinpath(*parts)).is_file():
            return path
    pytest.skip(f"{'/'.join(parts)} is in the package {package}, which is not installed")


def _roots(package: str) -> list[Path]:
    found = [Path(os.environ[FOLDER], package)] if FOLDER in os.environ else []
    return [*found, Path(sysconfig.get_path("purelib"), package)]
