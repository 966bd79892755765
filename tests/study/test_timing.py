"""What a study keeps of timings, from timings that the test gives."""

from __future__ import annotations

import math

import pytest

from pendbench.measures.clock import Timing
from pendbench.study import timing
from pendbench.study.case import Case
from pendbench.study.timing import UNTIMED, Timed, measure_timing, measure_timing_with_states
from support.scenes import chain

CASE = Case(chain(1), "analytic", "rk4", 0.01)
#: 50 us a step, 20 steps a sample, spread by 4 %.
FOUND = Timing(step_us=50.0, spread=0.04, steps=20, build_s=2.0, first_call_s=3.0, run_s=0.8)


@pytest.fixture(autouse=True)
def _timed(monkeypatch):
    def time_case(engine, scene, method, dt, settings, until):
        assert (engine.name, scene, method, dt, settings, until) == ("analytic", CASE.scene, "rk4", 0.01, {}, 4.0)
        return FOUND

    def time_each_step(engine, scene, method, dt, settings, interval):
        assert (engine.name, scene, method, dt, settings, interval) == ("analytic", CASE.scene, "rk4", 0.01, {}, 0.5)
        return 70.0

    monkeypatch.setattr(timing, "time_case", time_case)
    monkeypatch.setattr(timing, "time_each_step", time_each_step)


def test_each_number_has_its_place():
    """4 s in 0.8 s are 5 s/s."""
    found = measure_timing(CASE, 4.0)
    assert found == Timed(
        "ok", "", step_us=50.0, step_spread=0.04, simulated_s_per_s=5.0, build_s=2.0, first_call_s=3.0, run_s=0.8,
        step_and_state_us=found.step_and_state_us,
    )  # fmt: skip
    assert math.isnan(found.step_and_state_us)


def test_reading_the_state_is_timed_beside_it():
    found = measure_timing_with_states(CASE, 4.0, 0.5)
    assert (found.step_and_state_us, found.step_us, found.simulated_s_per_s) == (70.0, 50.0, 5.0)


@pytest.mark.parametrize(("spread", "told"), [(0.1, []), (0.101, ["noisy timing: spread 10%"]), (math.nan, [])])
def test_a_timing_that_spreads_by_more_than_a_tenth_is_noisy(spread, told):
    assert list(Timed("ok", step_spread=spread).flags) == told


def test_what_was_to_be_timed_and_was_not_is_told():
    assert list(UNTIMED.flags) == []
    assert list(Timed("timed out", "too slow").flags) == ["not timed: timed out, too slow"]
    assert not Timed("timed out", "too slow").noisy
