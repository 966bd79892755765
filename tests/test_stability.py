"""The kind of study `stability`: its verdicts, its search for the largest stable step, its report, its baseline."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pendbench.errors import InputError
from pendbench.report.stability import markdown_page, pictures
from pendbench.report.stability_answer import answer
from pendbench.report.stability_map import cell_text, map_figure
from pendbench.study import stability
from pendbench.study.api import run_study
from pendbench.study.baseline import regressions
from pendbench.study.measure import growth_exponent
from pendbench.study.plan import load_plan
from pendbench.study.verdict import VERDICTS, verdict_of
from pendbench.trajectory import STATUSES

T = np.linspace(0.0, 1.0, 11)
NONE = np.zeros(11)


def strays(worst, at=5):
    values = NONE.copy()
    values[at] = worst
    return values


@pytest.mark.parametrize(
    ("status", "energy", "gap", "word"),
    [
        ("ok", strays(0.0099), NONE, "holds"),
        ("ok", strays(-0.011), NONE, "drifts"),
        ("ok", NONE, strays(0.011), "drifts"),
        ("ok", strays(-0.99), NONE, "drifts"),
        ("ok", strays(1.01), NONE, "breaks"),
        ("ok", strays(math.nan), NONE, "breaks"),
        ("ok", strays(math.inf), NONE, "breaks"),
        ("torn", strays(0.5), NONE, "breaks"),
        ("not finite", NONE, NONE, "breaks"),
        ("not converged", NONE, NONE, "gives up"),
        ("work limit", NONE, NONE, "gives up"),
        ("not converged", strays(2.0), NONE, "breaks"),
        ("reset", strays(2.0), NONE, "resets"),
        ("warned", strays(2.0), NONE, "breaks"),
        ("warned", strays(0.5), NONE, "warned"),
        ("ok", NONE, strays(math.nan), "breaks"),
        ("ok", NONE, strays(-5.0), "breaks"),
        ("ok", NONE, strays(-0.02), "drifts"),
        ("timed out", NONE[:0], NONE[:0], "timed out"),
    ],
)
def test_verdict(status, energy, gap, word):
    found = verdict_of(status, "why", T[: len(energy)], energy, gap)
    assert found.word == word
    assert (found.reason == "") == (word == "holds")


def test_when_the_energy_was_lost_is_told():
    found = verdict_of("ok", "", T, np.linspace(0.0, 2.0, 11), NONE)
    assert found.broke == pytest.approx(0.6)
    assert "t = 0.6 s" in found.reason
    assert math.isnan(verdict_of("ok", "", T, NONE, NONE).broke)


def test_every_status_has_a_verdict():
    words = {verdict_of(status, "why", T, NONE, NONE).word for status in STATUSES}
    assert words <= set(VERDICTS)


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
UPRIGHT = """
title = "Upright"
duration = 20.0
[chain]
masses = [1.0]
lengths = [1.0]
[start]
angles = [3.141592653589793]
[effects]
gravity = 9.81
"""
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
    assert "analytic adaptive holds all" in page
    assert "![map](plots/map.png)" in page
    for heading in ("The largest stable steps", "What breaks whom, and why", "How long what stands stays"):
        assert f"## {heading}" in page
    assert (folder / "out/plots/map.png").stat().st_size > 1000
    assert {"stable_steps.csv", "search.csv", "scenes.csv"} <= {path.name for path in (folder / "out").iterdir()}


# The search, with a program that answers at once.


class Oracle:
    """A runner whose cases hold up to a step, each for its method; it counts what it is asked."""

    def __init__(self, limits, otherwise="breaks", slow=0.0):
        self.limits, self.otherwise, self.slow, self.asked = limits, otherwise, slow, []

    def run(self, _stage, jobs, _on_fault):
        return {job.key: self._answer(job) for job in jobs}

    def _answer(self, job):
        if job.function is not stability.measure_stability:
            return {}
        case = job.arguments[0]
        self.asked.append((case.scene.name, case.method, case.dt))
        verdict = "holds" if case.dt is None or case.dt <= self.limits[case.method] else self.otherwise
        if case.dt is not None and case.dt < self.slow:
            verdict = "timed out"
        return {"status": "ok", "reason": "", "verdict": verdict}


def searched(folder, limits, **otherwise):
    oracle = Oracle(limits, **otherwise)
    results = stability.run(load_plan(folder / "small.toml"), oracle)
    return results, oracle


@pytest.mark.parametrize("limit", [0.21, 0.7, 0.0501, 0.011])
def test_search_finds_any_limit_to_a_tenth(folder, limit):
    results, _ = searched(folder, {"euler": limit, "rk4": limit})
    steps = results.tables["stable_steps"]
    found = steps[steps.method == "euler"].stable_dt
    assert ((limit / 1.1 <= found) & (found <= limit)).all()
    assert not steps.bound.any()


def test_no_limit_is_a_bound(folder):
    results, oracle = searched(folder, {"euler": 1e9, "rk4": 1e9})
    steps = results.tables["stable_steps"].set_index(["scene", "method"])
    assert steps.loc[("still", "euler"), "bound"]
    assert 60.0 / 40 < steps.loc[("still", "euler"), "stable_dt"] <= 60.0 / 20
    assert len(set(oracle.asked)) == len(oracle.asked)


def test_nothing_holds(folder):
    results, oracle = searched(folder, {"euler": 0.0, "rk4": 0.0})
    steps = results.tables["stable_steps"]
    assert set(steps[steps.method == "euler"].best_verdict) == {"breaks"}
    assert steps[steps.method == "euler"].stable_dt.isna().all()
    assert min(dt for _, method, dt in oracle.asked if method == "euler") >= 1e-5


def test_search_goes_on_as_near_as_it_can_to_a_step_that_took_too_long(folder):
    """Coarse steps drift, fine ones take too long: what holds lies between, where no step of the study is."""
    results, _ = searched(folder, {"euler": 0.12, "rk4": 1e9}, slow=0.06)
    steps = results.tables["stable_steps"]
    assert (steps[steps.method == "euler"].stable_dt > 0.1).all()
    results, _ = searched(folder, {"euler": 0.01, "rk4": 1e9}, slow=0.06)
    steps = results.tables["stable_steps"]
    assert steps[steps.method == "euler"].unsettled.all()
    assert not steps[steps.method == "rk4"].unsettled.any()


def test_step_that_takes_too_long_spares_the_finer_ones(folder):
    results, oracle = searched(folder, {"euler": 0.0, "rk4": 0.3}, otherwise="timed out")
    assert [dt for _, method, dt in oracle.asked if method == "euler"] == [1.0, 1.0]
    own = results.cases[(results.cases.method == "euler") & (results.cases.scene == "still")]
    assert list(own.verdict) == ["timed out"] * 3
    assert own.reason.iloc[2].startswith("a larger step already did")


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


# The report.


def made_up(verdicts):
    rows = [
        {"scene": f"scene {i}", "n": 2, "engine": "ours", "method": "m", "settings": "", "adaptive": False,
         "best_verdict": verdict, "reason": "", "stable_dt": 0.1 if verdict == "holds" else math.nan,
         "stable_dt_ratio": 1.0, "stable_dt_stiffest": 1.0, "bound": False, "unsettled": False, "substeps": False,
         "unbroken_dt": 0.1}
        for i, verdict in enumerate(verdicts)
    ]  # fmt: skip
    return SimpleNamespace(
        title="T", name="n", kind="stability", quick=False, provenance={}, options={}, cases=pd.DataFrame(rows),
        tables={"stable_steps": pd.DataFrame(rows)},
    )  # fmt: skip


def test_map_has_a_colour_and_a_word_for_every_verdict():
    rows = made_up(VERDICTS).tables["stable_steps"].to_dict("records")
    figure = map_figure(rows)
    [axes] = figure.axes
    assert {text.get_text() for text in axes.texts} == {"0.1", *VERDICTS} - {"holds"}
    assert len(axes.patches) == len(VERDICTS)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(VERDICTS)


def test_cell_of_what_time_did_not_settle_asks():
    [row] = made_up(["drifts"]).tables["stable_steps"].to_dict("records")
    assert cell_text({**row, "unsettled": True}) == "drifts ?"


def test_cell_of_a_bound_says_so():
    [row] = made_up(["holds"]).tables["stable_steps"].to_dict("records")
    assert cell_text({**row, "bound": True}) == "≥ 0.1"
    assert cell_text({**row, "stable_dt": math.nan}) == "its own"


def test_empty_study_has_a_page():
    results = made_up([])
    assert list(pictures(results)) == []
    assert "## The answer" in markdown_page(results, [])
    assert answer(results) == ""


def test_growth_exponent():
    n = np.array([5.0, 10.0, 50.0])
    assert growth_exponent(n, 3.0 * n**-1.25) == pytest.approx(-1.25)
    assert math.isnan(growth_exponent(n[:2], n[:2]))
