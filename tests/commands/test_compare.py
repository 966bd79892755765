"""`pendbench compare`: what got better or worse, and what is noise, from tables and gates made by hand."""

from __future__ import annotations

import dataclasses
import json
import math

import pandas as pd
import pytest

import pendbench as pb
from pendbench.__main__ import main
from pendbench.base.errors import InputError
from pendbench.commands.gate_record import Gate, json_text
from pendbench.engines.conformance.check import Finding

ROW = {
    "scene": "double",
    "n": 2,
    "engine": "mujoco",
    "method": "rk4",
    "dt": 1e-3,
    "settings": "",
    "status": "ok",
    "reason": "",
    "error_max": 0.7,
    "error_half": 1e-4,
    "reference_error_half": 1e-20,
    "t_1e-2_s": 6.0,
    "t_1e-2_min_s": 5.5,
    "t_1e-2_max_s": 6.5,
    "t_1e-2_lyapunov": 12.0,
    "t_1e-2_band_s": 0.01,
    "energy_drift_max": 1e-3,
    "energy_floor": "",
    "energy_drift_half": 1e-7,
    "order_claimed": 4,
    "order_observed": 4.0,
    "step_us": 10.0,
    "step_spread": 0.02,
    "run_s": 1.0,
}
ABOUT = {"study": "mine", "kind": "chaos", "processor": "one", "scene double": "aa"}


def write(folder, *rows, about=ABOUT, without=()):
    folder.mkdir(parents=True, exist_ok=True)
    pd.DataFrame([ROW | row for row in rows or ({},)]).drop(columns=list(without)).to_csv(
        folder / "cases.csv", index=False
    )
    if about is not None:
        (folder / "provenance.json").write_text(json.dumps(about))
    return folder


@pytest.fixture
def outcomes(tmp_path):
    """What `compare` says where a row has changed: the outcome of each column that is not the same."""

    def outcomes(before, after):
        found = pb.compare(write(tmp_path / "a", before), write(tmp_path / "b", after))
        back = pb.compare(tmp_path / "b", tmp_path / "a")
        swapped = {each.what: each.outcome for each in back.worse + back.better}
        told = {each.what: each.outcome for each in found.worse + found.better}
        opposite = {"better": "worse", "worse": "better"}
        assert swapped == {what: opposite[outcome] for what, outcome in told.items()}  # or B to A says another thing
        return told

    return outcomes


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ({}, {}, {}),
        ({}, {"error_half": 1.6e-4}, {"error_half": "worse"}),
        ({}, {"error_half": 1.4e-4}, {}),  # other rounding
        ({"error_half": 1e-15}, {"error_half": 9e-11}, {}),  # rounding
        ({"error_half": 1e-15}, {"error_half": 2e-10}, {"error_half": "worse"}),
        ({"reference_error_half": 1e-3}, {"reference_error_half": 1e-3, "error_half": 9e-4}, {}),  # not known so well
        ({"error_half": 0.3}, {"error_half": 1.5}, {}),  # both have lost the truth
        ({"error_half": 0.05}, {"error_half": 1.5}, {"error_half": "worse"}),
        ({}, {"error_max": 0.01, "energy_drift_max": 1.0}, {}),  # past half of the horizon chaos decides
        ({}, {"energy_drift_half": 1e-6}, {"energy_drift_half": "worse"}),
        ({}, {"order_observed": 3.5}, {"order_observed": "worse"}),
        ({}, {"order_observed": 3.85}, {}),
        # The starts' spread, 5.5 to 6.5, and a Lyapunov time, 0.5 s, to either side.
        ({}, {"t_1e-2_s": 4.6, "t_1e-2_min_s": 4.5, "t_1e-2_max_s": 4.7}, {}),
        ({}, {"t_1e-2_s": 4.2, "t_1e-2_min_s": 4.1, "t_1e-2_max_s": 4.3}, {"t_1e-2_s": "worse"}),
        ({}, {"t_1e-2_s": "", "t_1e-2_min_s": "", "t_1e-2_max_s": ""}, {"t_1e-2_s": "better"}),  # never
        ({}, {"step_us": 13.0}, {"step_us": "worse"}),
        ({}, {"step_us": 10.9}, {}),  # a calm machine does that by itself
        ({"step_spread": 0.09}, {"step_us": 13.0, "step_spread": 0.09}, {}),  # 10.9 and 11.8
        ({}, {"step_us": 50.0, "step_spread": 0.3}, {}),  # noise
        ({}, {"run_s": 9.0}, {}),  # of a fixed step: what a step costs says it
        ({"dt": ""}, {"dt": "", "run_s": 9.0}, {"run_s": "worse"}),
        ({}, {"error_half": ""}, {"error_half": "worse"}),
        ({}, {"status": "crashed", "error_half": 1.0, "step_us": 99.0}, {"status": "worse"}),  # and nothing else
        ({"status": "torn"}, {"status": "torn", "energy_drift_half": 0.5}, {}),  # of a run that broke it is chance
    ],
)
def test_what_changed_is_told_from_noise_and_the_other_way_round(outcomes, before, after, said):
    assert outcomes(before, after) == said


