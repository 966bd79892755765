"""`--check` names what got worse, and nothing else."""

from __future__ import annotations

import math

import pandas as pd
import pytest

from pendbench.base.errors import InputError
from pendbench.base.faults import STATUSES
from pendbench.commands import run as api
from pendbench.study import __main__ as command_line
from pendbench.study.baseline import baseline_path, read_baseline, regressions, write_baseline
from support.tiny_study import HEAD, Inline, run, write_study

CASES = pd.DataFrame(
    {
        "scene": ["double", "double", "double", "NA", "NA"],
        "engine": ["mujoco", "mujoco", "1", "mujoco", "picky"],
        "method": ["rk4", "rk4", "tuned", "rk4", "rk4"],
        "dt": [1e-2, 1e-3, math.nan, 1e-2, 1e-2],
        "settings": ["", "", "iterations=50", "", ""],
        "status": ["ok", "ok", "ok", "not finite", "refused"],
        "reason": ["", "", "", "at t = 1 s", "no"],
        "error_half": [1e-4, 1e-8, 3e-3, math.nan, math.nan],
        "energy_drift_half": [1e-5, 1e-9, 2e-3, 0.5, math.nan],
        "gap_max": [0.0, 0.0, 1e-4, 0.0, math.nan],
        "model_error": [1e-12, 1e-12, 1e-11, 1e-12, math.nan],
        "error_max": [0.07, 0.6, 0.9, 0.8, math.nan],
        "step_us": [1.0, 1.0, 2.0, 1.0, math.nan],
    }
)


@pytest.fixture
def baseline(tmp_path):
    path = tmp_path / "baselines" / "mine.csv"
    write_baseline(path, CASES)
    return read_baseline(path)


def worse(baseline: pd.DataFrame, row: int, **changes: object) -> list[str]:
    """The regressions where one row is not what it was."""
    cases = CASES.copy()
    for name, value in changes.items():
        cases.loc[row, name] = value
    return regressions(cases, baseline)


def test_the_same_results_are_no_regression(baseline):
    assert regressions(CASES, baseline) == []
    assert regressions(CASES[::-1], baseline) == []


def test_a_baseline_holds_no_times_and_nothing_that_chaos_decides(baseline):
    assert not {"step_us", "error_max", "reason"} & set(baseline)
    assert worse(baseline, 0, step_us=100.0, error_max=1.4, reason="else") == []


def test_a_study_that_compares_early_keeps_its_largest_error(tmp_path):
    write_baseline(tmp_path / "b.csv", CASES.drop(columns=["error_half", "energy_drift_half"]))
    kept = read_baseline(tmp_path / "b.csv")
    assert worse(kept, 0, error_max=0.14) == [
        "double mujoco rk4 dt=0.01: error_max was 0.07, is 0.14; allowed up to 0.105"
    ]


@pytest.mark.parametrize(
    ("row", "changes", "line"),
    [
        (0, {"error_half": 2e-4}, "double mujoco rk4 dt=0.01: error_half was 0.0001, is 0.0002; allowed up to 0.00015"),
        (1, {"energy_drift_half": 1e-6}, "double mujoco rk4 dt=0.001: energy_drift_half was 1e-09, is 1e-06; allowed"),
        (2, {"gap_max": 1e-2}, "double 1 tuned iterations=50: gap_max was 0.0001, is 0.01; allowed up to 0.00015"),
        (3, {"energy_drift_half": math.inf}, "NA mujoco rk4 dt=0.01: energy_drift_half was 0.5, is inf; allowed up to"),
        (0, {"model_error": 1e-3}, "double mujoco rk4 dt=0.01: model_error was 1e-12, is 0.001; allowed up to 1e-07"),
        (
            0,
            {"error_half": math.nan},
            "double mujoco rk4 dt=0.01: error_half was 0.0001, is nan; allowed up to 0.00015",
        ),
        (
            1,
            {"status": "crashed", "reason": "the process died of SIGSEGV", "error_half": math.nan},
            "double mujoco rk4 dt=0.001: status was 'ok', is 'crashed' (the process died of SIGSEGV)",
        ),
        (4, {"status": "error", "reason": "X"}, "NA picky rk4 dt=0.01: status was 'refused', is 'error' (X)"),
    ],
)
def test_what_got_worse_is_one_line_with_scene_engine_method_and_number(baseline, row, changes, line):
    found = worse(baseline, row, **changes)
    assert len(found) == 1
    assert found[0].startswith(line)


