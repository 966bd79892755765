"""What a method offers in a scene, from its cases coarse to fine: each number worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pendbench.kinds.cost.series import Measured, Series, series_of
from pendbench.kinds.cost.study import Window
from pendbench.kinds.cost.work import ErrorRun
from pendbench.scene.scene import load_scene
from pendbench.study.case import Case
from pendbench.study.timing import UNTIMED, Timed
from pendbench.study.truths import KeptTruth

CASE = Case(load_scene("double"), "mujoco", "rk4", 0.4)
#: The coarsest step first: its step, error and cost, s. The last was not timed.
RUNS = ((0.4, 1e-2, 1.0), (0.2, 1e-5, 2.0), (0.1, 1e-3, 4.0), (0.05, 1e-4, 8.0), (0.025, 1e-7, math.nan))


def measured(dt, error, run_s):
    timing = UNTIMED if math.isnan(run_s) else Timed("ok", run_s=run_s, step_us=3.0, step_and_state_us=5.0)
    truth = KeptTruth("ok", horizon=9.0)
    return Measured(replace(CASE, dt=dt), Window(time=2.0, samples=50), truth, ErrorRun("ok", error_max=error), timing)


ROWS = [measured(*run) for run in RUNS]
SERIES = series_of([ROWS[i] for i in (2, 0, 4, 1, 3)])[ROWS[0].case]


def test_the_coarsest_comes_first_and_what_was_not_timed_offers_nothing():
    assert [row.case.dt for row in SERIES.rows] == [0.4, 0.2, 0.1, 0.05, 0.025]
    assert list(SERIES.steps) == [0.4, 0.2, 0.1, 0.05]
    assert list(SERIES.errors) == [1e-2, 1e-5, 1e-3, 1e-4]
    assert list(SERIES.costs) == [1.0, 2.0, 4.0, 8.0]


def test_the_finest_error_is_that_of_the_finest_step_and_the_best_the_smallest():
    assert (SERIES.finest_error, SERIES.best_error) == (1e-4, 1e-5)
    none = Series((ROWS[-1],))
    assert math.isnan(none.finest_error)
    assert math.isnan(none.best_error)


def test_beside_a_step_are_the_next_coarser_and_the_next_finer():
    assert [row.case.dt for row in SERIES.beside(0.15)] == [0.2, 0.1]
    assert [row.case.dt for row in SERIES.beside(0.1)] == [0.1]
    assert [row.case.dt for row in SERIES.beside(0.5)] == [0.4]
    assert [row.case.dt for row in SERIES.beside(0.03)] == [0.05]


def test_who_reads_every_state_pays_for_each_step():
    """5 us for each of the 20 steps to 2 s; of a method without steps, for each of 50 samples."""
    assert ROWS[2].with_states_s == pytest.approx(20 * 5e-6)
    adaptive = replace(ROWS[2], case=Case(load_scene("double"), "analytic", "adaptive", None))
    assert adaptive.with_states_s == pytest.approx(50 * 5e-6)
