"""An engine's accelerations are found from its steps alone, and how well they are known is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pendbench.effects import Effects
from pendbench.engines.accelerations import limit
from pendbench.engines.registry import engine
from pendbench.measures import model_error as measures
from pendbench.measures.model_error import model_error
from pendbench.study.case import Case
from pendbench.study.flags import is_another_system
from pendbench.study.models import measure_model
from support.controls import Heavy, Misprint, Single
from support.scenes import chain

SPANS = 2.0 ** -np.arange(6)
CHAIN = chain(3, angle=[0.3, -0.2, 1.0], length=[0.5, 0.3, 0.2], mass=[1.0, 0.5, 2.0])


def smooth(span: float) -> np.ndarray:
    return np.array([2.0 + 3.0 * span - 5.0 * span**2, -1.0 + 0.5 * span**3])


def test_the_limit_of_a_smooth_sequence():
    found, known = limit([smooth(span) for span in SPANS])
    assert found == pytest.approx([2.0, -1.0], abs=1e-13)
    assert known < 1e-12


@pytest.mark.parametrize("noise", [1e-12, 1e-8, 1e-4])
def test_the_limit_of_a_noisy_sequence_is_no_better_than_it_says(noise):
    random = np.random.default_rng(1)
    errors, knowns = [], []
    for _ in range(300):
        found, known = limit([smooth(span) + noise / span * random.standard_normal(2) for span in SPANS])
        errors.append(np.abs(found - [2.0, -1.0]).max())
        knowns.append(known)
    shares = np.array(errors) / knowns
    assert np.median(shares) < 1.0
    assert np.mean(shares > 10.0) < 0.01  # ten times the limit is what makes another system
    assert np.median(errors) < 100 * noise, "the longest spans, whose noise is least, are not made use of"


def flagged(its: object, method: str, seed: int) -> tuple[float, bool]:
    found = model_error(its, CHAIN, method, {}, seed)
    return found.error, is_another_system(found.error, found.limit)


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


def test_where_nothing_accelerates_the_difference_itself_is_told(monkeypatch):
    """A link that nothing pulls at turns on as it does: there is no largest acceleration to compare with."""
    free = dataclasses.replace(chain(1), effects=Effects())
    monkeypatch.setattr(measures, "acceleration_at_start", lambda *_: (np.array([3e-4]), 2e-5))
    assert measures.model_error(engine("analytic"), free, "rk4", {}, 1) == (3e-4, 2e-5)


def test_a_loose_default_is_not_taken_for_another_system():
    """At scipy's own tolerance the accelerations of its LSODA would differ by a percent."""
    found = model_error(engine("scipy"), chain(2), "lsoda", {}, seed=1)
    assert found.error < 1e-6


def test_of_a_method_with_a_plateau_the_difference_is_not_known(monkeypatch):
    its = engine("xpbd")
    soft = {"small_steps": dataclasses.replace(its.methods["small_steps"], plateau=1e-4)}
    monkeypatch.setattr(type(its), "methods", soft)
    found = measure_model(Case(chain(2), "xpbd", "small_steps", None), seed=1)
    assert np.isnan(found.error)
    assert not found.is_another()
