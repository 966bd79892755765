"""The kind of study `scaling`: its costs, its search for the longest chain in real time, its report."""

from __future__ import annotations

import math

import pytest

from pendbench.engines.registry import engine
from pendbench.errors import InputError
from pendbench.physics.energy import energy_scale
from pendbench.report import scaling as report
from pendbench.scene import load_scene
from pendbench.study import scaling
from pendbench.study.api import run_study
from pendbench.study.case import Case
from pendbench.study.clock import race
from pendbench.study.plan import load_plan
from pendbench.study.work import _memory_taken
from scenes import chain

STUDY = """
title = "Small"
kind = "scaling"
scenes = ["rope100"]
links = [1, 3, 4, 6]
fit_from = 3
duration = 0.02
[[engines]]
name = "analytic"
methods = ["rk4", "euler"]
dt = [1e-3]
[[engines]]
name = "analytic"
methods = ["taylor"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("scaling")
    (path / "small.toml").write_text(STUDY)
    return path


class Oracle:
    """A runner that answers at once: trials hold up to n and a step that falls like 1/n, and are in time up to n."""

    def __init__(self, fastest, steady, stops=math.inf):
        self.fastest, self.steady, self.stops, self.raced = fastest, steady, stops, []

    def run(self, _stage, jobs, _on_fault, *, alone=False):
        del alone
        return {job.key: self._answer(job) for job in jobs}

    def _answer(self, job):
        if job.function is scaling.measure_step_cost:
            n = job.arguments[0].scene.n
            timing = {"step_us": 2.0 * n**1.5, "step_spread": 0.0, "build_s": 0.0, "first_call_s": 0.0}
            return (
                {"status": "ok", "reason": "", **timing} if n < self.stops else {"status": "timed out", "reason": "x"}
            )
        if job.function is not scaling.measure_race:
            return {}
        case = job.arguments[0]
        n, dt = case.scene.n, case.dt or 0.0
        self.raced.append((case.method, n, case.dt))
        outcome = "lost" if dt * n > self.steady else "held" if n <= self.fastest else "too slow"
        return {"outcome": outcome, "reason": outcome, "reached_s": 1.0, "spent_s": 1.0, "energy_drift_max": 0.0}


def searched(folder, **oracle):
    runner = Oracle(**oracle)
    results = scaling.run(load_plan(folder / "small.toml"), runner)
    return results, runner


@pytest.mark.parametrize("fastest", [8, 100, 777, 12_345])
def test_longest_chain_is_found_to_a_tenth(folder, fastest):
    results, _ = searched(folder, fastest=fastest, steady=0.5)
    for row in results.tables["longest"].to_dict("records"):
        assert fastest / 1.1 - 1 <= row["longest_n"] <= fastest
        assert row["longest_n"] < row["next_n"]
        assert row["outcome"] == "too slow"


def test_step_of_the_longest_chain_is_near_the_coarsest_that_holds(folder):
    results, _ = searched(folder, fastest=500, steady=0.05)
    rows = results.tables["longest"].set_index("method")
    best = 0.05 / rows.loc["rk4", "longest_n"]
    assert best / scaling.FINER**2 <= rows.loc["rk4", "dt"] <= best
    assert math.isnan(rows.loc["taylor", "dt"])


def test_nothing_is_tried_twice_and_few_trials_do(folder):
    _, runner = searched(folder, fastest=1000, steady=0.05)
    assert len(set(runner.raced)) == len(runner.raced)
    assert sum(method == "rk4" for method, _, _ in runner.raced) < 40


def test_chain_that_no_step_keeps_is_none(folder):
    results, runner = searched(folder, fastest=1000, steady=0.0)
    rows = results.tables["longest"].set_index("method")
    assert math.isnan(rows.loc["rk4", "longest_n"])
    assert rows.loc["rk4", "outcome"] == "lost"
    assert min(dt for method, _, dt in runner.raced if method == "rk4") >= 1e-5
    assert {n for method, n, _ in runner.raced if method == "rk4"} == {8, 4, 2, 1}
    assert "no step below 1e-05 s is tried" in rows.loc["rk4", "reason"]


def test_chain_that_is_shorter_than_the_first_tried_is_found(folder):
    results, _ = searched(folder, fastest=3, steady=0.5)
    assert set(results.tables["longest"].longest_n) == {3}


def test_links_share_the_step_of_one(folder):
    results, _ = searched(folder, fastest=8, steady=0.5)
    rows = results.cases[results.cases.method == "rk4"]
    assert (rows.dt * rows.n).to_numpy() == pytest.approx(1e-2)


def test_memory_is_that_of_a_run_that_is_there():
    scene = chain(50_000, angle=1.5)
    case = Case(scene, "analytic", "rk4", 1e-9)
    _memory_taken(case, 1e-9)  # which may load kernels
    held = _memory_taken(case, 1e-9)
    assert 50_000 * 8 * 8 < held < 50_000 * 8 * 60  # the scene's arrays are there before
    assert _memory_taken(Case(chain(2), "analytic", "rk4", 1e-3), 1e-3) < 2e6


def test_exponent_is_that_of_the_costs_and_the_end_is_told(folder):
    results, _ = searched(folder, fastest=10, steady=1.0)
    assert results.tables["growth"].step_exponent.to_numpy() == pytest.approx(1.5)
    results, _ = searched(folder, fastest=10, steady=1.0, stops=4)
    growth = results.tables["growth"]
    assert growth[["n_from", "n_to", "step_exponent"]].isna().all(axis=None)  # of two lengths there is none
    assert set(growth.status) == {"timed out"}
    assert set(results.cases[results.cases.n > 4].n) == set()


def test_exponent_of_an_engine_that_stops_early_is_that_of_its_last_decade(folder):
    growth = searched(folder, fastest=10, steady=1.0, stops=6)[0].tables["growth"]
    assert growth.step_exponent.to_numpy() == pytest.approx(1.5)
    assert set(growth.n_from) == {1}
    assert set(growth.n_to) == {4}


def test_study_from_end_to_end(folder):
    table = run_study(folder / "small.toml", folder / "out", jobs=1)
    assert set(table.status) == {"ok"}
    assert sorted(set(table.n)) == [1, 3, 4, 6]
    assert (table.step_us > 0).all()
    assert (table.error_max < 0.1).all()
    rk4, euler = (table[table.method == method].error_max.max() for method in ("rk4", "euler"))
    assert rk4 < euler
    page = (folder / "out/report.md").read_text()
    assert "## The longest chain in real time" in page
    assert (folder / "out/plots/cost.png").stat().st_size > 1000


def test_pattern_keeps_its_mass_and_its_length(folder):
    study = scaling._Scaling(load_plan(folder / "small.toml"), Oracle(1, 1.0))
    pattern = load_scene("rope100")
    for n in (1, 7):
        scene = study.scene(n)
        assert scene.masses.sum() == pytest.approx(pattern.masses.sum())
        assert scene.lengths.sum() == pytest.approx(pattern.lengths.sum())
        assert (scene.n, scene.duration) == (n, 0.02)


def test_race_stops_where_the_energy_is_lost():
    scene = load_scene("chain10")
    analytic, asked = engine("analytic"), []
    found = race(analytic, scene, "rk4", 0.01, {}, 100, lambda state: asked.append(state) or len(asked) == 7)
    assert found.lost
    assert found.reached == pytest.approx(0.7)
    assert energy_scale(scene) > 0


def test_race_against_a_method_that_chooses_its_steps():
    found = race(engine("analytic"), load_scene("single"), "taylor", None, {}, 10, lambda _: False)
    assert (found.reached, found.lost) == (10.0, False)
    assert 0 < found.spent < 10


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('["rope100"]', '["rope100", "chain5"]'), "scenes has 2 entries; allowed: 1"),
        (('["rope100"]', '["heavy_tip"]'), "masses differ"),
        (("links = [1, 3, 4, 6]", "links = []"), "links"),
        (("links = [1, 3, 4, 6]", "links = [0]"), "links"),
        (("duration = 0.02", "duration = 0"), "duration"),
        (
            ("duration = 0.02", "duration = 0.02\ncoarsest = 0.1\nfinest = 0.2"),
            "coarsest is 0.1; allowed: finest = 0.2 or more",
        ),
    ],
)
def test_bad_study_is_one_line(folder, change, says):
    path = folder / "bad.toml"
    path.write_text(STUDY.replace(*change))
    with pytest.raises(InputError) as error:
        load_plan(path)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("angle", [0.0, math.pi])
def test_pattern_that_nothing_moves_is_refused(folder, angle):
    chain = f"[chain]\nn = 1\nmass = 1.0\nlength = 1.0\n[start]\nangles = {angle!r}\n"
    (folder / "still.toml").write_text(f'title = "Still"\nduration = 1.0\n{chain}[effects]\ngravity = 9.81\n')
    path = folder / "resting.toml"
    path.write_text(STUDY.replace('"rope100"', '"still.toml"'))
    with pytest.raises(InputError, match="is at rest and nothing pulls it; allowed: one that moves"):
        load_plan(path)


def told(**cells):
    return report._told_length({"longest_n": 150, "outcome": "too slow", "reason": "", **cells})


def test_length_is_a_bound_where_something_else_than_the_chain_ended_the_search():
    assert told() == told(outcome="lost") == "150"
    for outcome in ("refused", "timed out", "out of memory", "crashed"):
        assert told(outcome=outcome) == "at least 150"
    assert told(outcome="lost", reason="no step below 1e-06 s is tried") == "at least 150"
