"""What a reader is told about a row: each flag at its limit."""

from __future__ import annotations

import math

import pytest

from pendbench.study.flags import is_another_system, of_steps, order_differs, too_good


@pytest.mark.parametrize(
    ("error", "limit", "other"),
    [
        (0.9e-6, 0.0, False),
        (1.1e-6, 0.0, True),
        (9e-6, 1e-6, False),
        (9.9e-6, 1e-6, False),
        (1.1e-5, 1e-6, True),
        (math.nan, 1e-6, False),
    ],
)
def test_another_system_is_off_by_a_millionth_and_by_ten_times_what_is_known(error, limit, other):
    assert is_another_system(error, limit) == other


@pytest.mark.parametrize(
    ("claimed", "observed", "differs"),
    [(4, 3.81, False), (4, 3.79, True), (4, 4.19, False), (4, 4.21, True), (4, math.nan, False), (None, 1.0, False)],
)
def test_an_order_may_be_off_by_a_fifth(claimed, observed, differs):
    assert order_differs(claimed, observed) == differs
    told = [f"order {observed:.1f} where 4 is claimed"] if differs else []
    assert list(of_steps(claimed, observed, math.nan)) == told


@pytest.mark.parametrize(
    ("finest", "more"),
    [(math.nan, ""), (2e-2, ""), (9.9e-2, ""), (1.1e-1, ", and is 1.1e-01 with the finest step")],
)
def test_a_plateau_tells_of_the_finest_step_where_that_is_ten_times_worse(finest, more):
    assert list(of_steps(4, 4.0, 1e-2, finest)) == [f"plateau: the error stops at 1.0e-02{more}"]


@pytest.mark.parametrize(
    ("largest", "error", "seen", "told"),
    [
        (0.0, 0.0, "", "too good: no error at all"),
        (1e-9, 0.9e-11, "", "too good: as near to the reference as that is known"),
        (1e-9, 1.01e-11, "", None),
        (1e-9, 1.1e-11, "no steps", "too good: no steps"),
    ],
)
def test_too_good_is_within_ten_times_what_is_known(largest, error, seen, told):
    assert list(too_good(largest, error, 1e-12, seen)) == ([told] if told else [])
