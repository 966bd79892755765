"""Which program this is."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path


@cache
def source_digest() -> str:
    """A hash of the project's own source: results of other code are not taken for results of this one.

    How results are told is no part of it.
    """
    package = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    for source in sorted(set(package.rglob("*.py")) - set((package / "report").rglob("*.py"))):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]
