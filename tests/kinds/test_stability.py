"""The kind of study `stability`: its runs, its tables, its report, its baseline."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest

from pendbench.base.errors import InputError
from pendbench.commands.run import run_study
from pendbench.kinds.stability import page, work
from pendbench.kinds.stability.columns import CaseRow, StepRow
from pendbench.kinds.stability.plots import cell_text, growth_figure, map_figure
from pendbench.kinds.stability.study import Found, measure
from pendbench.kinds.stability.work import StabilityRun, measure_stability
from pendbench.measures.energy import Balance
from pendbench.measures.verdict import VERDICTS
from pendbench.report.page import Report
from pendbench.report.styles import Styles, engine_hue
from pendbench.scene.scene import load_scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study import runs
from pendbench.study.ask import Refusals, ask_refusals
from pendbench.study.baseline import regressions
from pendbench.study.case import Case
from pendbench.study.plan import load_plan
from pendbench.study.results import Results
from support.oracle import Oracle
from support.reading import cells_of, section
from support.scenes import chain

SCENE = """
title = "A pendulum that hardly moves"
duration = 60.0
[chain]
masses = [1.0]
lengths = [1.0]
[start]
angles = [0.02]
[effects]
gravity = 9.81
"""
UPRIGHT = (
    SCENE.replace("A pendulum that hardly moves", "Upright").replace("0.02", repr(math.pi)).replace("60.0", "20.0")
)
STUDY = """
title = "Small"
kind = "stability"
scenes = ["still.toml", "upright.toml"]
time_limit = 60.0
durations = { still = 60.0, upright = 20.0 }
[[engines]]
name = "analytic"
methods = ["adaptive"]
[[engines]]
name = "analytic"
methods = ["euler", "rk4"]
dt = [1.0, 0.2, 0.05]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("stability")
    (path / "still.toml").write_text(SCENE)
    (path / "upright.toml").write_text(UPRIGHT)
    (path / "small.toml").write_text(STUDY)
    return path


@pytest.fixture(scope="module")
def table(folder):
    return run_study(folder / "small.toml", folder / "out", jobs=1)


def stable(table, method, scene="still"):
    [dt] = set(table[(table.method == method) & (table.scene == scene)].stable_dt)
    return dt


def test_largest_stable_step_is_that_of_linear_theory(table):
    """Semi-implicit Euler keeps an oscillation of frequency w while step times w is below 2."""
    limit = 2.0 / math.sqrt(9.81)
    assert limit / 1.1 <= stable(table, "euler") <= limit


def test_rk4_s_limit_is_the_one_on_the_imaginary_axis(table):
    """Just above 2.83 it grows too slowly to be seen within a minute; below it, it damps by less than a percent."""
    limit = math.sqrt(8.0 / 9.81)
    assert limit / 1.1 <= stable(table, "rk4") <= 1.15 * limit


def test_method_that_chooses_its_steps_has_no_largest_one(table):
    own = table[table.method == "adaptive"]
    assert set(own.verdict) == {"holds"}
    assert own.stable_dt.isna().all()


def test_upright_pendulum_stays_as_long_as_rounding_needs_to_grow(table):
    """From 1.2e-16 rad to 0.1 rad at sqrt(g/l): 11.2 s, and a little more until an angle can show it."""
    [stays] = set(table[(table.method == "adaptive") & (table.scene == "upright")].stays_s)
    assert stays == pytest.approx(math.log(0.2 / 1.2246e-16) / math.sqrt(9.81), rel=0.05)
    assert table[table.scene == "still"].stays_s.isna().all()


def test_report_says_what_was_found(folder, table):
    del table
    page = (folder / "out/report.md").read_text()
    assert "analytic adaptive 2 of 2" in section(page, "The answer")
    assert "![map](plots/map.png)" in section(page, "The answer")
    for heading in ("The largest stable steps", "What breaks whom, and why", "How long what stands stays"):
        assert f"## {heading}" in page
    assert (folder / "out/plots/map.png").stat().st_size > 1000
    assert {"stable_steps.csv", "search.csv", "scenes.csv"} <= {path.name for path in (folder / "out").iterdir()}


# A run.