@pytest.mark.parametrize(
    ("row", "changes"),
    [
        (0, {"error_half": 1.49e-4}),  # within the band
        (0, {"error_half": 1e-6}),  # better
        (1, {"error_half": 9e-11}),  # below the floor
        (0, {"gap_max": 5e-10, "model_error": 5e-9}),
        (3, {"status": "ok", "reason": "", "error_half": 1.0}),  # it failed before
        (4, {"status": "ok", "error_half": 1.0}),
    ],
)
def test_what_stayed_within_the_band_or_got_better_is_no_regression(baseline, row, changes):
    assert worse(baseline, row, **changes) == []


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"order_observed": 3.81, "stable_dt": 0.00801, "verdict": "holds"}, None),
        ({"order_observed": 4.19, "stable_dt": 0.5}, None),
        ({"order_observed": 3.79}, "double mujoco rk4: order_observed was 4, is 3.79; allowed from 3.8 to 4.2"),
        ({"order_observed": 4.21}, "double mujoco rk4: order_observed was 4, is 4.21; allowed from 3.8 to 4.2"),
        ({"order_observed": math.nan}, "double mujoco rk4: order_observed was 4, is nan; allowed from 3.8 to 4.2"),
        ({"stable_dt": 0.00799}, "double mujoco rk4: stable_dt was 0.01, is 0.00799; allowed from 0.008"),
        ({"stable_dt": math.nan}, "double mujoco rk4: stable_dt was 0.01, is nan; allowed from 0.008"),
        ({"verdict": "breaks", "reason": "why"}, "double mujoco rk4 dt=0.01: verdict was 'drifts', is 'breaks' (why)"),
    ],
)
def test_what_all_steps_of_a_method_show_may_not_get_worse(tmp_path, changes, line):
    """An order is as bad above as below, by 0.2; a largest stable step may be larger, or smaller by a fifth."""
    cases = CASES[:1].assign(order_observed=4.0, stable_dt=0.01, verdict="drifts")
    write_baseline(tmp_path / "mine.csv", cases)
    text = (tmp_path / "mine.csv").read_text().splitlines()
    assert text[0] == "scene,engine,method,dt,settings,status,verdict,order_observed,stable_dt"
    assert text[1] == "double,mujoco,rk4,0.01,,ok,drifts,4,0.01"
    found = regressions(cases.assign(**changes), read_baseline(tmp_path / "mine.csv"))
    assert found == ([line] if line else [])


def test_what_a_study_no_longer_has_is_not_compared(tmp_path):
    cases = CASES[:1].assign(order_observed=4.0, stable_dt=0.01)
    write_baseline(tmp_path / "mine.csv", cases)
    assert regressions(CASES[:1], read_baseline(tmp_path / "mine.csv")) == []


@pytest.mark.parametrize("before", STATUSES)
def test_a_status_is_worse_only_after_the_one_before(before):
    for now in STATUSES:
        row = CASES.iloc[[0]].assign(
            error_half=math.nan, energy_drift_half=math.nan, gap_max=math.nan, model_error=math.nan
        )
        found = regressions(row.assign(status=now), row.assign(status=before))
        assert bool(found) == (list(STATUSES).index(now) > list(STATUSES).index(before))


def test_a_case_that_is_gone_is_named_unless_it_was_not_asked_for(baseline):
    assert regressions(CASES.drop(index=1), baseline) == ["double mujoco rk4 dt=0.001: in the baseline, but not run"]
    assert regressions(CASES[CASES.engine == "mujoco"], baseline) == []
    assert regressions(CASES.iloc[:0], baseline) == []


def test_a_scene_that_is_gone_is_named(baseline):
    gone = regressions(CASES[CASES.scene == "double"], baseline)
    assert gone
    assert all(line.endswith("in the baseline, but not run") for line in gone)


def test_a_case_without_a_baseline_is_named(baseline):
    new = CASES.iloc[[0]].assign(dt=1e-4, error_half=1.0)
    assert regressions(pd.concat([CASES, new]), baseline) == ["double mujoco rk4 dt=0.0001: not in the baseline"]


def test_a_quick_study_has_a_baseline_of_its_own(tmp_path):
    study = tmp_path / "mine.toml"
    assert baseline_path(study, quick=False) == tmp_path / "baselines" / "mine.csv"
    assert baseline_path(study, quick=True) == tmp_path / "baselines" / "mine.quick.csv"


