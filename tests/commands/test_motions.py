"""What moves in a study's page: the best of each engine, for a second or two of computing, compared with the truth."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import pendbench as pb
from pendbench.commands.staging import stage_of_study
from pendbench.commands.takes import case_of
from pendbench.engines.recording import simulate
from pendbench.kinds.chaos.page import moving
from pendbench.report.html_page import html_page
from pendbench.study.motions import MOST_LINKS, Motions, measure_motions, shown_until, times_shown
from pendbench.study.truths import KeptTruth
from support.report_data import report


@pytest.fixture(scope="module")
def short():
    return pb.load_scene("double").with_(duration=0.5)


class HereRunner:
    """Runs tasks in this process."""

    def run(self, stage, tasks):
        assert stage == "what moves"
        return {owner: task.function(*task.arguments) for owner, task in tasks.items()}


@pytest.fixture(scope="module")
def found(short):
    cases = [case_of(short, "mujoco", "euler", 0.01), case_of(short, "analytic", "rk4", 1e-3)]
    return measure_motions(cases, HereRunner())


def test_motions_are_runs_of_the_cases_and_their_truth(short, found):
    (case, coarse), (_, fine) = found.motions
    assert found.until == 0.5
    assert len(coarse.t) == 51  # each whole step of 0.01 s once
    assert (coarse.theta == simulate(short, "mujoco", "euler", 0.01, coarse.t).theta).all()
    assert set(coarse.t) | set(fine.t) == set(found.truth.t)
    stage = stage_of_study(found)
    assert [act.name for act in stage.acts] == ["mujoco", "analytic"]
    assert stage.acts[0].error.values.max() > 1e3 * stage.acts[1].error.values.max() > 0.0
    assert case.scene is short


def test_a_run_is_shown_only_as_far_as_a_second_or_two_of_computing_gets(short):
    long = short.with_(duration=1000.0)
    cases = [case_of(long, "mujoco", "rk4", 1e-4), case_of(long, "analytic")]
    assert shown_until(cases) == pytest.approx(1e-4 * 1e6 / 2)
    assert shown_until(cases[1:]) == 1000.0
    times = times_shown(cases[0], 50.0)
    assert len(times) == 501
    assert np.allclose(np.rint(times / 1e-4) * 1e-4, times, rtol=0, atol=0)


def test_nothing_moves_where_no_case_is_named_or_no_run_began_or_the_chain_is_long():
    assert measure_motions([], HereRunner()) is None
    chain = pb.Scene.chain(n=MOST_LINKS + 1, length=0.01, mass=0.01, angles=1.0, gravity=9.81)
    assert measure_motions([case_of(chain, "analytic")], HereRunner()) is None
    assert stage_of_study(None) is None
    assert stage_of_study(Motions(1.0, (), KeptTruth("ok"))) is None


def test_of_a_study_the_best_of_each_engine_move_in_one_scene():
    made = report()
    cases = moving(made.results, made.tables)
    assert {case.engine for case in cases} == {case.engine for case in cases if case.scene is cases[0].scene}
    assert len(cases) == len({case.engine for case in cases}) >= 2
    assert list(made.moving) == cases


def test_what_moves_stands_below_the_answer_and_is_packed(found):
    page = html_page(
        "# T\n\nBefore.\n\n## The answer\n\nOne.\n\n### Details\n\nLong.\n\n## More\n\nTwo.\n",
        "One.",
        {},
        stage_of_study(found),
    )
    places = [page.index(text) for text in ("The answer", "The motion", "Details", "<h2>More")]
    assert places == sorted(places)
    data = json.loads(re.search(r'id="data">(.*?)</script>', page, re.DOTALL)[1])
    assert [act["name"] for act in data["stage"]["acts"]] == ["mujoco", "analytic"]
    assert data["charts"] == {}