def test_what_is_noise_is_said_to_be_not_told(tmp_path):
    found = pb.compare(write(tmp_path / "a"), write(tmp_path / "b", {"step_spread": 0.3}))
    assert [(each.what, each.why) for each in found.found.of("not told")] == [("step_us", "noisy timing: spread 30%")]
    assert "noisy timing: 1 time" in found.markdown()


def test_a_verdict_stands_for_how_a_run_ended_and_for_its_numbers(outcomes):
    held = {"verdict": "holds", "stable_dt": 0.01}
    assert outcomes(held, held | {"error_half": 1.0, "energy_drift_half": 1.0}) == {}
    assert outcomes(held, held | {"verdict": "drifts", "stable_dt": 0.001}) == {"verdict": "worse"}
    assert outcomes(held, held | {"stable_dt": 0.0081}) == {}
    assert outcomes(held, held | {"stable_dt": 0.0079}) == {"stable_dt": "worse"}
    assert outcomes(held, held | {"stable_dt": ""}) == {"stable_dt": "worse"}


def test_repeated_runs_say_how_far_a_cost_ranges(tmp_path):
    """Costs of 10 and 10.5, and then of 13 and 15: another one. Of 10 and 12 before: not another one."""
    for name, costs in {"one": (10, 10.5), "two": (13, 15), "wide": (10, 12)}.items():
        for at, cost in enumerate(costs):
            write(tmp_path / name / f"run{at}", {"step_us": cost})
    assert [each.what for each in pb.compare(tmp_path / "one", tmp_path / "two").worse] == ["step_us"]
    assert pb.compare(tmp_path / "wide", tmp_path / "two").worse == ()


def test_a_cost_without_a_spread_wants_repeated_runs(tmp_path):
    cheap, dear = {"step_us": 10.0, "step_spread": ""}, {"step_us": 30.0, "step_spread": ""}
    a, b = write(tmp_path / "a", cheap), write(tmp_path / "b", dear)
    assert [each.why for each in pb.compare(a, b).found.of("not told")] == ["one run, and no spread"]
    for at in range(2):
        write(tmp_path / "aa" / str(at), cheap)
        write(tmp_path / "bb" / str(at), dear)
    assert [each.what for each in pb.compare(tmp_path / "aa", tmp_path / "bb").worse] == ["step_us"]


def test_times_of_another_machine_are_not_compared(tmp_path):
    a, b = write(tmp_path / "a"), write(tmp_path / "b", {"step_us": 99.0}, about=ABOUT | {"processor": "two"})
    found = pb.compare(a, b)
    assert not found.worse
    assert "Times are of another machine" in found.answer
    assert ("processor", "one", "two") in found.around


def test_a_scene_that_is_another_one_is_not_compared(tmp_path):
    a = write(tmp_path / "a", {}, {"scene": "other"})
    b = write(tmp_path / "b", {"error_half": 1.0}, {"scene": "other"}, about=ABOUT | {"scene double": "bb"})
    found = pb.compare(a, b)
    assert not found.worse
    assert found.found.skipped == ("double mujoco rk4 dt=0.001 n=2",)