def judged(monkeypatch, gap, omega=(0.0, 0.0, 0.0)):
    """What is found of a run of a pendulum hanging at rest, with these gaps (k,) and rates (k,) rad/s."""
    scene = dataclasses.replace(load_scene("single"), angles=np.zeros(1), rates=np.zeros(1))
    rates = np.array(omega).reshape(-1, 1)
    run = Trajectory(np.arange(3.0), np.zeros((3, 1)), rates, np.array(gap))
    monkeypatch.setattr(runs, "simulate", lambda *_, **__: run)
    return measure_stability(Case(scene, "analytic", "rk4", 1.0), 2.0)


def test_one_open_joint_at_one_sample_is_a_drift(monkeypatch):
    found = judged(monkeypatch, gap=[0.0, 0.012, 0.0])  # 0.004 in the mean
    assert (found.verdict, found.gap_max) == ("drifts", 0.012)


def test_energy_is_measured_by_the_weights_range(monkeypatch):
    """A pendulum of 1 kg and 1 m at w rad/s has strayed by w^2 / 2 J of 2 g J: by 1 % at 0.6264 rad/s."""
    scene = load_scene("single")
    assert (scene.masses[0], scene.lengths[0], scene.effects.gravity) == (1.0, 1.0, 9.81)
    for rate, verdict in ((0.62, "holds"), (0.63, "drifts"), (6.2, "drifts"), (6.3, "breaks")):
        found = judged(monkeypatch, gap=[0.0] * 3, omega=[0.0, rate, 0.0])
        assert found.verdict == verdict
        assert found.energy_drift_max == pytest.approx(0.5 * rate**2 / 19.62)


def test_a_wrecking_ball_on_light_links_holds_at_a_240th_of_a_second():
    """10 links of 0.1 kg, 50 kg at the tip."""
    scene = chain(10, mass=[0.1] * 9 + [50.0], length=0.2, angle=np.full(10, np.pi / 3), duration=2.0)
    found = measure_stability(Case(scene, "analytic", "rk4", 4.166667e-3), 2.0)
    assert (found.verdict, found.steps) == ("holds", 479)
    assert found.energy_drift_max == pytest.approx(4.7e-8, rel=0.02)


@pytest.mark.parametrize(("moved", "stays"), [([0.0, 0.05, 0.2, 0.4], 2.0), ([0.0, 0.05, 0.09, 0.02], 3.0)])
def test_a_run_has_its_largest_energy_and_gap_and_stays_until_it_first_moved(monkeypatch, moved, stays):
    scene, t = dataclasses.replace(load_scene("double"), rates=np.zeros(2)), np.arange(4.0)
    theta = scene.angles + np.outer(moved, [0.5, -1.0])
    run = Trajectory(t, theta, np.zeros((4, 2)), np.array([0.0, 0.3, 0.1, 0.2]), steps=3)
    balance = Balance(t, np.array([0.0, -0.6, 0.4, 0.2]), 2.0, np.zeros(4))
    monkeypatch.setattr(work, "follow", lambda *_: (run, balance))
    monkeypatch.setattr(work, "accelerations", lambda *_: np.zeros(2))  # nothing pulls it
    found = measure_stability(Case(scene, "mujoco", "rk4", 1.0), 3.0)
    assert (found.energy_drift_max, found.gap_max, found.steps, found.stays_s) == (0.3, 0.3, 3, stays)


def test_what_never_came_back_has_its_status_for_a_verdict():
    assert StabilityRun("timed out", "why").verdict == "timed out"


# The study, with a runner that answers at once.


def found_by(folder, verdict_of, name="small.toml", refusals=None):
    """A report on what a study finds where `verdict_of` a case is this."""

    def answer(case, duration):
        del duration
        word = verdict_of(case)
        return StabilityRun(*(("ok", "", word) if word != "timed out" else ("timed out", "more than 60 s")))

    oracle = Oracle({measure_stability: answer, **(refusals or {})})
    plan = load_plan(folder / name)
    results = Results(plan.name, "T", "stability", measure(plan, oracle), plan.options)
    return Report(results), oracle


def up_to(**limits):
    """The verdicts of methods that hold up to a step, s."""
    return lambda case: "holds" if case.dt is None or case.dt <= limits[case.method] else "breaks"


def steps_of(report, method):
    return [row for row in report.tables["stable_steps"] if row.case.method == method]