HEADING = "scene,engine,method,dt,settings,status,error_half\n"
BROKEN = {
    "nothing": b"",
    "one line": b"\n",
    "another table": b"a,b\n1,2\n",
    "no status": b"scene,engine,method,dt,settings\ndouble,mujoco,rk4,0.01,\n",
    "a word for an error": (HEADING + "double,mujoco,rk4,0.01,,ok,small\n").encode(),
    "a word for a step": (HEADING + "double,mujoco,rk4,big,,ok,1\n").encode(),
    "an unknown status": (HEADING + "double,mujoco,rk4,0.01,,okay,1\n").encode(),
    "a short line": (HEADING + "double,mujoco\n").encode(),
    "a long line": (HEADING + "double,mujoco,rk4,0.01,,ok,1,2,3\n").encode(),
    "bytes": b"\xff\xfe\x00\x01",
    "an open quote": (HEADING + '"double,mujoco\n').encode(),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_baseline_is_one_line(tmp_path, kind):
    path = tmp_path / "b.csv"
    path.write_bytes(BROKEN[kind])
    with pytest.raises(InputError) as caught:
        read_baseline(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: not a baseline: ")
    assert len(message.splitlines()) == 1


def test_a_baseline_that_is_not_there_is_one_line_and_says_how_to_write_one(tmp_path):
    with pytest.raises(InputError, match="no baseline to check against; --update-baseline writes one"):
        read_baseline(tmp_path / "b.csv")
    with pytest.raises(InputError, match="not a baseline: IsADirectoryError"):
        read_baseline(tmp_path)


# The command line.


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A study that has run, with the baseline that it wrote."""
    folder = tmp_path_factory.mktemp("study")
    path = write_study(folder, head=HEAD.replace("starts        = 1", "starts        = 0"))
    run(path, folder / "out", Inline, update_baseline=True)
    return path


@pytest.fixture
def check(study, monkeypatch, capsys):
    """`--check` on what is in the study's folder; gives the exit code and what it said."""
    monkeypatch.setattr(api, "LocalPool", Inline)
    monkeypatch.setattr(api, "write_report", lambda results, out, stage: None)  # noqa: ARG005

    def check(*options: str):
        capsys.readouterr()
        code = command_line.main([str(study), "--out", str(study.parent / "out"), "--check", *options])
        said = capsys.readouterr().err.splitlines()
        return code, [line for line in said if not line.endswith("kept from before") and "what moves" not in line]

    return check


@pytest.fixture
def edit(study):
    """A function that changes the study's baseline, for the length of a test."""
    path = baseline_path(study, quick=False)
    before = path.read_text()
    yield lambda change: path.write_text(change(path.read_text()))
    path.write_text(before)


def test_check_passes_on_the_baseline_that_the_study_wrote(check):
    assert check() == (0, [])
    assert check("--engines", "analytic") == (0, [])


def test_check_fails_and_names_what_got_worse(check, edit, study):
    table = read_baseline(baseline_path(study, quick=False))
    chosen = (table.engine == "mujoco") & (table.scene == "double") & (table.dt == 1e-2)
    table.loc[chosen, "error_half"] *= 0.1
    edit(lambda _: table.to_csv(index=False))
    code, said = check()
    assert code == 1
    assert len(said) == 1
    assert said[0].startswith("regression: double mujoco euler dt=0.01: error_half was ")
    assert check("--engines", "analytic,pymunk") == (0, [])


def test_check_without_a_baseline_is_bad_input_before_anything_runs(check, edit, study):
    path = baseline_path(study, quick=True)
    assert check("--quick") == (2, [f"error: {path}: no baseline to check against; --update-baseline writes one"])
    edit(lambda text: text.replace("ok", "okay"))
    code, said = check()
    assert code == 2
    assert said[0].startswith(f"error: {baseline_path(study, quick=False)}: not a baseline: ")
    assert len(said) == 1


def test_an_update_writes_what_the_next_check_compares_with(check, edit, study):
    path = baseline_path(study, quick=False)
    before = path.read_text()
    edit(lambda _: "broken")
    assert check("--update-baseline")[0] == 2  # what is there is compared with first
    run(study, study.parent / "out", Inline, update_baseline=True)
    assert path.read_text() == before
