"""Which step is tried next, and which is recommended, on errors made up by hand."""

from __future__ import annotations

import math

import pytest

from pendbench.kinds.judge import ladder


def climbed(error_of, goal, last):
    """What a ladder has tried when it stops, for a method with the errors that `error_of` gives for each rung."""
    errors = {}
    while (rung := ladder.next_rung(errors, goal, last)) is not None:
        errors[rung] = error_of(rung)
    return errors


def test_steps_are_halves_of_the_interval_to_the_last_bit():
    assert [ladder.step(0.1, rung) for rung in range(4)] == [0.1, 0.05, 0.025, 0.0125]
    for rung in range(20):  # so that all runs have the very times of the comparison
        assert 37 * 2**rung * ladder.step(0.1, rung) == 37 * 0.1


def test_tolerances_are_powers_of_ten():
    assert [ladder.tolerance(rung) for rung in (0, 1, 12)] == [1e-2, 1e-3, 1e-14]
    assert ladder.tolerance(ladder.last_tolerance()) == 1e-14


def test_two_rungs_in_a_row_are_needed_and_the_coarser_is_recommended():
    errors = climbed(lambda rung: 0.1 / 4.0**rung, 1e-3, 20)  # 0.1, 0.025, 6e-3, 1.6e-3, 4e-4, 1e-4
    assert max(errors) == 5
    assert ladder.recommended(errors, 1e-3, 20) == 4


def test_a_coarse_step_that_is_good_by_chance_is_not_recommended():
    by_chance = {0: 1e-4, 1: 0.3, 2: 0.02, 3: 5e-4, 4: 1e-4}
    errors = climbed(by_chance.__getitem__, 1e-3, 20)
    assert errors == by_chance
    assert ladder.recommended(errors, 1e-3, 20) == 3


def test_a_method_whose_order_leaves_the_goal_out_of_reach_is_given_up():
    errors = climbed(lambda rung: 0.04 / 2.0**rung, 1e-8, 12)  # 22 halvings are needed
    assert max(errors) == 2  # three rungs show the order
    assert ladder.recommended(errors, 1e-8, 12) is None


def test_a_method_that_does_not_converge_goes_on_to_the_last_rung():
    errors = climbed(lambda _: 0.01, 1e-3, 7)
    assert sorted(errors) == list(range(8))
    assert ladder.recommended(errors, 1e-3, 7) is None


def test_runs_that_broke_are_no_order():
    errors = climbed(lambda rung: math.nan if rung < 3 else 0.01 / 16.0 ** (rung - 3), 1e-6, 12)
    assert ladder.recommended(errors, 1e-6, 12) == 7  # 0.01 / 16^4 = 1.5e-7


def test_nothing_is_recommended_of_a_last_rung_that_nothing_confirms():
    assert ladder.recommended({0: 1.0, 1: 1e-4}, 1e-3, 1) is None


def test_a_method_without_a_step_or_tolerance_has_one_rung():
    assert climbed(lambda _: 1e-9, 1e-3, 0) == {0: 1e-9}
    assert ladder.recommended({0: 1e-9}, 1e-3, 0) == 0
    assert ladder.recommended({0: 1e-2}, 1e-3, 0) is None


@pytest.mark.parametrize(("n", "span"), [(2, 1.0), (2, 10.0), (50, 1.0), (1000, 4.0)])
def test_no_run_takes_more_steps_or_work_than_is_allowed(n, span):
    last = ladder.last_rung(n, span, 0.1)
    steps = span / ladder.step(0.1, last)
    allowed = min(1e5, max(1e6 / n, 100.0))
    assert allowed / 2 < steps <= allowed