def test_the_search_is_that_of_each_scene_and_method(folder):
    report, oracle = found_by(folder, up_to(euler=0.3, rk4=0.7))
    for method, limit in (("euler", 0.3), ("rk4", 0.7)):
        assert all(limit / 1.1 <= row.stable_dt <= limit for row in steps_of(report, method))
    asked = [
        task.arguments[0] for tasks in oracle.stages.values() for task in tasks if task.function is measure_stability
    ]
    assert len(set(asked)) == len(asked)
    assert {row.case for row in report.tables["search"]} == set(asked) - {row.case for row in report.cases}


def test_where_nothing_is_compared_with_the_truth_its_proof_is_no_matter(folder):
    other = STUDY.replace('"upright.toml"', '"a01"').replace("upright = 20.0", "a01 = 60.0")
    (folder / "proven.toml").write_text(other)
    report, _ = found_by(folder, up_to(euler=0.3, rk4=0.7), "proven.toml")
    assert "a01" in [row.scene.name for row in report.tables["scenes"]]
    assert "what is proved" not in report.markdown()


def test_kernels_are_compiled_before_any_case_runs(folder):
    _, oracle = found_by(folder, up_to(euler=0.3, rk4=0.7))
    assert list(oracle.stages)[:3] == ["what engines refuse", "kernels compiled", "cases"]
    assert {task.arguments[0] for task in oracle.stages["kernels compiled"]} == {"adaptive", "euler", "rk4"}


def test_no_run_of_the_search_is_more_work_than_allowed(folder):
    (folder / "work.toml").write_text(STUDY.replace("time_limit", "work = 6000\ntime_limit"))
    report, _ = found_by(folder, up_to(euler=0.0, rk4=0.0), "work.toml")
    finest = {row.case.scene.name: row.case.dt for row in report.tables["search"]}
    assert min(dt for name, dt in finest.items() if name == "still") == 0.01  # 60 s in 6000 steps of one link
    assert all(row.is_unknown for row in steps_of(report, "euler"))
    assert "analytic euler 0 of 2 (2 not known)" in report.answer


def test_a_run_that_was_stopped_is_not_known_and_never_does_not_hold(folder):
    limits = up_to(euler=0.3, rk4=0.7)
    report, _ = found_by(folder, lambda case: "timed out" if case.scene.name == "upright" else limits(case))
    for row in (row for row in report.tables["stable_steps"] if row.case.scene.name == "upright"):
        assert (row.is_unknown, cell_text(row)) == (True, "not known")
    assert "analytic adaptive 1 of 2 (1 not known)" in report.answer
    assert "analytic rk4 1 of 2 (1 not known)" in report.answer
    page = report.markdown()
    assert "- analytic rk4: not known in upright" in page
    losses = section(page, "What breaks whom, and why")
    assert "timed out in" not in losses


def test_a_largest_step_below_one_that_was_stopped_is_not_given(folder):
    report, _ = found_by(folder, lambda case: "timed out" if case.dt == 1.0 else "holds")
    for row in steps_of(report, "euler"):
        assert row.holds
        assert math.isnan(row.stable_dt)
        assert cell_text(row) == "holds ?"
    assert "2 of 2" in report.answer


def test_of_methods_that_hold_as_much_the_best_takes_the_larger_steps(folder):
    for better, other in (("rk4", "euler"), ("euler", "rk4")):
        report, _ = found_by(folder, up_to(**{better: 0.7, other: 0.3}))
        assert f"analytic {better} 2 of 2" in report.answer
        assert f"analytic {other}" not in report.answer


WRECK = """
title = "Wrecking ball"
kind = "stability"
scenes = ["still.toml"]
[[engines]]
name = "pymunk"
methods = ["default", "tuned"]
dt = [1.6666667e-2, 4.166667e-3]
[[engines]]
name = "mujoco"
methods = ["euler", "rk4"]
dt = [1.6666667e-2, 4.166667e-3]
"""


