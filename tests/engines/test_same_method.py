"""Two implementations of one method on one system differ by rounding."""

from __future__ import annotations

import numpy as np
import pytest

from pendbench.engines.recording import simulate
from support.scenes import chain


@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_mujoco_and_the_analytic_engine_are_the_same_to_rounding(method: str) -> None:
    scene = chain(5, length=1.0, duration=1.0)
    runs = [simulate(scene, engine, method, 1e-3, [0.5, 1.0]) for engine in ("analytic", "mujoco")]
    assert np.abs(runs[0].theta[-1] - scene.angles).max() > 0.1  # it moved
    assert np.abs(runs[0].theta - runs[1].theta).max() < 1e-12
    assert np.abs(runs[0].omega - runs[1].omega).max() < 1e-11  # rates are ten times larger


def test_another_method_is_not() -> None:
    """What the test before would see of a method that differs."""
    scene = chain(5, length=1.0, duration=1.0)
    runs = [simulate(scene, "mujoco", method, 1e-3, [1.0]) for method in ("euler", "implicit")]
    assert np.abs(runs[0].theta - runs[1].theta).max() > 1e-6
