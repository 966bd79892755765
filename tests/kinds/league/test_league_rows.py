"""The league's numbers of a case, of an engine in a scene, and of an engine in all, each worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pendbench.engines.protocol import Mapped
from pendbench.kinds.league import rows, work
from pendbench.kinds.league.challenge import CRITERIA, challenge_tables
from pendbench.kinds.league.page import facts
from pendbench.kinds.league.rows import CaseRow, EngineRow, PairRow, engine_rows, pair_rows
from pendbench.kinds.league.study import Found
from pendbench.kinds.league.work import LeagueRun, measure_run
from pendbench.measures.energy import Balance
from pendbench.report.columns import Table
from pendbench.scene.scene import load_scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.timing import UNTIMED
from pendbench.study.truths import Compared, KeptTruth

SCENE = load_scene("double")
CASE = Case(SCENE, "mujoco", "rk4", 0.1)


def row(dt=0.1, cost=1.0, *, engine="mujoco", method="rk4", comes=False, **ran):
    """A case that took `cost` s for a second of the scene, and how it went."""
    run = LeagueRun(**{"status": "ok", "error_early": 1e-4, "follows_s": 5.0, "judged": "holds", **ran})
    case = Case(SCENE, engine, method, dt)
    return CaseRow(case, run, 10.0, comes, replace(UNTIMED, simulated_s_per_s=1.0 / cost))


def pair(scene="a", known=10.0, standard=None, best=None, stable=None, cheapest=None, engine="mujoco"):
    return PairRow(scene, engine, known, standard, best or row(), stable, cheapest)


def paired(*cases, goal=1e-3):
    """What becomes of these cases of one engine in one scene."""
    found = Found((SCENE,), {SCENE.name: KeptTruth("ok", horizon=10.0)}, frozenset(), {}, {})
    [only] = pair_rows(found, cases, goal)
    return only


def test_a_cost_is_seconds_of_a_processor_for_a_second_of_the_scene():
    timing = replace(UNTIMED, simulated_s_per_s=4.0)
    assert CaseRow(CASE, LeagueRun("ok"), 10.0, False, timing).cost_s_per_s == 0.25


def test_what_counts_of_an_engine_is_its_median_scene():
    drifts = (0.1, 0.2, 0.9)
    runs = [row(energy_drift_max=drift) for drift in drifts]
    assert EngineRow("mujoco", [pair(standard=run) for run in runs]).energy("standard") == 0.2
    costs = [pair(cheapest=row(cost=cost)) for cost in (1.0, 2.0, 30.0)]
    assert EngineRow("mujoco", costs).cost_s_per_s == pytest.approx(2.0)
    steps = [pair(stable=row(dt)) for dt in (0.01, 0.02, 0.5)] + [pair()]
    assert EngineRow("mujoco", steps).stable_dt == 0.02
    assert math.isnan(EngineRow("mujoco", [pair()]).stable_dt)


def test_a_run_that_lost_its_energy_has_the_loss_and_one_that_failed_an_infinite_one():
    lost, failed = row(status="energy lost", energy_drift_max=0.7), row(status="not finite", energy_drift_max=0.7)
    assert EngineRow("mujoco", [pair(standard=lost)]).energy("standard") == 0.7
    assert EngineRow("mujoco", [pair(standard=failed)]).energy("standard") == math.inf
    assert EngineRow("mujoco", [pair(standard=None)]).energy("standard") == math.inf
    assert EngineRow("mujoco", [pair(standard=row())]).energy("standard") == math.inf  # of which nothing is known


@pytest.mark.parametrize(("reached", "of", "word"), [(1, 3, "unreached"), (2, 4, "affordable"), (3, 3, "affordable")])
def test_a_cost_is_worth_a_word_where_half_of_the_scenes_are_reached(reached, of, word):
    pairs = [pair(cheapest=row() if i < reached else None) for i in range(of)]
    assert word in EngineRow("mujoco", pairs, ratio=20.0).verdict


def test_where_no_truth_is_known_the_steadiest_is_the_best_and_the_reason_says_so():
    own = [
        row(0.1, follows_s=math.nan, energy_drift_max=4e159, status="energy lost"),
        row(0.05, follows_s=math.nan, energy_drift_max=0.01),
        row(0.025, follows_s=math.nan, energy_drift_max=0.02, comes=True),
    ]
    found = Found((SCENE,), {SCENE.name: KeptTruth("timed out", "too late")}, frozenset(), {}, {})
    [only] = pair_rows(found, own, 1e-3)
    assert only.best is own[1]
    assert only.reason == "no truth: timed out"
    [failed] = pair_rows(found, [replace(own[2], run=LeagueRun("not finite", "an angle is not"))], 1e-3)
    assert failed.reason == "as it comes: not finite: an angle is not; no truth: timed out"


def test_an_engine_is_at_its_best_where_it_follows_for_longest_and_of_equals_most_exactly():
    long, exact = row(0.1, follows_s=7.0, error_max=0.5), row(0.05, follows_s=7.0, error_max=0.3)
    assert paired(row(0.2, follows_s=6.0, error_max=0.1), long, exact).best is exact
    assert paired(row(0.2, follows_s=math.nan), row(0.1, follows_s=0.0)).best.case.dt == 0.1
    coarse, fine = row(0.2, follows_s=7.0, error_max=0.3), row(0.1, follows_s=7.0, error_max=0.3)
    assert paired(fine, coarse).best is coarse


def test_the_largest_step_that_holds_and_no_method_that_chooses_its_own():
    holds = [row(dt) for dt in (0.01, 0.05, 0.02)]
    drifts, adaptive = row(0.1, judged="drifts"), row(None, method="implicit")
    assert paired(*holds, drifts, adaptive).stable is holds[1]
    assert paired(drifts, adaptive).stable is None


def test_the_cheapest_that_is_accurate_enough_is_of_the_coarsest_of_each_method():
    of_rk4 = [row(0.1, 1.0, error_early=1e-2), row(0.05, 2.0), row(0.025, 0.5)]
    of_euler = [row(0.01, 3.0, method="euler", error_early=1e-4)]
    assert paired(*of_rk4, *of_euler).cheapest is of_rk4[1]  # its finer step is cheaper by noise alone
    assert paired(*of_euler, row(0.05, 4.0)).cheapest is of_euler[0]
    assert paired(row(error_early=1e-2)).cheapest is None
    untimed = replace(row(0.05), timing=UNTIMED)
    assert paired(untimed, *of_euler).cheapest is of_euler[0]


def test_as_it_comes_is_what_was_declared_so_and_a_refusal_is_told():
    comes = row(0.05, comes=True)
    assert paired(row(0.1), comes).standard is comes
    assert paired(row(0.1)).standard is None
    refused = paired(row(status="refused", reason="no such chain"))
    assert refused.is_refused
    assert refused.reason == "no such chain"
    assert refused.known_s == 10.0


def test_who_follows_for_longest_is_first_and_of_equals_the_cheapest(monkeypatch):
    monkeypatch.setattr(rows, "_effects", lambda _: 3)
    monkeypatch.setattr(rows, "lines_of", lambda _: 7.0)

    def of(name, follows, cost):
        own = row(cost=cost, engine=name, follows_s=follows)
        return pair(engine=name, best=own, cheapest=own)

    found = engine_rows([of("a", 5.0, 1.0), of("b", 9.0, 4.0), of("c", 9.0, 2.0)], {"d": "it is not here"})
    assert [each.engine for each in found] == ["c", "b", "a", "d"]
    assert [each.ratio for each in found[:3]] == pytest.approx([2.0, 4.0, 1.0])
    assert [each.status for each in found] == ["ok", "ok", "ok", "error"]
    assert found[-1].verdict == "not here: it is not here"


def test_an_effect_that_an_engine_refuses_does_not_count(monkeypatch):
    known = {"gravity": Mapped("yes"), "air_drag": Mapped("no", refused=True), "links": Mapped("yes")}
    monkeypatch.setattr(rows, "engine", lambda _: SimpleNamespace(effects=known))
    assert rows._effects("mine") == 2


# What a run leaves.


@pytest.fixture
def measured(monkeypatch):
    """A function that measures a run of four samples with such errors, of which the truth knows the first `k`."""

    def measure(errors, early=1.0, k=4):
        t, gap = np.array([0.0, 0.5, 1.0, 2.0]), np.array([0.0, 0.3, 0.1, 0.2])
        run = Trajectory(t, np.zeros((4, 2)), np.zeros((4, 2)), gap, steps=20)
        balance = Balance(t, np.array([0.0, -0.6, 0.4, 0.2]), 2.0, np.zeros(4))
        shared = Compared(t[:k], np.array(errors)[:k], *[np.zeros(k)] * 2, np.zeros((k, 2)), np.zeros((k, 2)))
        monkeypatch.setattr(work, "follow_unstopped", lambda *_: (run, balance))
        monkeypatch.setattr(work, "compare", lambda *_: shared)
        return measure_run(CASE, t, early, 0.01, KeptTruth("ok", t=t))

    return measure


def test_the_largest_errors_count_up_to_the_end_and_up_to_the_early_time(measured):
    found = measured([0.0, 0.004, 0.003, 0.002])
    assert (found.error_max, found.error_early, found.follows_s) == (0.004, 0.004, 2.0)
    late = measured([0.0, 0.001, 0.002, 0.008])
    assert (late.error_max, late.error_early) == (0.008, 0.002)
    assert (late.energy_drift_max, late.gap_max, late.steps) == (0.3, 0.3, 20)


def test_a_run_that_leaves_the_truth_follows_it_until_then(measured):
    assert measured([0.0, 0.0, 0.02, 0.0]).follows_s == pytest.approx(1.0)


def test_a_truth_that_ends_early_tells_no_accuracy(measured):
    short = measured([0.0, 0.001], k=2)
    assert math.isnan(short.error_early)
    assert (short.error_max, short.follows_s) == (0.001, 0.5)
    assert measured([], k=0).follows_s == 0.0


# What the page says.


def test_the_challenge_compares_four_numbers():
    chosen = row(None, method="implicit", follows_s=8.0)
    own = EngineRow("mujoco", [pair(best=chosen, stable=row(0.02), cheapest=row(cost=0.5))], lines=12.0)
    [(_, table)] = challenge_tables(["a"], [own])
    [entry] = table.rows
    assert (entry.follows_s, entry.stable_dt, entry.cost_s_per_s, entry.lines) == (8.0, math.inf, 0.5, 12.0)
    breaks = row(None, method="implicit", follows_s=8.0, judged="breaks")
    [(_, table)] = challenge_tables(["a"], [replace(own, pairs=[pair(best=breaks, stable=row(0.02))])])
    assert table.rows[0].stable_dt == 0.02
    assert {name: more for name, _, more in CRITERIA} == {
        "accuracy": True, "stability": True, "speed": False, "simplicity": False,
    }  # fmt: skip


def test_the_facts_of_the_page_are_those_of_its_tables():
    def of(name, drift):
        return EngineRow(name, [pair(engine=name, standard=row(engine=name, energy_drift_max=drift))])

    engines = [of("analytic", 0.001), of("mujoco", 0.01), of("pymunk", 0.05), EngineRow("drake", (), absent="gone")]
    scenes = [SimpleNamespace(scene=SCENE, known_s=known) for known in (4.0, 6.5)]
    tables = {
        "engines": Table("engines", (), engines),
        "engines_by_scene": Table("engines_by_scene", (), [each.pairs[0] for each in engines[:3]]),
        "scenes": Table("scenes", (), scenes),
    }
    found = facts(SimpleNamespace(options=SimpleNamespace(challenge=[])), tables)
    assert [each.engine for each in found.here] == ["analytic", "mujoco", "pymunk"]
    assert [each.engine for each in found.others] == ["mujoco", "pymunk"]
    assert found.first.engine == "mujoco"
    assert found.steady == ["analytic", "mujoco"]  # at most 1 % of the scale
    assert [each.engine for each in found.absent] == ["drake"]
    assert found.known_s == 10.5