def test_the_answer_s_numbers_are_those_of_its_table(folder):
    """The best of pymunk has 4.2 ms and not 0.92, that of MuJoCo 7.0 ms and not 4.5: 1.7 times larger than pymunk's."""
    (folder / "wreck.toml").write_text(WRECK)
    limits = {"default": 9.2e-4, "tuned": 4.2e-3, "euler": 4.5e-3, "rk4": 7.0e-3}
    report, _ = found_by(folder, up_to(**limits), "wreck.toml")
    heading, *rows = cells_of(section(report.markdown(), "The answer"))
    at = {name: heading.index(name) for name in ("method", "scenes", "held by some step", "held at 1/240 s")}
    shown = {row[0]: row for row in rows}
    assert list(shown) == ["mujoco rk4", "pymunk tuned"]
    told = re.findall(r"(\w+ \w+) (\d+) of (\d+)[,.]", report.answer)
    assert [(row[0], row[at["held by some step"]], row[at["scenes"]]) for row in rows] == told
    assert (
        f"with mujoco rk4 are, in the median scene, {shown['pymunk tuned'][-1]} those of pymunk tuned." in report.answer
    )
    ratio = float(shown["pymunk tuned"][-1].rstrip("\u00d7"))
    steps = {row.case.method: row.stable_dt for row in report.tables["stable_steps"]}
    assert ratio == pytest.approx(steps["rk4"] / steps["tuned"], rel=0.05) == pytest.approx(7.0 / 4.2, rel=0.1)
    assert [row[at["held at 1/240 s"]] for row in rows] == ["1", "1"]


def test_what_an_engine_refuses_is_neither_held_nor_lost(folder):
    refuse = {ask_refusals: lambda cases: Refusals("ok", reasons=tuple("too upright" for _ in cases))}
    report, oracle = found_by(folder, up_to(), refusals=refuse)
    assert oracle.stages["cases"] == []
    assert {row.run.verdict for row in report.cases} == {"refused"}
    assert all(row.is_refused and not row.is_unknown for row in report.tables["stable_steps"])
    assert "refused (too upright) in still and upright" in report.markdown()


def test_exponents_are_fitted_to_steps_that_have_a_limit(folder):
    text = STUDY.replace('["still.toml", "upright.toml"]', '["chain5", "chain10", "chain50"]')
    text = text.replace("durations = { still = 60.0, upright = 20.0 }", 'lengths = ["chain5", "chain10", "chain50"]')
    (folder / "lengths.toml").write_text(text.replace("1.0, 0.2, 0.05", "0.05, 0.01"))
    report, _ = found_by(
        folder,
        lambda case: "holds" if case.dt is None or case.dt * case.scene.n**1.5 <= 0.5 else "breaks",
        "lengths.toml",
    )
    [euler, _] = report.tables["growth"]
    assert (euler.n_from, euler.n_to, euler.scenes_held, euler.scenes) == (5, 50, 3, 3)
    assert euler.growth.exponent == pytest.approx(-1.5, abs=0.05)  # each step is known to a tenth
    assert 0 < euler.growth.error < 0.05
    assert f"analytic euler {euler.growth.exponent:.2f} ± {euler.growth.error:.2f}" in report.markdown()
    assert [picture.name for picture in report.pictures] == ["map", "growth"]


# Bad input.


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("still = 60.0", "still = 61.0"), "still is 61; allowed: up to 60 s"),
        (("still = 60.0", "stil = 60.0"), "unknown scene 'stil'"),
        (("still = 60.0", "still = -1.0"), "still is -1.0; allowed: above 0"),
        (("upright = 20.0", "upright = 0.5"), "allowed: dt up to 0.025 s"),
        (("time_limit", 'lengths = ["nowhere"]\ntime_limit'), "unknown scene 'nowhere'"),
        (("time_limit", "finest = 0.0\ntime_limit"), "finest"),
        (("time_limit", "work = 10\ntime_limit"), "work"),
    ],
)
def test_bad_study_is_one_line(folder, change, says):
    path = folder / "bad.toml"
    path.write_text(STUDY.replace(*change))
    with pytest.raises(InputError) as error:
        load_plan(path)
    assert "\n" not in str(error.value)
    assert says in str(error.value)
    assert "bad.toml" in str(error.value)


# The baseline.


def test_worse_verdict_and_smaller_step_are_regressions_by_name(table):
    assert regressions(table, table) == []
    worse = table.copy()
    worse.loc[(worse.method == "rk4") & (worse.scene == "still"), "stable_dt"] *= 0.79
    worse.loc[(worse.method == "adaptive") & (worse.scene == "upright"), "verdict"] = "drifts"
    first, second = sorted(regressions(worse, table), key=lambda line: "stable_dt" in line)
    assert first.startswith("upright analytic adaptive: verdict was 'holds', is 'drifts'")
    assert second.startswith("still analytic rk4: stable_dt was")


