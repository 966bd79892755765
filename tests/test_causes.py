"""An engine's accelerations are found from its steps alone, and how well they are known is known."""

from __future__ import annotations

import numpy as np
import pytest

from controls import Heavy, Misprint, Single
from pendbench.engines.registry import engine
from pendbench.study.causes import _limit, model_error
from pendbench.study.flags import another_system
from scenes import chain

SPANS = 2.0 ** -np.arange(6)
CHAIN = chain(3, angle=[0.3, -0.2, 1.0], length=[0.5, 0.3, 0.2], mass=[1.0, 0.5, 2.0])


def smooth(span: float) -> np.ndarray:
    return np.array([2.0 + 3.0 * span - 5.0 * span**2, -1.0 + 0.5 * span**3])


def test_the_limit_of_a_smooth_sequence():
    found, known = _limit([smooth(span) for span in SPANS])
    assert found == pytest.approx([2.0, -1.0], abs=1e-13)
    assert known < 1e-12


@pytest.mark.parametrize("noise", [1e-12, 1e-8, 1e-4])
def test_the_limit_of_a_noisy_sequence_is_no_better_than_it_says(noise):
    random = np.random.default_rng(1)
    errors, knowns = [], []
    for _ in range(300):
        found, known = _limit([smooth(span) + noise / span * random.standard_normal(2) for span in SPANS])
        errors.append(np.abs(found - [2.0, -1.0]).max())
        knowns.append(known)
    shares = np.array(errors) / knowns
    assert np.median(shares) < 1.0
    assert np.mean(shares > 10.0) < 0.01  # ten times the limit is what makes another system
    assert np.median(errors) < 100 * noise, "the longest spans, whose noise is least, are not made use of"


def flagged(its: object, method: str, seed: int) -> tuple[float, bool]:
    found = model_error(its, CHAIN, method, {}, seed)
    return found.error, another_system({"model_error": found.error, "model_error_limit": found.limit})


@pytest.mark.parametrize(
    ("name", "method"),
    [("analytic", "adaptive"), ("analytic", "rk4"), ("analytic", "euler"), ("mujoco", "rk4"), ("mujoco", "euler"),
     ("mujoco", "implicit"), ("pymunk", "default"), ("pymunk", "tuned")],
)  # fmt: skip
def test_the_bundled_engines_have_the_equations_accelerations(name, method):
    error, other = flagged(engine(name), method, 3)
    assert error < 1e-6
    assert not other


@pytest.mark.parametrize("seed", range(4))
def test_rounding_is_not_taken_for_another_system(seed):
    error, other = flagged(Single(), "rk4", seed)
    assert error < 1e-2
    assert not other


@pytest.mark.parametrize(("wrong", "least", "most"), [(Heavy, 1e-4, 2e-3), (Misprint, 1e-2, 10.0)])
def test_another_system_is_told_by_its_size(wrong, least, most):
    error, other = flagged(wrong(), "rk4", 3)
    assert least < error < most
    assert other
