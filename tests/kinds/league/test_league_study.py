"""The kind of study `league`: what it says of an engine is what its tables show, and no engine can stop it."""

from __future__ import annotations

import math
import os
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import pendbench as pb
from pendbench.base.bundled import bundled
from pendbench.base.errors import InputError
from pendbench.engines.registry import engine, engine_names
from pendbench.kinds.league import settings
from pendbench.kinds.league.challenge import PBD, Entry, is_better, judged
from pendbench.kinds.league.rows import CaseRow, EngineRow, PairRow, lines_of, rows_with_ratios
from pendbench.kinds.league.settings import engine_file, league_tables
from pendbench.kinds.league.study import coarsest_enough
from pendbench.kinds.league.verdicts import accuracy_word, cost_word, standard_word, verdict
from pendbench.kinds.league.work import LeagueRun, compared_times
from pendbench.scene.scene import load_scene
from pendbench.study import absent
from pendbench.study.absent import why_absent
from pendbench.study.case import Case
from pendbench.study.plan import load_plan
from pendbench.study.timing import UNTIMED
from support.reading import cells_of

STUDY = """
kind      = "league"
scenes    = ["double", "challenge"]
challenge = ["challenge"]

[durations]
double    = 1.0
challenge = 0.3

[[engines]]
name        = "analytic"
methods     = ["adaptive"]
as_it_comes = true

[[engines]]
name    = "analytic"
methods = ["rk4"]
dt      = [0.05, 0.0125]

[[engines]]
name        = "mujoco"
methods     = ["euler"]
dt          = [0.002]
as_it_comes = true

[[engines]]
name    = "mujoco"
methods = ["rk4"]
dt      = [0.05, 0.0125]

[[engines]]
name        = "xpbd"
methods     = ["small_steps"]
dt          = ["1/3000"]
as_it_comes = true

[[engines]]
name     = "nowhere"
optional = true
"""