def test_rows_and_columns_that_one_side_has_are_said(tmp_path):
    a = write(tmp_path / "a", {}, {"dt": 1e-2}, without=["energy_drift_half"], about={"study": "mine"})
    b = write(tmp_path / "b", {}, {"dt": 1e-4, "mine": 3}, without=["order_claimed"])
    found = pb.compare(a, b)
    assert found.found.gone == ("double mujoco rk4 dt=0.01 n=2",)
    assert found.found.new == ("double mujoco rk4 dt=0.0001 n=2",)
    assert found.found.columns_gone == ("order_claimed",)
    assert found.found.columns_new == ("energy_drift_half", "mine")
    assert not found.worse + found.better
    for said in ("dt=0.01 n=2", "dt=0.0001 n=2", "order_claimed", "energy_drift_half and mine"):
        assert said in found.markdown()


def test_a_result_that_is_lost_is_something_that_got_worse(tmp_path, capsys):
    """A row that was there and is not: the command says so and fails. One more row is no loss."""
    a, b = write(tmp_path / "a", {}, {"dt": 1e-2}), write(tmp_path / "b", {})
    assert main(["compare", str(a), str(b)]) == 1
    said = capsys.readouterr().out
    assert "lost: double mujoco rk4 dt=0.01 n=2: only in " in said
    assert "Lost: 1 row of the first that the second does not have." in said
    assert main(["compare", str(b), str(a)]) == 0
    gates = (
        gate_file(tmp_path / "a.json", CHECK, dataclasses.replace(CHECK, method="euler")),
        gate_file(tmp_path / "b.json"),
    )
    assert main(["compare", *map(str, gates)]) == 1
    assert pb.compare(*gates).lost == ("euler converges",)


def test_long_chains_of_one_scene_are_told_apart_by_their_links(tmp_path):
    rows = {"n": 1}, {"n": 10, "error_half": 1e-2}
    assert not pb.compare(write(tmp_path / "a", *rows), write(tmp_path / "b", *rows[::-1])).worse


