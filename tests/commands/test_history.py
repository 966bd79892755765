"""`pendbench history`: releases that are made by hand, and one that is run; no network."""

from __future__ import annotations

import csv
import itertools
import sys
from pathlib import Path

import pandas as pd
import pytest

from pendbench.__main__ import main
from pendbench.commands import releases as running
from pendbench.commands.history_record import History
from pendbench.commands.releases import Asked, Release, run_releases
from pendbench.execution.environments import Environment, InstallError
from pendbench.execution.runner import Silence

COST = {
    "scene": "double",
    "n": "2",
    "engine": "mine",
    "method": "rk4",
    "dt": 1e-3,
    "settings": "",
    "status": "ok",
    "reason": "",
    "error_max": 1e-4,
    "reference_error": 1e-20,
    "energy_drift_max": 1e-6,
    "energy_floor": float("nan"),
    "gap_max": 0.0,
    "steps": "1000",
    "step_us": 10.0,
    "step_spread": 0.02,
    "run_s": 0.01,
}
STABLE = {name: COST[name] for name in ("scene", "n", "engine", "method", "settings", "status", "reason")}
STABLE |= {"dt": 1e-2, "verdict": "drifts", "stable_dt": 4e-3}


def release(version, *, stable_dt=4e-3, rounds=2, methods=("rk4",), **changes):
    rows = [COST | {"method": method} | changes for method in methods]
    stability = pd.DataFrame([STABLE | {"method": method, "stable_dt": stable_dt} for method in methods])
    return Release(version, package="mine", costs=(pd.DataFrame(rows),) * rounds, stability=stability)


def moved(*releases):
    return [[(each.what, each.outcome) for each in step.changes] for step in History("mine", releases, 2).steps]


def test_what_changed_is_told_for_each_release_by_the_judgement_of_compare():
    assert moved(release("1"), release("2")) == [[]]
    assert moved(release("1"), release("2", error_max=1.4e-4), release("3", error_max=2.2e-4)) == [
        [], [("error_max", "worse")],
    ]  # fmt: skip
    assert moved(release("1"), release("2", step_us=15.0)) == [[("step_us", "worse")]]
    assert moved(release("1"), release("2", step_us=15.0, step_spread=0.3)) == [[]]  # noise
    assert moved(release("1"), release("2", stable_dt=3e-3)) == [[("stable_dt", "worse")]]
    assert moved(release("1", status="crashed"), release("2")) == [[("status", "better")]]


def test_what_moves_slowly_is_told_from_the_first_to_the_last():
    """A third more in each release is no change by itself; three of them are 2.4 times as much."""
    found = History("mine", tuple(release(str(k), error_max=1e-4 * 1.34**k) for k in range(4)), 1)
    assert not any(step.changes for step in found.steps)
    assert [each.what for each in found.whole.changes] == ["error_max"]


def test_the_same_digits_are_known_and_methods_that_come_and_go(tmp_path):
    found = History(
        "mine", (release("1"), release("2"), release("3", error_max=1e-4 * (1 + 1e-15), methods=("rk4", "new"))), 1
    )
    assert [(each.same, each.of, each.alike) for each in found.steps] == [(1, 1, True), (0, 1, False)]
    assert found.steps[1].methods == "+new"
    found.save(tmp_path)
    assert "To the last digit of every error and energy, 2 gives what the release before gave." in found.answer


def test_the_report_holds_every_release_with_numbers_or_a_reason(tmp_path):
    lost = Release("3", "does not install: <b>no</b> | such version")
    found = History("mine", (release("1"), release("2", error_max=1e-3, step_us=10.5), lost), 2)
    assert "Of 2 releases of mine, 1 changes a number: 2." in found.answer
    assert "Not measured, or not in full: 3." in found.answer
    assert found.lines == ["3: does not install: <b>no</b> | such version",
                           "2: worse: double mine rk4 dt=0.001 n=2: error_max was 0.0001, is 0.001"]  # fmt: skip
    found.save(tmp_path)
    with (tmp_path / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["version"], row["status"], row["error_max"], row["stable_dt"]) for row in rows] == [
        ("1", "ok", "0.0001", "0.004"), ("2", "ok", "0.001", "0.004"), ("3", "not measured", "", ""),
    ]  # fmt: skip
    assert (tmp_path / "plots" / "history.png").read_bytes().startswith(b"\x89PNG")
    assert "<b>no</b>" not in (tmp_path / "report.html").read_text()
    assert "| 1 | 2 | 0 of 1 | 1 | 0 | 0 |" in (tmp_path / "report.md").read_text()