@pytest.fixture(scope="module")
def league(tmp_path_factory):
    folder = tmp_path_factory.mktemp("league")
    study = folder / "small.toml"
    study.write_text(STUDY.replace("nowhere", "pinocchio"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(absent, "_why_apart", lambda name: f"engine {name!r} ends the process that loads it, of SIGSEGV")
        return pb.run_study(study, folder / "out", jobs=1)


def row_of(league, **what):
    rows = league.cases
    for key, value in what.items():
        rows = rows[rows[key] == value]
    [row] = rows.itertuples()
    return row


def test_the_time_on_the_truth_is_that_of_a_run_from_scratch(league):
    scene = load_scene("double")
    row = row_of(league, scene="double", engine="mujoco", method="rk4", dt=0.05)
    times = np.arange(21) * 0.05
    truth, run = pb.reference(scene, times), pb.simulate(scene, "mujoco", "rk4", 0.05, times)
    apart = run.positions - replace(run, theta=truth.theta).positions
    error = np.linalg.norm(apart, axis=2).max(axis=1) / scene.lengths.sum()
    assert row.error_max == pytest.approx(error.max(), rel=1e-6)
    assert row.follows_s == (1.0 if error.max() < 0.01 else pytest.approx(times[error > 0.01][0], abs=0.05))


def test_who_follows_to_the_end_is_timed_and_an_engine_that_cannot_be_loaded_is_a_row_with_a_reason(league):
    page = (league.folder / "report.md").read_text()
    first = next(row for row in cells_of(page) if row[0] == "analytic" and row[1] == "2 of 2")
    assert first[2:4] == ["100%", "100%"]
    assert first[-1].startswith("exact, ")
    assert "- pinocchio: engine 'pinocchio' ends the process that loads it, of SIGSEGV" in page
    assert "Not here: pinocchio" in league.answer
    assert row_of(league, scene="double", engine="analytic", method="adaptive").cost_s_per_s > 0


def test_a_table_leaves_out_the_host_and_costs_are_then_those_of_the_cheapest_of_the_others(league):
    page = (league.folder / "report.md").read_text()
    without = page.partition("## Without our own engine")[2].partition("The five words")[0]
    names = [row[0] for row in cells_of(without)][1:]
    assert "analytic" not in names
    assert "mujoco" in names
    assert "1" in {row[6] for row in cells_of(without)}


def test_the_challenge_has_its_four_numbers_and_says_who_beats_it_in_what(league):
    page = (league.folder / "report.md").read_text()
    part = page.partition("## The Pendulum Challenge")[2].partition("## double")[0]
    rows = {row[0]: row for row in cells_of(part)}
    assert rows["xpbd"][-1] == "itself"
    assert "accuracy" in rows["analytic"][-1]
    assert re.search(r"stays on the truth for [\d.]+ s at its best", part)


def test_the_words_follow_from_the_numbers():
    assert [accuracy_word(share) for share in (1.0, 0.98, 0.5, 0.2, 0.19, math.nan)] == [
        "exact", "accurate", "accurate", "fair", "rough", "rough",
    ]  # fmt: skip
    assert [cost_word(ratio) for ratio in (1, 5, 5.1, 51, math.nan)] == [
        "cheap", "cheap", "affordable", "dear", "unreached",
    ]  # fmt: skip
    assert [standard_word(energy) for energy in (0.0, 0.01, 0.011, 0.2, 1.1, math.inf, math.nan)] == [
        "steady", "steady", "drifting", "lossy", "broken", "broken", "broken",
    ]  # fmt: skip
    for share in (1.0, 0.3):
        for ratio in (1.0, math.nan):
            assert len(verdict(share, ratio, 0.5).replace(",", "").split()) == 5


def run(early=math.nan, follows=math.nan):
    return LeagueRun("ok", error_early=early, follows_s=follows)


def test_a_coarse_step_that_is_good_by_chance_is_not_the_one_that_is_accurate_enough():
    case = Case(load_scene("double"), "mujoco", "rk4", 0.1)
    errors = {0.1: 1e-5, 0.05: 1e-2, 0.025: 9e-4, 0.0125: 1e-4}
    runs = {replace(case, dt=dt): run(error) for dt, error in errors.items()}
    assert coarsest_enough(runs, 1e-3).dt == 0.025
    assert coarsest_enough(runs, 1e-6) is None
    loose = {replace(case, engine="scipy", method="rk45", dt=None, settings=(("tolerance", t),)): run(10 * t)
             for t in (1e-2, 1e-4, 1e-6)}  # fmt: skip
    assert coarsest_enough(loose, 1e-3).tolerance == 1e-4


def pair(engine, scene, cost, known=10.0, follows=5.0):
    case = Case(load_scene("double"), engine, "rk4", 0.1)
    row = CaseRow(case, run(1e-4, follows), known, True, replace(UNTIMED, simulated_s_per_s=1 / cost))
    return PairRow(scene, engine, known, row, row, row, row)


def test_costs_are_over_the_cheapest_in_each_scene_and_the_median_counts():
    first = EngineRow("mujoco", [pair("mujoco", "a", 1.0), pair("mujoco", "b", 8.0)])
    second = EngineRow("pymunk", [pair("pymunk", "a", 3.0), pair("pymunk", "b", 2.0)])
    ratios = {row.engine: row.ratio for row in rows_with_ratios([first, second])}
    assert ratios == {"mujoco": pytest.approx(2.5), "pymunk": pytest.approx(2.0)}  # of 1 and 4; of 3 and 1


def test_the_share_is_of_all_the_time_that_the_truth_is_known():
    row = EngineRow("mujoco", [pair("mujoco", "a", 1.0, 10.0, 5.0), pair("mujoco", "b", 1.0, 30.0, 30.0)])
    assert row.share("best") == pytest.approx(35 / 40)


def test_what_is_not_reached_is_worse_than_anything_that_is():
    assert is_better(2.0, 1.0, more=True)
    assert is_better(1.0, 2.0, more=False)
    assert is_better(1.0, math.nan, more=False)
    assert not is_better(math.nan, 1.0, more=True)
    assert not is_better(1.0, 1.0, more=True)
    entries = [Entry(PBD, None, 1.0, 0.1, math.nan, 30.0), Entry("mine", None, 2.0, 0.01, 1.0, 30.0)]
    assert [(entry.engine, entry.beats) for entry in judged(entries)] == [("mine", ("accuracy", "speed")), (PBD, ())]


def test_runs_with_any_step_are_compared_on_whole_steps():
    for dt in (0.002, 1 / 60, 1 / 240, 0.05, None):
        times = compared_times(dt, 1.0, 0.05)
        assert len(times) == 21
        assert np.abs(times - np.arange(21) * 0.05).max() <= (dt or 0.0) / 2 + 1e-12


# The engines' files.


@pytest.mark.filterwarnings("ignore")  # what engines warn of is not what is counted
@pytest.mark.parametrize("name", [path.stem for path in (bundled("studies") / "league").glob("*.toml")])
def test_every_file_is_of_an_engine_and_says_what_the_engine_has(name):
    assert name in engine_names()
    where, file = engine_file(name)
    assert where.endswith(f"league/{name}.toml")
    if why_absent([name], apart=False):
        pytest.skip(f"{name} is not installed")
    methods = engine(name).methods
    for method in (file.as_it_comes.method, *(method for tried in file.tried for method in tried.methods)):
        assert method in methods
    assert methods[file.as_it_comes.method].adaptive == (file.as_it_comes.dt is None)


def test_every_bundled_engine_has_a_file():
    assert {table.name for table in league_tables()} >= set(engine_names())


GOOD = """
snippet = "theta = 0"
[as_it_comes]
method = "rk4"
dt = 0.01
why = "so it is"
[[tried]]
methods = ["rk4"]
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('method = "rk4"', 'methods = "rk4"', "as_it_comes"),
        ("dt = 0.01", "dt = -1", "dt is -1; allowed: a number from 1e-06 to 1000 s"),
        ('why = "so it is"', "", "missing key 'why'"),
        ('[[tried]]\nmethods = ["rk4"]', "", "missing table [[tried]]"),
        ("snippet", "snipet", "did you mean 'snippet'?"),
        ('"theta = 0"', "3", "snippet is 3; allowed: text in quotes"),
        ('["rk4"]', '["rk5"]', "[tried number 1]: unknown method 'rk5'; did you mean 'rk4'?"),
        ('["rk4"]', '["rk4"]\nsteps = 3', "[tried number 1]: unknown key 'steps'"),
        ("dt = 0.01", "dt = 0.01\nspeed = 3", "[as_it_comes]: unknown key 'speed'"),
        ("dt = 0.01", "", "asks twice"),
        ("[as_it", "as_it", "mujoco.toml"),
    ],
)  # fmt: skip
def test_a_fault_in_an_engines_file_is_one_line_that_names_it(tmp_path, monkeypatch, old, new, said):
    (tmp_path / "league").mkdir()
    file = tmp_path / "league" / "mujoco.toml"
    file.write_text(GOOD.replace(old, new))
    study = tmp_path / "s.toml"
    study.write_text('kind = "league"\nscenes = ["double"]\n')
    monkeypatch.setattr(settings, "bundled", lambda _: tmp_path)
    if said == "asks twice":
        file.write_text(GOOD.replace("[[tried]]\n", "[[tried]]\ndt = [0.01]\n"))
    with pytest.raises(InputError) as caught:
        load_plan(study)
    assert said in str(caught.value)
    assert "mujoco.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('challenge = ["whip"]', "challenge: unknown scene 'whip'"),
        ("[durations]\ndouble = 99.0", "[durations]: double is 99; allowed: up to 10 s"),
        ("error = 2.0", "error is 2.0"),
        (
            '[[engines]]\nname = "mujoco"\nas_it_comes = true',
            "as_it_comes is true; allowed: for one table",
        ),
    ],
)
def test_a_fault_in_a_league_is_one_line(tmp_path, text, said):
    study = tmp_path / "s.toml"
    engines = "" if "[[engines]]" in text else '\n[[engines]]\nname = "analytic"\nmethods = ["rk4"]\n'
    study.write_text(f'kind = "league"\nscenes = ["double"]\n{text}{engines}')
    with pytest.raises(InputError) as caught:
        load_plan(study)
    assert said in str(caught.value)


# Engines that cannot be had.


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import os; os.abort()", "ends the process that loads it, of SIGABRT"),
        ("import sys; sys.exit(7)", "ends the process that loads it, with exit code 7"),
        ("import atexit, os; atexit.register(os.abort)", "ends the process that loads it, of SIGABRT"),
        ("print('much ado'); print('it is too old'); import sys; sys.exit(3)", "it is too old"),
        ("import threading; threading.Event().wait()", "hangs while it is loaded: 1 s"),
        ("print('hello')", ""),
    ],
)
def test_an_engine_that_crashes_or_hangs_as_it_is_loaded_is_absent_with_a_reason(monkeypatch, code, said):
    monkeypatch.setattr(absent, "_LOAD", code)
    monkeypatch.setattr(absent, "_HANGS_S", 1.0 if "wait" in code else 120.0)
    monkeypatch.setattr(absent, "engine", lambda name: SimpleNamespace(name=name))
    absent._ask_once.cache_clear()
    found = why_absent(["pinocchio", "analytic"], apart=True)
    absent._ask_once.cache_clear()
    assert "analytic" not in found
    assert found.get("pinocchio", "").endswith(said)
    assert bool(found.get("pinocchio")) == bool(said)


def test_an_engine_is_asked_again_only_when_something_was_installed(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(absent, "_ask", lambda name: asked.append(name) or "it is not here")
    monkeypatch.setattr(absent, "is_foreign", lambda name: name == "mine")
    monkeypatch.syspath_prepend(tmp_path)
    for _ in range(2):
        assert why_absent(["drake", "mine"], apart=True) == dict.fromkeys(("drake", "mine"), "it is not here")
    assert sorted(asked) == ["drake", "mine", "mine"]  # whoever writes an engine changes it in place
    (tmp_path / "pydrake").mkdir()
    os.utime(tmp_path, ns=(0, 1))  # as later as a clock can tell
    why_absent(["drake"], apart=True)
    assert asked[3:] == ["drake"]
    monkeypatch.setattr(absent, "python_of", lambda _: "/elsewhere/bin/python")
    why_absent(["drake"], apart=True)
    why_absent(["drake"], apart=True)
    assert asked[4:] == ["drake", "drake"]
    absent._ask_once.cache_clear()


def test_lines_of_code_are_counted_without_comments_and_empty_lines(monkeypatch):
    text = "# a comment\nimport this\n\n    \nx = 1  # and\n  # indented\ny = 2\n"
    monkeypatch.setattr("pendbench.kinds.league.rows.engine_file", lambda _: ("", SimpleNamespace(snippet=text)))
    assert lines_of("mine") == 3


@pytest.mark.filterwarnings("ignore")  # what engines warn of is not what is counted
@pytest.mark.parametrize("name", [path.stem for path in (bundled("studies") / "league").glob("*.toml")])
def test_the_code_that_is_counted_simulates_the_challenge(name):
    _, file = engine_file(name)
    if file.snippet is None:
        pytest.skip(f"there is no snippet for {name}")
    if why_absent([name], apart=False):
        pytest.skip(f"{name} is not installed")
    made: dict[str, object] = {}
    exec(file.snippet, made)
    truth = pb.reference("challenge", [0.0, 0.1]).theta[-1]
    apart = np.asarray(made["theta"], np.float64) - truth
    # The worst of those that come with pendbench, MuJoCo's Euler at 2 ms, is off by 0.007 rad.
    assert np.abs((apart + np.pi) % (2 * np.pi) - np.pi).max() < 0.01
