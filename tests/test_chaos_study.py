"""The chaos study from its file to its table: what it finds, that it finds it again, that it goes on where it was."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pendbench.report.columns import COLUMNS, column
from pendbench.study.chaos import _ending, times_of
from pendbench.study.plan import load_plan
from tiny_study import ENGINES, HEAD, Idle, Inline, Log, run, write_study

#: What users and their scripts may rely on.
FIXED = ["scene", "n", "engine", "method", "dt", "status", "reason"]
FIXED += ["horizon_s", "error_max", "energy_drift_max", "step_us", "run_s"]
STAGES = ["compiled kernels", "the truth", "the engines", "the causes", "the clock, one at a time"]


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    return write_study(tmp_path_factory.mktemp("study"))


@pytest.fixture(scope="module")
def two(study, tmp_path_factory):
    """The study, run by two workers; its log and its folder."""
    out, log = tmp_path_factory.mktemp("two"), Log()
    return run(study, out, jobs=2, log=log), log, out


def cases(finished, **wanted) -> pd.DataFrame:
    table = finished.results.cases
    for name, value in wanted.items():
        table = table[table[name] == value]
    return table


def reproducible(table: pd.DataFrame) -> pd.DataFrame:
    return table[[name for name in table if not column(name).is_time]]


def assert_same(one, other) -> None:
    """The same results, to the last bit of every number that does not come from a clock."""
    pd.testing.assert_frame_equal(reproducible(one.results.cases), reproducible(other.results.cases), check_exact=True)
    assert one.results.tables.keys() == other.results.tables.keys()
    for name, table in one.results.tables.items():
        pd.testing.assert_frame_equal(reproducible(table), reproducible(other.results.tables[name]), check_exact=True)


def test_every_case_is_a_row_with_the_fixed_columns(two):
    finished, log, _ = two
    table = finished.results.cases
    assert set(FIXED) <= set(table)
    assert set(table) <= set(COLUMNS), "a column that nobody declared"
    assert list(log.stages) == STAGES
    assert log.advances == sum(total for total, _ in log.stages.values())
    assert all(done == 0 for _, done in log.stages.values())
    assert len(table) == 2 * 7
    assert len(set(zip(table.scene, table.engine, table.method, table.dt, strict=True))) == 14
    assert set(table.status) == {"ok"}
    assert set(table.reason) == {""}
    assert set(table.n) == {2}
    assert set(table.horizon_s) == {2.0}
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
    assert set(finished.results.cases.cause) == {"integration"}  # two seconds are too few to tell chaos
    assert finished.results.cases.model_error.max() < 1e-6
    assert (cases(finished, engine="pymunk").gap_max > 0).all()
    assert (cases(finished, engine="analytic").gap_max == 0).all()
    told = finished.results.cases["flags"]
    assert not told.str.contains("too good|another system|plateau|order ", regex=True).any(), told.tolist()


def test_the_other_tables_agree_with_the_cases(two):
    finished = two[0]
    tables = finished.results.tables
    assert len(tables["starts"]) == 2 * len(finished.results.cases)
    assert len(tables["scenes"]) == 2
    assert len(tables["causes"]) == 2 * 4
    own = tables["starts"][tables["starts"].start == 0]
    assert sorted(own.error_max) == sorted(finished.results.cases.error_max)
    assert (tables["curves"].groupby(["scene", "engine", "method"]).error.max() > 0).all()
    assert finished.results.provenance["worker processes"] == 2


def test_one_worker_finds_what_two_find(study, two, tmp_path):
    assert_same(run(study, tmp_path, jobs=1), two[0])


def test_a_finished_study_is_not_run_again(study, two, tmp_path):
    log = Log()
    again = run(study, two[2], Idle, jobs=2, log=log)
    assert [total == done > 0 for total, done in log.stages.values()] == [True] * len(STAGES)
    assert log.advances == 0
    pd.testing.assert_frame_equal(again.results.cases, two[0].results.cases, check_exact=True)  # times as well
    assert_same(again, two[0])
    with pytest.raises(AssertionError, match="asked to run"):
        run(study, tmp_path, Idle)  # the guard itself


def test_a_fresh_run_runs_everything_again_and_spares_what_is_not_its_own(study, two, tmp_path):
    work = tmp_path / "work"
    work.mkdir()
    for file in (two[2] / "work").iterdir():
        (work / file.name).write_bytes(file.read_bytes())
    (work / "notes.json").write_text("mine")
    run(study, tmp_path, Idle)
    with pytest.raises(AssertionError, match=r"asked to run .*compile_kernel"):
        run(study, tmp_path, Idle, fresh=True)
    assert [path.name for path in work.iterdir()] == ["notes.json"]


def test_a_damaged_truth_is_computed_again(study, two, tmp_path):
    work = tmp_path / "work"
    work.mkdir()
    for file in (two[2] / "work").iterdir():
        (work / file.name).write_bytes(file.read_bytes())
    damaged, lost, *_ = sorted(work.glob("*.npz"))
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
    total, done = log.stages["compiled kernels"]
    assert total == done


def test_a_scene_that_no_chosen_engine_is_for_is_left_out(tmp_path):
    tables = ENGINES.replace('name    = "mujoco"', 'name    = "mujoco"\nscenes  = ["double_calm"]')
    path = write_study(tmp_path, tables, HEAD.replace("starts        = 1", "starts        = 0"))
    found = run(path, tmp_path / "out", Inline, engines=("mujoco",)).results
    assert set(found.cases.scene) == set(found.tables["scenes"].scene) == {"double_calm"}


@pytest.mark.parametrize(
    ("statuses", "ending"),
    [
        (["ok", "ok"], ("ok", "")),
        (["ok", "torn", "warned"], ("torn", "why 1 (start 1 of 2)")),
        (["crashed", "error"], ("error", "why 1 (start 1 of 1)")),
        (["not finite", "ok"], ("not finite", "why 0")),
    ],
)
def test_a_case_ends_as_the_worst_of_its_starts(statuses, ending):
    runs = [{"status": status, "reason": "" if status == "ok" else f"why {i}"} for i, status in enumerate(statuses)]
    assert tuple(_ending(runs, None, {"horizon": 1.0}).values()) == ending
    assert _ending([], "no such effect", {})["status"] == "refused"
    untold = _ending(runs, None, {"reason": "took too long"})
    assert untold["status"] == ending[0]  # a reference that cannot be had is no failure of the engine
    assert untold["reason"].endswith("not compared, for want of a truth: took too long")


def test_times_are_whole_steps_and_end_with_the_scene(study):
    for case in load_plan(study).cases:
        times = times_of(case, 0.05)
        assert times[0] == 0.0
        assert times[-1] == pytest.approx(2.0)
        assert np.all(np.diff(times) > 0)
        if case.dt is not None:
            assert times / case.dt == pytest.approx(np.rint(times / case.dt), abs=1e-6)


@pytest.mark.parametrize(("dt", "sample"), [(0.3, 0.05), (0.07, 0.05), (1.9, 0.5), (2.0, 2.0), (0.001, 0.0123)])
def test_a_step_that_does_not_fit_the_samples_is_compared_on_its_own_grid(study, dt, sample):
    case = next(case for case in load_plan(study).cases if case.dt is not None)
    case = type(case)(case.scene, case.engine, case.method, dt)
    times = times_of(case, sample)
    steps = np.rint(times / dt)
    assert times == pytest.approx(steps * dt, abs=1e-11)
    assert len(set(steps)) == len(steps)
    assert steps[0] == 0
    assert 0 < times[-1] <= 2.0 + 1e-9
    assert math.isclose(np.diff(times).max(), max(dt, sample), rel_tol=1.0)