def test_costs_are_those_of_calm_rounds():
    rounds = [{"step_us": 10.0}, {"step_us": 99.0, "step_spread": 0.5}, {"step_us": 12.0}]
    tables = tuple(pd.DataFrame([COST | each]) for each in rounds)
    (row,) = History("mine", (Release("1", costs=tables),), 3).table
    assert row.step_us == 11.0
    assert row.step_spread == pytest.approx(89 / 11)


def test_nothing_to_compare_is_said(tmp_path):
    found = History("mine", (release("1"), Release("2", "does not run")), 1)
    assert "Of 2 releases of mine, 1 could be measured: nothing to compare." in found.answer
    History("mine", (Release("1", "no"), Release("2", "no")), 1).save(tmp_path)
    assert "## What could not be measured" in (tmp_path / "report.md").read_text()


@pytest.fixture
def stub(monkeypatch):
    """Environments that are only names, and studies that write what `numbers` says; returns what was called."""
    calls, numbers = [], {}

    def make(packages, version, fixed):
        assert packages == ("pymunk",)
        assert "pymunk" not in fixed
        assert fixed["numpy"]
        if version == "0.1":
            raise InstallError("No matching distribution found for pymunk==0.1")
        return Environment(Path(version), packages[0], version)

    def call(command):
        version, folder = command[0], Path(command[command.index("--out") + 1])
        what = folder.relative_to(folder.parents[1 if folder.name == "stability" else 2]).as_posix()
        calls.append(what)
        answer = numbers.get(version, {})
        if isinstance(answer, BaseException):
            raise answer
        if isinstance(answer, tuple):
            return answer
        folder.mkdir(parents=True, exist_ok=True)
        row = STABLE if "stability" in what else COST | answer
        pd.DataFrame([row]).to_csv(folder / "cases.csv", index=False)
        return 0, ""

    monkeypatch.setattr(running, "environment", make)
    monkeypatch.setattr(running, "_called", call)
    return calls, numbers


def asked(out, *versions, rounds=3):
    return Asked("pymunk", versions, ("double",), rounds, out)


def test_the_clock_goes_forth_and_back_and_what_fails_is_left_out(tmp_path, stub):
    calls, numbers = stub
    numbers["3"] = 2, "error: FILE: engine 'pymunk' cannot be loaded (ImportError: batch); install it with: pip"
    numbers["4"] = -11, ""
    numbers["5"] = {"status": "error", "reason": "AttributeError: MjSpec"}
    found = {each.version: each for each in run_releases(asked(tmp_path, *"12345", "0.1"), Silence())}
    rounds = [[call for call in calls if call.endswith(f"cost/{k}")] for k in (1, 2, 3)]
    assert rounds[0] == [f"{version}/cost/1" for version in "12345"]
    assert rounds[1:] == [["2/cost/2", "1/cost/2"], ["1/cost/3", "2/cost/3"]]
    assert [len(found[version].costs) for version in "12345"] == [3, 3, 0, 0, 0]
    assert found["3"].reason.endswith("engine 'pymunk' cannot be loaded (ImportError: batch)")
    assert found["4"].reason == "does not run: ended by signal SIGSEGV"
    assert found["5"].reason == "does not run: AttributeError: MjSpec"
    assert found["0.1"].reason == "does not install: No matching distribution found for pymunk==0.1"


