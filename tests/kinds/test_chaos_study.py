"""The chaos study from its file to its table: what it finds, that it finds it again, that it goes on where it was."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pendbench.report.tables import csv_text, data_frame
from support.tiny_study import ENGINES, FIXED, HEAD, Idle, Inline, Log, run, write_study

#: What users and their scripts may rely on.
STAGES = [
    "what engines refuse", "kernels compiled", "the truth", "the engines", "the causes", "the clock, one at a time",
]  # fmt: skip


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    return write_study(tmp_path_factory.mktemp("study"))


@pytest.fixture(scope="module")
def two(study, tmp_path_factory):
    """The study, run by two workers; its log and its folder."""
    out, log = tmp_path_factory.mktemp("two"), Log()
    return run(study, out, jobs=2, log=log), log, out


def cases(finished, **wanted) -> pd.DataFrame:
    table = data_frame(finished.report.cases)
    for name, value in wanted.items():
        table = table[table[name] == value]
    return table


def reproducible(finished) -> dict[str, str]:
    """Every number that does not come from a clock, to its last digit."""
    tables = finished.report.tables.values()
    return {
        table.name: csv_text(type(table)(table.name, tuple(c for c in table.columns if not c.is_time), table.rows))
        for table in tables
    }


def assert_same(one, other) -> None:
    assert reproducible(one) == reproducible(other)


def test_every_case_is_a_row_with_the_fixed_columns(two):
    finished, log, _ = two
    table = cases(finished)
    assert set(FIXED) <= set(table)
    assert list(log.stages) == STAGES
    assert log.advances == sum(total for total, _ in log.stages.values())
    assert all(done == 0 for _, done in log.stages.values())
    assert len(table) == 2 * 7
    assert len(set(zip(table.scene, table.engine, table.method, table.dt, strict=True))) == 14
    assert set(table.status) == {"ok"}
    assert set(table.reason) == {""}
    assert set(table.n) == {2}
    assert set(table.horizon_s) == {2.0}
    assert set(table.starts) == {2}
    for name in ("error_max", "energy_drift_max", "step_us", "run_s"):
        assert (table[name] > 0).all(), name
        assert np.isfinite(table[name]).all(), name
    assert list(table.dt.isna()) == list(table.method == "adaptive")


def test_the_numbers_are_those_of_the_methods(two):
    finished = two[0]
    for method, order in {"rk4": 4, "euler": 1, "tuned": 2}.items():
        found = cases(finished, method=method, scene="double_calm")
        assert found.order_observed.to_numpy() == pytest.approx(order, abs=0.1)
        coarse, fine = found.sort_values("dt", ascending=False).error_max
        assert coarse / fine == pytest.approx(10.0**order, rel=0.3)
    assert cases(finished, method="adaptive").error_max.max() < 1e-13
    assert set(cases(finished).cause) == {"integration"}  # two seconds are too few to tell chaos
    assert cases(finished).model_error.max() < 1e-6
    assert (cases(finished, engine="pymunk").gap_max > 0).all()
    assert (cases(finished, engine="analytic").gap_max == 0).all()
    told = cases(finished)["flags"]
    assert not told.str.contains("too good|another system|plateau|order ", regex=True).any(), told.tolist()


def test_the_other_tables_agree_with_the_cases(two):
    tables = {name: data_frame(table) for name, table in two[0].report.tables.items()}
    assert len(tables["starts"]) == 2 * len(tables["cases"])
    assert len(tables["scenes"]) == 2
    assert len(tables["causes"]) == 2 * 4
    own = tables["starts"][tables["starts"].start == 0]
    assert sorted(own.error_max) == sorted(tables["cases"].error_max)
    assert (tables["curves"].groupby(["scene", "engine", "method"]).error.max() > 0).all()
    assert two[0].report.results.provenance["worker processes"] == 2


def test_one_worker_finds_what_two_find(study, two, tmp_path):
    assert_same(run(study, tmp_path, jobs=1), two[0])


def test_a_finished_study_is_not_run_again(study, two, tmp_path):
    log = Log()
    again = run(study, two[2], Idle, jobs=2, log=log)
    assert [total == done > 0 for total, done in log.stages.values()] == [True] * len(STAGES)
    assert log.advances == 0
    for name, table in again.report.tables.items():
        assert csv_text(table) == csv_text(two[0].report.tables[name])  # times as well
    with pytest.raises(AssertionError, match="asked to run"):
        run(study, tmp_path, Idle)  # the guard itself


def test_a_fresh_run_runs_everything_again_and_spares_what_is_not_its_own(study, two, tmp_path):
    work = tmp_path / "work"
    work.mkdir()
    for file in (two[2] / "work").iterdir():
        (work / file.name).write_bytes(file.read_bytes())
    (work / "notes.json").write_text("mine")
    run(study, tmp_path, Idle)
    with pytest.raises(AssertionError, match=r"asked to run"):
        run(study, tmp_path, Idle, fresh=True)
    assert [path.name for path in work.iterdir()] == ["notes.json"]


def test_a_damaged_truth_is_computed_again(study, two, tmp_path):
    work = tmp_path / "work"
    work.mkdir()
    for file in (two[2] / "work").iterdir():
        (work / file.name).write_bytes(file.read_bytes())
    damaged, lost, *_ = sorted(path for path in work.glob("*.json") if b'"theta_low"' in path.read_bytes())
    damaged.write_bytes(damaged.read_bytes()[:-100])
    lost.unlink()
    log = Log()
    assert_same(run(study, tmp_path, Inline, log=log), two[0])
    total, done = log.stages["the truth"]
    assert total - done == 2
    assert damaged.read_bytes() == (two[2] / "work" / damaged.name).read_bytes()


def test_a_study_that_was_killed_goes_on_where_it_was(study, two, tmp_path):
    line = [sys.executable, "-m", "pendbench.study", str(study), "--out", str(tmp_path), "--jobs", "2"]
    with subprocess.Popen(line, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as killed:
        work = tmp_path / "work"
        while killed.poll() is None and len(list(work.glob("*.json"))) < 15:
            time.sleep(0.01)
        os.killpg(killed.pid, signal.SIGKILL)  # its workers with it: they are of its session
    assert killed.returncode == -signal.SIGKILL, "it was done before it could be killed"
    assert not (tmp_path / "cases.csv").exists()
    log = Log()
    assert_same(run(study, tmp_path, Inline, log=log), two[0])
    kept = sum(done for _, done in log.stages.values())
    assert 15 <= kept < sum(total for total, _ in log.stages.values())
    total, done = log.stages["kernels compiled"]
    assert total == done


def test_a_scene_that_no_chosen_engine_is_for_is_left_out(tmp_path):
    tables = ENGINES.replace('name    = "mujoco"', 'name    = "mujoco"\nscenes  = ["double_calm"]')
    path = write_study(tmp_path, tables, HEAD.replace("starts        = 1", "starts        = 0"))
    found = run(path, tmp_path / "out", Inline, engines=("mujoco",)).report.tables
    assert {row.case.scene.name for row in found["cases"]} == {"double_calm"}
    assert [row.scene.name for row in found["scenes"]] == ["double_calm"]


SHORT = HEAD.replace("starts        = 1", "starts        = 0").replace(', "double_calm.toml"', "")
OURS = """
[[engines]]
name    = "analytic"
methods = ["adaptive"]