def test_step_smaller_by_less_than_a_fifth_is_none(table):
    less = table.copy()
    less["stable_dt"] *= 0.81
    assert regressions(less, table) == []


def test_step_that_is_gone_is_a_regression(table):
    gone = table.copy()
    gone.loc[gone.method == "euler", "stable_dt"] = math.nan
    assert any("stable_dt" in line for line in regressions(gone, table))


# The pictures.


def step_row(verdict, number=0, **changes):
    scene = dataclasses.replace(load_scene("single"), name=f"scene {number}")
    dt = 0.1 if verdict == "holds" else math.nan
    row = StepRow(Case(scene, "analytic", "rk4", 0.1), False, False, verdict, "", dt, dt, False, False, 1.0)
    return dataclasses.replace(row, **changes)


def test_map_has_a_colour_and_a_word_for_every_verdict():
    figure = map_figure([step_row(verdict, number) for number, verdict in enumerate(VERDICTS)])
    [axes] = figure.axes
    words = ["0.1" if word == "holds" else word for word in VERDICTS]
    words = ["not known" if word in ("timed out", "out of memory") else word for word in words]
    assert [text.get_text() for text in axes.texts] == words
    assert len(axes.patches) == len(VERDICTS)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(VERDICTS)


@pytest.mark.parametrize(
    ("row", "text"),
    [
        (step_row("holds", bound=True), "≥ 0.1"),
        (step_row("holds", stable_dt=math.nan), "its own"),
        (step_row("drifts"), "drifts"),
        (step_row("drifts", unsettled=True), "drifts ?"),
        (step_row("timed out", unsettled=True), "not known"),
    ],
)
def test_cell(row, text):
    assert cell_text(row) == text


def test_a_scene_s_best_step_is_bold_and_others_say_by_how_much_they_are_smaller():
    best, half = step_row("holds", stable_dt_ratio=1.0), step_row("holds", stable_dt_ratio=0.25)
    assert page._step(best) == "**0.1**"
    assert page._step(half) == "0.1 (4\u00d7)"
    assert page._step(step_row("holds", stable_dt_ratio=math.nan)) == "0.1"
    assert page._step(dataclasses.replace(best, substeps=True)) == "0.1"  # whose steps are not those that it takes


def case_row(engine, dt, verdict="holds", scene="double", **ran):
    run = StabilityRun("ok", judged=verdict, **ran)
    return CaseRow(Case(load_scene(scene), engine, "rk4", dt), run, 10.0, 0.1)


def test_a_chain_that_stood_to_the_end_has_a_lower_bound():
    assert page._stay(case_row("mujoco", 0.1, stays_s=10.0)) == "≥ 10 s"
    assert page._stay(case_row("mujoco", 0.1, stays_s=6.0)) == "6 s"


def test_what_moves_is_at_a_game_s_step_where_engines_fare_most_differently():
    alike = [case_row(name, dt, scene="triple") for name in ("mujoco", "analytic", "pymunk") for dt in (0.05, 0.004)]
    apart = [case_row("mujoco", dt) for dt in (0.05, 0.005, 0.0005)] + [case_row("analytic", 0.004, "breaks")]
    shown = page.moving(None, {"cases": [*alike, *apart]})
    assert [(case.scene.name, case.engine, case.dt) for case in shown] == [
        ("double", "mujoco", 0.005), ("double", "analytic", 0.004)
    ]  # fmt: skip


def test_growth_has_the_engine_s_colour_and_hollow_marks_for_bounds():
    rows = [step_row("holds", number, bound=number == 1) for number in range(2)]
    figure = growth_figure(Styles.of_cases(row.case for row in rows), rows)
    line, bound = figure.axes[0].lines
    assert line.get_color() == bound.get_color() == Styles.of_cases([rows[0].case]).colour(rows[0].case)
    assert len(engine_hue("analytic")) == 7
    assert (len(line.get_xdata()), len(bound.get_xdata()), bound.get_markerfacecolor()) == (2, 1, "white")


def test_empty_study_has_a_page(folder):
    options = load_plan(folder / "small.toml").options
    report = Report(Results("n", "T", "stability", Found((), {}, {}), options))
    assert report.pictures == []
    assert "## The answer" in report.markdown()
    assert report.answer == "No case of this study was run."