def test_what_was_finished_before_it_stopped_is_not_run_again(tmp_path, stub):
    calls, numbers = stub
    numbers["2"] = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        run_releases(asked(tmp_path, "1", "2", rounds=1), Silence())
    assert calls == ["1/cost/1", "2/cost/1"]
    del calls[:], numbers["2"]
    run_releases(asked(tmp_path, "1", "2", rounds=1), Silence())
    assert calls == ["2/cost/1", "1/stability", "2/stability"]
    del calls[:]
    run_releases(Asked("pymunk", ("1",), ("single",), 1, tmp_path), Silence())  # of another scene nothing is there
    assert calls == ["1/cost/1", "1/stability"]


def test_a_release_is_run_as_the_studies_say(tmp_path, monkeypatch):
    """For once in truth, with the release that is here."""
    scene = tmp_path / "short one.toml"
    scene.write_text('title = "t"\nduration = 0.2\n[chain]\nn = 1\nlength = 1.0\nmass = 1.0\n[start]\nangles = 1.0\n'
                     "[effects]\ngravity = 9.81\n")  # fmt: skip
    here = Environment(Path(sys.executable), "pymunk", "here")
    monkeypatch.setattr(running, "environment", lambda *_: here)
    monkeypatch.setattr(running, "clean", lambda: None)  # what is shared with an environment is its own affair
    (found,) = run_releases(Asked("pymunk", ("here",), (str(scene),), 1, tmp_path / "out"), Silence())
    assert not found.reason
    rows = {row.method: row for row in History("pymunk", (found,), 1).table}
    assert list(rows) == ["default", "tuned"]
    # Orders 1 and 2, and a step of a thousandth of a second: the period is 2 s.
    assert 1e-5 < rows["default"].error_max < 1e-2
    assert rows["tuned"].error_max < 1e-5
    assert all(row.stable_dt >= 1e-3 and row.step_us > 0 for row in rows.values())
    written = {path.name for path in (tmp_path / "out" / "here" / "cost" / "1").iterdir()}
    assert {"cases.csv", "provenance.json"} <= written
    assert not {"report.md", "plots"} & written


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nosuch", "--versions", "1,2"], "unknown engine 'nosuch'"),
        (["analytic", "--versions", "1,2"], "comes with pendbench; allowed: an engine that has releases of its own"),
        (["pymunk", "--versions", "7.0"], "--versions has 1; allowed: 2 to 64"),
        (["pymunk", "--versions", "7.0,7.0"], "--versions has 7.0 twice"),
        (["pymunk", "--versions", "7.0,-r x"], "--versions has '-r x'; allowed: versions such as 3.2.0"),
        (["pymunk", "--versions", "7.0,../x"], "--versions has '../x'"),
        (["pymunk", "--versions", ","], "--versions is ','"),
        (["pymunk"], "--versions"),
        (["pymunk", "--versions", "1,2", "--rounds", "0"], "--rounds is 0; allowed: 1 to 50"),
        (["pymunk", "--versions", "1,2", "--out", ""], "--out is empty"),
        (["pymunk", "--versions", "1,2", "--scenes", "dubble"], "unknown scene 'dubble'; did you mean 'double'?"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    assert main(["history", *words]) == 2
    error = capsys.readouterr().err.splitlines()
    assert len(error) == 1
    assert said in error[0]
    assert not list(itertools.chain(tmp_path.rglob("*.toml"), tmp_path.rglob("*.md")))


def test_the_command_says_what_it_found_and_fails_where_no_release_runs(tmp_path, stub, capsys):
    _, numbers = stub
    numbers["2"] = {"error_max": 1e-2}
    assert main(["history", "pymunk", "--versions", "1,2,0.1", "--rounds", "1", "--out", str(tmp_path / "a")]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "0.1: does not install: No matching distribution found for pymunk==0.1"
    assert said[1] == "2: worse: double mine rk4 dt=0.001 n=2: error_max was 0.0001, is 0.01"
    numbers["1"] = numbers["2"] = 2, "error: no"
    assert main(["history", "pymunk", "--versions", "1,2", "--out", str(tmp_path / "b")]) == 1
    assert (tmp_path / "b" / "report.md").exists()
