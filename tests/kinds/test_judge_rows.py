"""What the kind `judge` says of a run, a method and an engine, each worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pendbench.kinds.judge import work
from pendbench.kinds.judge.columns import best_of_engines, tables
from pendbench.kinds.judge.ladder import last_rung, needed
from pendbench.kinds.judge.page import facts
from pendbench.kinds.judge.study import Found, Ladder
from pendbench.kinds.judge.work import Span, Try, measure_span, measure_try
from pendbench.measures.energy import Balance
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.models import Model
from pendbench.study.timing import UNTIMED
from pendbench.study.truths import Compared, KeptTruth
from support.scenes import chain

LINK = chain(1, angle=0.0, duration=10.0, name="link")
TIMES = np.linspace(0.0, 10.0, 1001)
RK4 = Case(LINK, "mujoco", "rk4", None)
SPAN = Span("ok", until=10.0, interval=0.1, magnified=2.0, why="the scene's end")


# How long a scene is followed.


@pytest.fixture
def spanned(monkeypatch):
    """A function that measures a span in which a small error is so many times as large, at the 1001 times."""

    def measure(grown, asked=None):
        beside = (Trajectory(TIMES, 1e-8 * g[:, np.newaxis], np.zeros((1001, 1)), np.zeros(1001))
                  for g in (np.zeros(1001), grown))  # fmt: skip
        monkeypatch.setattr(work, "simulate", lambda *_, **__: next(beside))
        return measure_span(LINK, asked)

    return measure


def test_an_error_that_was_large_once_has_been_magnified(spanned):
    found = spanned(np.where(TIMES < 2.0, 1.0, np.where(TIMES < 4.0, 50.0, 2.0)))
    assert (found.until, found.interval, found.why) == (10.0, 0.1, "the scene's end")
    assert found.magnified == pytest.approx(50.0, rel=1e-6)


def test_chaos_has_its_say_where_an_error_is_a_thousand_times_larger(spanned):
    found = spanned(np.select([TIMES < 4.0, TIMES < 5.03], [1.0, 990.0], 1010.0))
    assert (found.until, found.why) == (pytest.approx(5.0), "chaos")  # on a whole interval
    assert found.magnified == pytest.approx(990.0, rel=1e-6)


def test_who_asks_for_a_time_has_it_whatever_chaos_says(spanned):
    found = spanned(np.where(TIMES < 4.0, 1.0, 5000.0), 10.0)
    assert (found.until, found.why) == (10.0, "as asked for")
    assert found.magnified == pytest.approx(5000.0, rel=1e-6)


# What a run shows.


@pytest.fixture
def tried(monkeypatch):
    """A function that measures a run with such errors at 0, 1, 2 and 3 s; its energy strays by 0.3 at most."""

    def measure(errors, status="ok", works=False, floor=0.0, known=4):
        t = np.arange(4.0)
        run = Trajectory(t, np.zeros((4, 1)), np.zeros((4, 1)), np.array([0.0, 0.3, 0.1, 0.2]), status, steps=30)
        balance = Balance(t, np.array([0.0, -0.6, 0.4, 0.2]), 2.0, np.full(4, floor), works)
        k = min(known, len(errors))
        shared = Compared(t[:k], np.array(errors)[:k], np.zeros(k), np.zeros(k), np.zeros((k, 1)), np.zeros((k, 1)))
        for name, value in (("run_unstopped", run), ("energy_balance", balance), ("compare", shared)):
            monkeypatch.setattr(work, name, lambda *_, value=value: value)
        monkeypatch.setattr(work, "with_energy_checked", lambda run, _: run)
        return measure_try(replace(RK4, dt=0.1), t, 0.01, KeptTruth("ok", t=t))

    return measure


def test_a_run_has_its_largest_error_energy_and_gap(tried):
    found = tried([0.0, 0.003, 0.008, 0.002])
    assert (found.error_max, found.follows_s, found.stays) == (0.008, 3.0, True)
    assert (found.energy, found.gap_max, found.steps) == (0.3, 0.3, 30)


def test_a_run_that_passes_the_goal_follows_until_then(tried):
    found = tried([0.0, 0.0, 0.0, 0.02])
    assert (found.error_max, found.stays) == (0.02, False)
    assert 2.0 < found.follows_s <= 3.0


@pytest.mark.parametrize("how", [{"known": 3}, {"status": "not finite"}])
def test_what_does_not_reach_the_end_has_no_error_and_does_not_stay(tried, how):
    found = tried([0.0, 0.001, 0.002, 0.003], **how)
    assert math.isnan(found.error_max)
    assert not found.stays


@pytest.mark.parametrize(("works", "floor", "told"), [(True, 0.02, 0.3), (True, 0.04, math.nan), (False, 0.04, 0.3)])
def test_an_imbalance_is_told_where_it_is_ten_times_what_its_samples_leave_open(tried, works, floor, told):
    assert tried([0.0] * 4, works=works, floor=floor).energy == pytest.approx(told, nan_ok=True)


# What is tried.


def test_a_run_takes_a_million_links_times_steps_at_the_most():
    assert last_rung(1, 10.0, 0.1) == 9  # 51,200 steps, and not 102,400
    assert last_rung(100, 10.0, 0.1) == 6  # 6400 steps of 100 links, and not 12,800


def test_the_slower_of_two_falls_says_how_far_the_goal_is():
    """From 0.04 to 0.01 by a factor of 4, to 0.005 by one of 2: from there, 1e-3 takes 2.3 halvings."""
    assert needed({0: 0.04, 1: 0.01, 2: 0.005}, 1e-3) == 3
    assert needed({0: 0.02, 1: 0.01, 2: 0.0025}, 1e-3) == 2  # 1.3 of them


# What the tables say.


def ladder(engine, method, errors, goal=1e-3):
    case = Case(LINK, engine, method, None)
    return Ladder(case, SPAN, goal, {at: Try("ok", error_max=error) for at, error in enumerate(errors)})


@pytest.fixture
def found():
    """Three methods that reach the goal, for 2, 0.5 and 8 s a second, and two of an engine that do not."""
    reached = [1e-2, 1e-4, 1e-5]
    ladders = (
        ladder("mujoco", "rk4", reached), ladder("mujoco", "euler", reached), ladder("pymunk", "tuned", reached),
        ladder("analytic", "euler", [0.5, 0.3, 0.4]), ladder("analytic", "rk4", [0.2, math.nan, 0.25]),
        ladder("analytic", "gauss4", [math.nan, math.nan]),
    )  # fmt: skip
    costs = zip(ladders, (2.0, 0.5, 8.0), strict=False)
    timings = {own.recommended: replace(UNTIMED, simulated_s_per_s=1.0 / cost) for own, cost in costs}
    models = {own.method: Model("ok", error=1e-12, limit=1e-11) for own in ladders}
    truths = {"link": KeptTruth("ok", horizon=10.0)}
    return Found((LINK,), 1e-3, {"link": SPAN}, truths, {}, ladders, models, timings)


def test_methods_that_reach_the_goal_come_first_by_cost_and_then_those_with_the_smallest_errors(found):
    rows = list({table.name: table for table in tables(SimpleNamespace(found=found))}["methods"])
    assert [(row.case.engine, row.case.method) for row in rows] == [
        ("mujoco", "euler"), ("mujoco", "rk4"), ("pymunk", "tuned"),
        ("analytic", "rk4"), ("analytic", "euler"), ("analytic", "gauss4"),
    ]  # fmt: skip
    assert [row.cost_s_per_s for row in rows[:3]] == pytest.approx([0.5, 2.0, 8.0])
    assert [row.reached for row in rows] == [True] * 3 + [False] * 3
    assert [row.case.dt for row in rows] == [0.05, 0.05, 0.05, 0.1, 0.05, 0.05]  # the best of each; the last it tried
    assert [row.run.error_max for row in rows[3:5]] == [0.2, 0.3]
    best = best_of_engines(rows)["link"]
    assert [(row.case.engine, row.case.method) for row in best] == [
        ("mujoco", "euler"), ("pymunk", "tuned"), ("analytic", "rk4")
    ]  # fmt: skip


def test_the_answer_s_ratio_is_of_the_cheapest_and_the_others_are_named(found):
    own = {table.name: table for table in tables(SimpleNamespace(found=found))}
    [judged] = facts(SimpleNamespace(found=found), own).judged
    assert [row.case.engine for row in judged.reached] == ["mujoco", "pymunk"]
    assert judged.dearer(judged.reached[1]) == pytest.approx(16.0)
    assert judged.lacking_engines == ["analytic"]
    assert [row.recommended for row in own["cases"]] == [False, True, False] * 3 + [False] * 8
