"""How far a run is from its truth, by hand; and what is kept of a truth."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from pendbench.base.errors import InputError
from pendbench.scene.trajectory import Trajectory
from pendbench.study import truths
from pendbench.study.case import Case
from pendbench.study.truths import Compared, KeptTruth, compare, measure_truth, suspicion
from support.scenes import chain

SCENE = chain(2, length=0.5)


def run_of(t, theta, steps=None):
    theta = np.array(theta)
    return Trajectory(np.array(t), theta, np.zeros_like(theta), np.zeros(len(t)), steps=steps)


def truth_of(t, theta, low=0.0):
    theta = np.array(theta)
    return KeptTruth("ok", t=np.array(t), theta=theta, theta_low=np.full_like(theta, low), omega=np.zeros_like(theta),
                     bound=1e-12 * np.arange(1.0, len(t) + 1.0))  # fmt: skip


def test_a_run_is_compared_at_the_times_that_both_have():
    """The second rod is off by 0.1 rad, then by a turn and 0.2: its end by 2 (1/2) sin(0.05) and by sin(0.1)."""
    truth = truth_of([0.0, 0.5, 1.0, 1.5], [[0.3, 0.0], [0.4, 0.5], [0.0, 0.0], [0.5, 1.0]])
    run = run_of([0.5, 1.5, 2.0], [[0.4, 0.6], [0.5, 1.2 + 2 * math.pi], [9.0, 9.0]])
    found = compare(SCENE, run, truth)
    np.testing.assert_array_equal(found.t, [0.5, 1.5])
    np.testing.assert_allclose(found.error, [math.sin(0.05), math.sin(0.1)], rtol=1e-12)
    np.testing.assert_allclose(found.angle_error, [0.1, 0.2], rtol=1e-12)
    np.testing.assert_array_equal(found.known, [2e-12, 4e-12])
    np.testing.assert_allclose(found.offset, [[0.0, 0.1], [0.0, 0.2 + 2 * math.pi]], atol=1e-15)
    np.testing.assert_array_equal(found.theta, truth.theta[[1, 3]])


def test_what_double_precision_leaves_out_of_the_truth_counts():
    found = compare(SCENE, run_of([1.0], [[0.3, 0.4]]), truth_of([1.0], [[0.3, 0.4]], low=-1e-18))
    np.testing.assert_array_equal(found.offset, [[1e-18, 1e-18]])
    tip = np.hypot(math.cos(0.3) + math.cos(0.4), math.sin(0.3) + math.sin(0.4))
    assert found.error[0] == pytest.approx(0.5e-18 * tip)


def test_without_a_truth_there_is_nothing_to_compare():
    found = compare(SCENE, run_of([0.5], [[0.3, 0.0]]), truth_of(np.zeros(0), np.zeros((0, 2))))
    assert [len(values) for values in found] == [0] * 6


def seen(steps=None, t=(0.0, 0.5, 1.0), method="rk4", samples=16, off=0.0):
    theta = np.ones((samples, 1))
    compared = Compared(np.zeros(samples), *(np.zeros(samples) for _ in range(3)), np.full_like(theta, off), theta)
    case = Case(SCENE, "analytic", method, 0.1)
    return suspicion(case, run_of(t, np.zeros((len(t), 2)), steps), compared)


@pytest.mark.parametrize(
    ("method", "t", "steps", "told"),
    [
        ("rk4", (0.0, 0.5, 1.0), 1, "1 steps to 2 different times"),  # at rest in no steps: the start counts for none
        ("rk4", (0.0, 0.5, 1.0), 2, ""),
        ("rk4", (0.0, 0.5, 1.0), 30, ""),
        ("rk4", (0.0, 0.5, 1.0), None, ""),  # an engine that does not say
        ("taylor", (0.0, 0.5, 1.0), 1, ""),  # several times in one of its steps
        ("taylor", (0.0, 0.5, 1.0), 0, "0 steps to 2 different times"),
        ("taylor", (0.0,), 0, ""),
        ("rk4", (0.0,), 0, ""),
    ],
)
def test_a_step_leads_to_one_time_unless_it_is_dense(method, t, steps, told):
    assert seen(steps, t, method, off=1.0) == told


@pytest.mark.parametrize(
    ("samples", "off", "told"),
    [(16, 0.5, True), (16, -0.5, True), (16, 0.51, False), (15, 0.0, False), (17, 0.0, True)],
)
def test_sixteen_samples_within_rounding_are_the_truth_itself(samples, off, told):
    """Of angles of 1 rad, whose neighbours are 2.2e-16 away."""
    assert seen(samples=samples, off=off * 2.0**-52) == ("the truth, to the last bit" if told else "")


def test_one_sample_that_is_off_clears_a_run():
    theta = np.ones((20, 2))
    offset = np.zeros((20, 2))
    offset[7, 1] = 1e-15
    none = np.zeros(20)
    compared = Compared(none, none, none, none, offset, theta)
    assert not suspicion(Case(SCENE, "analytic", "rk4", 0.1), run_of([0.0], [[0.0, 0.0]]), compared)


def test_a_truth_is_kept_as_the_reference_gave_it(monkeypatch):
    given = SimpleNamespace(
        status="timed out", reason="too slow", horizon=1.5, error=np.float64(1e-12), t=[1], theta=[2], theta_low=[3],
        omega=[4], bound=[5],
    )  # fmt: skip
    monkeypatch.setattr(truths, "reference_within", lambda *_: given)
    kept = measure_truth(SCENE, np.array([1.0]))
    for name in vars(given):
        assert getattr(kept, name) == getattr(given, name)


def test_a_reference_that_refuses_leaves_nothing_but_a_reason(monkeypatch):
    def refuses(*_):
        raise InputError("links is 400; allowed: up to 300")

    monkeypatch.setattr(truths, "reference_within", refuses)
    kept = measure_truth(SCENE, np.array([1.0]))
    assert (kept.status, kept.reason) == ("refused", "links is 400; allowed: up to 300")
    assert math.isnan(kept.horizon)
    assert math.isnan(kept.error)
    assert kept.t.shape == kept.bound.shape == (0,)
    assert kept.theta.shape == kept.theta_low.shape == kept.omega.shape == (0, 0)