[[engines]]
name    = "analytic"
methods = ["rk4"]
dt      = [1e-2, %s]
"""


def test_a_step_of_a_sixtieth_is_compared_however_it_is_typed_and_changes_no_other_row(tmp_path):
    """The truth is at the very times of each run: no two times have to be taken for the same."""
    errors = {}
    for typed in ("5e-3", "0.016666666666666666", "0.01666667", "0.0166667"):
        path = write_study(tmp_path, OURS % typed, SHORT)
        table = cases(run(path, tmp_path / typed, Inline))
        errors[typed] = table.error_max.tolist()
    others = np.array(list(errors.values()))[:, :2]
    assert others == pytest.approx(others[[0] * 4], rel=1e-6)  # the truth itself is known to so many digits
    sixtieths = [own[2] for typed, own in errors.items() if typed != "5e-3"]
    assert sixtieths == pytest.approx([sixtieths[0]] * 3, rel=0.05)  # 6 digits: 1.98 s of 2, and a step 2e-6 longer
    coarse = errors["5e-3"][1]
    assert sixtieths[0] == pytest.approx(coarse * (10 / 6) ** 4, rel=0.2)  # order 4, against 0.01 s


def test_scenes_shorter_than_the_samples_have_errors_and_orders(tmp_path):
    path = write_study(tmp_path, OURS.replace("1e-2", "1e-3") % "5e-4", SHORT)
    scene = tmp_path / "double.toml"
    scene.write_text(
        scene.read_text().replace("duration = 2.0", "duration = 0.008").replace("1.5707963267948966", "2.0")
    )
    table = cases(run(path, tmp_path / "out", Inline))
    assert set(table.horizon_s) == {0.008}
    assert (table.error_max[1:] > 0).all()
    assert (table.error_half[1:] > 0).all()


NOTHING_MOVES = """
title         = "Nothing moves"
kind          = "chaos"
scenes        = ["no-gravity.toml"]
starts        = 0
lyapunov_time = 10.0

[[engines]]
name    = "mujoco"
methods = ["rk4"]
dt      = [1e-2, 1e-3]
"""
NO_GRAVITY = """
title = "Passive pendulum, gravity forgotten"
duration = 5.0
[chain]
masses = [1.0]
lengths = [1.0]
[start]
angles = 0.5
"""


def test_where_nothing_moves_nobody_is_ranked_or_too_good(tmp_path):
    (tmp_path / "no-gravity.toml").write_text(NO_GRAVITY)
    (tmp_path / "still.toml").write_text(NOTHING_MOVES)
    finished = run(tmp_path / "still.toml", tmp_path / "out", Inline)
    assert finished.report.answer == "Nothing moves in no-gravity: it names no gravity, and nothing else acts."
    table = cases(finished)
    assert set(table.error_max) == {0.0}
    assert not table["flags"].str.contains("too good").any()
    assert set(table.cause) == {"none: nothing moves"}
