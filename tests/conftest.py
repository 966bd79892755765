"""What holds for every test: numerical errors are loud, and plots need no screen."""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np
import pytest

os.environ.setdefault("MPLBACKEND", "Agg")


@pytest.fixture(autouse=True)
def _numerical_errors_raise() -> Iterator[None]:
    """numpy raises where it would warn. Underflow is no error: it is a zero, as good as any."""  # noqa: D403
    with np.errstate(all="raise", under="ignore"):
        yield