def test_the_command_says_it_writes_it_and_ends_with_what_was_found(tmp_path, capsys):
    a, b = write(tmp_path / "a"), write(tmp_path / "b", {"error_half": 1e-3})
    assert main(["compare", str(a), str(a)]) == 0
    assert capsys.readouterr().out.startswith("Nothing got worse or better, of ")
    assert main(["compare", str(b), str(a)]) == 0
    assert "Nothing got worse; of 6 values that both have, 1 got better." in capsys.readouterr().out
    assert main(["compare", str(a), str(b), "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().out.splitlines()
    assert "Of 6 values that both have, 1 got worse and 0 better." in said
    assert "worse: double mujoco rk4 dt=0.001 n=2: error_half was 0.0001, is 0.001" in said
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"compare.md", "compare.html"}
    page = (tmp_path / "out" / "compare.md").read_text()
    assert "| double mujoco rk4 dt=0.001 n=2 | accuracy | error_half | 0.0001 | 0.001 |  |" in page
    assert "error_half" in (tmp_path / "out" / "compare.html").read_text()


def test_whatever_a_table_holds_stays_text(tmp_path):
    hostile = {"scene": "<script>|`*x*", "status": "ok"}
    a, b = write(tmp_path / "a", hostile), write(tmp_path / "b", hostile | {"status": "error", "reason": "<b>\n|"})
    found = pb.compare(a, b)
    assert len(found.worse) == 1
    assert "<script>|" not in found.html()
    assert "<script>|" not in found.markdown()
    assert "<b>" not in found._repr_html_()


CHECK = Finding("converges", "rk4", "", "passed", 0.05, 0.2, "orders", "the order", "")


def gate_file(path, *checks, **others):
    values = {"engine": "mine", "version": "1", "precision": "double", "seed": 0, "isolated": True}
    path.write_text(json_text(Gate(**(values | others), checks=checks or (CHECK,))))
    return path


@pytest.mark.parametrize(
    ("before", "after", "outcome"),
    [
        ({}, {"value": 0.19}, None),  # within its limit
        ({}, {"status": "failed", "value": 3.0, "cause": "too low"}, "worse"),
        ({"status": "failed", "value": 3.0}, {"status": "failed", "value": 4.0}, None),
        ({"status": "failed", "value": 3.0}, {"status": "failed", "value": 5.0}, "worse"),
        ({"status": "failed", "value": 3.0}, {"status": "failed", "value": math.inf}, "worse"),
        ({"status": "failed", "value": 3.0}, {"status": "error", "value": math.nan}, "worse"),
        ({"status": "error", "value": math.nan}, {}, "better"),
        ({}, {"status": "skipped", "value": math.nan, "cause": "no damping"}, None),
    ],
)
def test_gates_are_compared_by_check(tmp_path, before, after, outcome):
    a = gate_file(tmp_path / "a.json", dataclasses.replace(CHECK, **before))
    b = gate_file(tmp_path / "b.json", dataclasses.replace(CHECK, **after))
    found = pb.compare(a, b)
    assert [each.outcome for each in found.worse + found.better] == ([outcome] if outcome else [])
    assert pb.compare(b, a).found.skipped == found.found.skipped
    assert found.found.skipped == (("rk4 converges: no damping",) if after.get("status") == "skipped" else ())


def test_gates_say_what_only_one_asked_and_where_they_are_from(tmp_path):
    other = dataclasses.replace(CHECK, about="a long rope")
    a, b = gate_file(tmp_path / "a.json"), gate_file(tmp_path / "b.json", CHECK, other, version="2")
    found = pb.compare(a, b)
    assert found.found.new == ("rk4 converges [a long rope]",)
    assert found.around == (("its version", "1", "2"),)
    assert main(["compare", str(a), str(b)]) == 0
    assert "A value\nwithin its limit" in found.markdown()


@pytest.fixture
def bad(tmp_path):
    """A folder with what cannot be compared, each under its name."""
    write(tmp_path / "good")
    write(tmp_path / "cost", about=ABOUT | {"kind": "cost"})
    write(tmp_path / "else", {"scene": "another"})
    write(tmp_path / "two" / "a")
    write(tmp_path / "two" / "b", about=ABOUT | {"study": "other"})
    write(tmp_path / "kinds" / "a")
    write(tmp_path / "kinds" / "b", about=ABOUT | {"kind": "cost"})
    write(tmp_path / "prov").joinpath("provenance.json").write_text("[1")
    (tmp_path / "empty").mkdir()
    (tmp_path / "table").mkdir()
    (tmp_path / "table" / "cases.csv").write_text("a,b\n1,2\n")
    (tmp_path / "nothing").mkdir()
    (tmp_path / "nothing" / "cases.csv").write_text("scene,engine,method,dt,settings,status\n")
    (tmp_path / "junk.json").write_text("{")
    (tmp_path / "list.json").write_text("[]")
    gate_file(tmp_path / "gate.json")
    return tmp_path


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("missing", "there is nothing; allowed: a study's results"),
        ("cost", "studies of the kinds chaos and cost; allowed: two of one kind"),
        ("else", "have nothing in common; allowed: results of the same cases"),
        ("two", "are not runs of one study"),
        ("kinds", "are not runs of one study"),
        ("prov", "not a study's provenance"),
        ("empty", "no cases.csv in there"),
        ("table", "not a study's cases: ValueError: column 'scene' is missing"),
        ("nothing", "has no rows"),
        ("good/cases.csv", "one table; allowed: the folder that it is in"),
        ("junk.json", "is not JSON; allowed: the JSON of a gate"),
        ("list.json", "is not the JSON of a gate"),
        ("gate.json", "results of a study and a gate; allowed: two of a kind"),
    ],
)
def test_what_cannot_be_compared_is_one_line_and_nothing_is_written(bad, capsys, name, said):
    assert main(["compare", str(bad / "good"), str(bad / name), "--out", str(bad / "out")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1
    assert not (bad / "out").exists()


def test_what_is_no_path_is_one_line(tmp_path):
    for path in (3, None, "", "a\0b"):
        with pytest.raises(InputError):
            pb.compare(path, tmp_path)


def test_results_that_do_not_say_their_kind_are_known_by_their_columns(tmp_path):
    """Of a version that did not write it: the columns of a kind's cases."""
    from pendbench.study.kinds import kinds, part_of_kind

    for kind in kinds():
        names = [column.name for column in part_of_kind(kind, "columns").COLUMNS["cases"]]
        row = {name: ROW.get(name, "") for name in names} | ({"verdict": "holds"} if "verdict" in names else {})
        (tmp_path / kind).mkdir()
        pd.DataFrame([row]).to_csv(tmp_path / kind / "cases.csv", index=False)
        assert pb.compare(tmp_path / kind, tmp_path / kind).kind == kind
