"""What holds for every test: numerical errors are loud, plots need no screen, no machine is too slow, pools wait."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from support.lent_pools import LentPool, end_pools

# In CI the examples are the same at every run, so that what fails there fails here; elsewhere they are new ones.
settings.register_profile(
    "any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize="CI" in os.environ
)
settings.load_profile("any machine")

os.environ.setdefault("MPLBACKEND", "Agg")
# A cluster's workers are killed again and again: those of a server that has loaded Dask are there the sooner.
os.environ.setdefault("DASK_DISTRIBUTED__WORKER__MULTIPROCESSING_METHOD", "forkserver")

gc.set_threshold(20_000)  # to look for garbage as often as by default takes a twentieth of the tests' time


@pytest.fixture(scope="session", autouse=True)
def _pools_are_lent() -> Iterator[None]:
    """Studies, questions and gates in this process have their jobs done by workers that are there."""
    with pytest.MonkeyPatch.context() as patch:
        for user in ("commands.run", "engines.gating.gate", "execution.ask"):
            patch.setattr(f"pendbench.{user}.LocalPool", LentPool)
        try:
            yield
        finally:
            end_pools()


@pytest.fixture(autouse=True)
def _numerical_errors_raise() -> Iterator[None]:
    """numpy raises where it would warn. Underflow is no error: it is a zero, as good as any."""  # noqa: D403
    with np.errstate(all="raise", under="ignore"):
        yield
