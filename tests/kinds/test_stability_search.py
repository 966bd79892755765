"""The search for the largest stable step: what it tries, what it finds, and what it leaves open."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendbench.kinds.stability.search import Bounds, is_bound, is_open, largest, next_step

BOUNDS = Bounds(coarsest=3.0, finest=1e-5)


def searched(verdict_of, first=(1.0, 0.2, 0.05), bounds=BOUNDS):
    tried = {dt: verdict_of(dt) for dt in first}
    while (dt := next_step(tried, bounds)) is not None:
        assert dt not in tried, "nothing is tried twice"
        tried[dt] = verdict_of(dt)
    return tried


def up_to(limit):
    return lambda dt: "holds" if dt <= limit else "breaks"


@given(limit=st.floats(min_value=1e-4, max_value=1.99))  # at 2 s the search is at its coarsest step
def test_any_limit_is_found_to_a_tenth(limit):
    tried = searched(up_to(limit))
    assert limit / 1.1 - 1e-4 * limit <= largest(tried) <= limit
    assert not is_bound(tried)
    assert not is_open(tried, BOUNDS)


def test_where_the_coarsest_step_holds_it_is_a_bound():
    tried = searched(up_to(math.inf))
    assert 1.5 < largest(tried) <= 3.0
    assert is_bound(tried)


def test_where_nothing_holds_the_finest_step_ends_it():
    tried = searched(up_to(0.0))
    assert math.isnan(largest(tried))
    assert BOUNDS.finest <= min(tried) < 5 * BOUNDS.finest
    assert not is_open(tried, BOUNDS)


def test_a_limit_of_work_leaves_it_open():
    """Steps below 1e-3 s are too much work: what holds at 1e-4 s is not found, and nobody says that nothing holds."""
    tried = searched(up_to(1e-4), bounds=Bounds(3.0, 1e-3))
    assert min(tried) >= 1e-3
    assert math.isnan(largest(tried))
    assert is_open(tried, BOUNDS)


@pytest.mark.parametrize("stopped", ["timed out", "out of memory"])
def test_a_coarse_step_that_was_stopped_condemns_no_finer_one(stopped):
    tried = searched(lambda dt: stopped if dt == 1.0 else up_to(0.01)(dt))
    assert "holds" in tried.values()
    assert math.isnan(largest(tried))  # the step that was stopped might hold
    assert is_open(tried, BOUNDS)


def test_no_more_is_tried_where_it_could_not_be_given():
    tried = searched(lambda dt: {1.0: "breaks", 0.2: "timed out"}.get(dt, "holds"))
    assert set(tried) == {1.0, 0.2, 0.05}


def test_a_fine_step_that_was_stopped_changes_nothing_where_a_coarser_one_holds():
    slow = searched(lambda dt: "timed out" if dt < 0.1 else up_to(0.7)(dt))
    assert largest(slow) == largest(searched(up_to(0.7)))
    assert not is_open(slow, BOUNDS)


def test_a_fine_step_that_was_stopped_ends_a_search_that_nothing_holds():
    tried = searched(lambda dt: "timed out" if dt < 0.1 else "drifts")
    assert tried == {1.0: "drifts", 0.2: "drifts", 0.05: "timed out"}
    assert is_open(tried, BOUNDS)


@given(limit=st.floats(min_value=1e-4, max_value=1.99), stopped=st.sets(st.floats(min_value=1e-5, max_value=3.0)))
def test_a_largest_step_never_depends_on_what_was_stopped(limit, stopped):
    """It is the one that an idle machine finds, or none: whichever steps are stopped, those of the plan among them."""
    idle = searched(up_to(limit))
    among = sorted(idle)
    hit = {min(among, key=lambda dt: abs(dt - each)) for each in stopped}
    busy = searched(lambda dt: "timed out" if dt in hit else up_to(limit)(dt))
    assert math.isnan(largest(busy)) or largest(busy) == largest(idle)


def test_the_largest_unbroken_step_may_drift():
    tried = {1.0: "breaks", 0.2: "drifts", 0.05: "holds"}
    assert largest(tried, ("holds", "drifts")) == 0.2
    assert math.isnan(largest(tried | {1.0: "timed out"}, ("holds", "drifts")))
