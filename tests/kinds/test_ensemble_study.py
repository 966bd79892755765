"""The kind of study `ensemble`: its definitions, its jobs, its report, and that it goes on where it was stopped."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import pendbench as pb
from pendbench.base.bundled import bundled
from pendbench.base.errors import InputError
from pendbench.base.faults import Fault
from pendbench.commands.run import run_study
from pendbench.engines.analytic.ensemble import first_flips
from pendbench.execution.pool import Outcome
from pendbench.kinds.ensemble import work
from pendbench.kinds.ensemble.columns import PixelRow, _map_columns
from pendbench.kinds.ensemble.page import facts
from pendbench.kinds.ensemble.plots import differences_figure
from pendbench.kinds.ensemble.study import Compared, Energies, Found
from pendbench.kinds.ensemble.work import ExponentRun, FlipRun, measure_engine_flips
from pendbench.measures.energy import Balance
from pendbench.measures.flips import grid_angles, mirrored, pixel_angles
from pendbench.report.columns import Table
from pendbench.report.page import Report
from pendbench.report.sections import definitions
from pendbench.report.tables import data_frame
from pendbench.scene.scene import load_scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study.ask import ask_refusals
from pendbench.study.case import Case
from pendbench.study.plan import load_plan
from pendbench.study.results import Results
from support.reading import section, tables_of
from support.tiny_study import Idle, Inline, Log, run

DOUBLE = load_scene("double")
INF, NAN = math.inf, math.nan


# The map.


def test_mirrored_chains_flip_together():
    angles = np.random.default_rng(2).uniform(-math.pi, math.pi, (300, 2))
    flips, others = first_flips(DOUBLE, angles), first_flips(DOUBLE, -angles)
    assert np.isfinite(flips).sum() > 100
    assert np.isinf(flips).sum() > 50
    np.testing.assert_array_equal(flips, others)


# The study.

STUDY = """
title = "Small"
kind = "ensemble"
scenes = ["short.toml"]
grid = 60
tolerance = 1e-7
sample = 100
coarse = 8
changed = 0.1
time_limit = 100.0
exponents = { bins = 2, starts = 4, seconds = 20.0 }
[[engines]]
name = "analytic"
methods = ["adaptive"]
tolerance = [1e-4, 1e-7, 1e-12]
[[engines]]
name = "analytic"
methods = ["rk4", "euler"]
dt = [1e-2]
[[engines]]
name = "mujoco"
methods = ["rk4"]
dt = [1e-2]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("ensemble")
    text = (bundled("models") / "double.toml").read_text()
    (path / "short.toml").write_text(text.replace("duration = 10.0", "duration = 3.0"))
    (path / "small.toml").write_text(STUDY)
    return path


@pytest.fixture(scope="module")
def table(folder):
    return run_study(folder / "small.toml", folder / "out", jobs=1)


def read(folder, name):
    return pd.read_csv(folder / "out" / f"{name}.csv")


def test_every_case_is_a_row(table):
    assert list(zip(table.engine, table.method, strict=True)) == [
        *[("analytic", "adaptive")] * 3, ("analytic", "rk4"), ("analytic", "euler"), ("mujoco", "rk4"),
    ]  # fmt: skip
    assert set(table.status) == {"ok"}
    assert list(table.chains) == [100, 3600, 164, 64, 64, 64]
    assert (table.run_s > 0).all()


def test_map_is_that_of_first_flips(folder, table):
    del table
    found = read(folder, "map")
    np.testing.assert_array_equal(found["theta1_rad"], grid_angles(60))
    flips = found.drop(columns="theta1_rad").to_numpy()
    scene = load_scene(str(folder / "short.toml"))
    expected = first_flips(scene, pixel_angles(60, np.arange(3600)), tolerance=1e-7).reshape(60, 60)
    np.testing.assert_array_equal(flips, np.round(expected, 6))
    np.testing.assert_array_equal(flips, mirrored(flips))
    assert np.isinf(flips).any()


def test_no_chain_without_the_energy_flips(folder, table):
    del table
    [own] = read(folder, "maps").to_dict("records")
    assert own["barred_flips"] == 0
    assert 0.25 < own["barred_share"] < 0.35  # the area where 2 cos a + cos b > 1
    assert own["mirror_largest_s"] == 0.0


def test_accurate_methods_differ_at_the_edge_alone(table):
    """Over three seconds, errors of a thousandth and less move a flip by 0.3 s only where neighbours differ, too."""
    accurate = table[(table.method != "euler") & (table.tolerance != 1e-12)]
    assert (accurate.changed_away == 0).all()
    assert (accurate.largest_away_s < 0.3).all()
    assert (table.pixels_at_edge > 10).all()
    assert (accurate.changed_from_map == 0).all()
    assert (accurate.largest_away_s > 0.0).all()  # some of the others flip, too


def test_inexact_method_is_found_out(table):
    """Semi-implicit Euler of order 1 at 10 ms moves flips by more than RK4 does, by orders of magnitude."""
    by_method = table[(table.engine == "analytic") & (table.tolerance.isna())].set_index("method")
    assert by_method.loc["euler", "largest_away_s"] > 100 * by_method.loc["rk4", "largest_away_s"]


def test_two_engines_with_one_method_flip_together(folder, table):
    """MuJoCo's RK4 is ours but for rounding, which three seconds of chaos do not make visible."""
    del table
    pixels = read(folder, "pixels")
    ours, theirs = (
        pixels[(pixels.engine == name) & (pixels.method == "rk4")].flip_s.to_numpy() for name in ("analytic", "mujoco")
    )
    np.testing.assert_allclose(ours, theirs, atol=1e-6)
    assert np.isfinite(ours).sum() > 5


def test_report_says_what_was_found(folder, table):
    del table
    page = (folder / "out/report.md").read_text()
    assert "3,600 double pendulums over 3 s at a tolerance of 1.0e-7" in page
    assert "more than 0.3 s apart" in page
    for heading in ("The answer", "The map", "How exact the map is", "Other methods and engines", "Every case"):
        assert f"## {heading}" in page
    for name in ("map", "differences", "exponents"):
        assert f"![{name}](plots/{name}.png)" in page
        assert (folder / f"out/plots/{name}.png").stat().st_size > 1000


def test_quartiles_are_those_of_the_starts(folder, table):
    del table
    energies, starts = read(folder, "energies"), read(folder, "exponents")
    assert list(energies.chains) == [4, 4]
    upper = starts[starts.energy_from == 0.5]
    assert ((upper.energy_share >= 0.5) & (upper.energy_share < 1.0)).all()
    assert energies.exponent_median_per_s[1] == pytest.approx(upper.lyapunov_per_s.median())
    assert energies.regular_share[1] == pytest.approx(upper.is_regular.mean())


# Going on.


def test_finished_study_is_not_run_again(folder, table):
    again = run(folder / "small.toml", folder / "out", Idle)
    pd.testing.assert_frame_equal(data_frame(again.report.cases), pd.DataFrame(table))


def test_what_is_lost_is_run_again(folder, table, tmp_path):
    shutil.copytree(folder / "out", tmp_path / "out")
    lost, *_ = sorted((tmp_path / "out" / "work").glob("*.json"))
    lost.unlink()
    log = Log()
    again = run(folder / "small.toml", tmp_path / "out", Inline, log=log)
    assert sum(total - done for total, done in log.stages.values()) == 1
    clocked = ["run_s", "chain_us"]
    pd.testing.assert_frame_equal(data_frame(again.report.cases).drop(columns=clocked), table.drop(columns=clocked))


class Failing(Inline):
    """Finishes nothing but the engines' own runs."""

    def run(self, jobs, *, alone=False):
        able = (measure_engine_flips, ask_refusals)
        own = [job for job in jobs if job.arguments[0] in able]
        yield from super().run(own, alone=alone)
        yield from (Outcome(job, fault=Fault("timed out", "too slow")) for job in jobs if job not in own)


def test_study_without_a_map_reports_what_there_is(folder, tmp_path):
    found = run(folder / "small.toml", tmp_path, Failing, report=True).report
    cases = data_frame(found.cases)
    assert set(cases[cases.method == "adaptive"].status) == {"timed out"}
    others = cases[cases.method != "adaptive"]
    assert set(others.status) == {"ok"}  # they ran, and have nothing to be compared with
    assert (others.pixels == 0).all()
    assert set(data_frame(found.tables["energies"]).status) == {"timed out"}
    page = (tmp_path / "report.md").read_text()
    assert "3 cases of 6 did not end well" in page
    assert found.answer == "There is no whole map: too slow."


# Bad input.


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('["short.toml"]', '["short.toml", "triple"]'), "scenes has 2 names; allowed: one"),
        (('["short.toml"]', '["triple"]'), "scenes has 'triple'; allowed: a double pendulum at rest"),
        (('["short.toml"]', '["fast_spin_free"]'), "allowed: a double pendulum at rest"),
        (("sample = 100", "sample = 3601"), "sample is 3601; allowed: up to 3600"),
        (("coarse = 8", "coarse = 61"), "coarse is 61; allowed: up to grid = 60"),
        (("tolerance = 1e-7", "tolerance = 1e-6"), "tolerance is 1e-06; allowed: one of those"),
        (("1e-7, 1e-12]", "1e-7, 5e-8]"), "ten times finer"),
        (("bins = 2", "bin = 2"), "did you mean 'bins'"),
    ],
)
def test_bad_study_is_one_line(folder, change, says):
    path = folder / "bad.toml"
    assert change[0] in STUDY
    path.write_text(STUDY.replace(*change, 1))
    with pytest.raises(InputError) as error:
        load_plan(path)
    assert "\n" not in str(error.value)
    assert says in str(error.value)
    assert "bad.toml" in str(error.value)


def test_map_needs_our_engine(folder):
    with pytest.raises(InputError, match="the analytic engine's method 'adaptive'"):
        load_plan(folder / "small.toml", engines=["mujoco"])


# The tables and the page, of a map made by hand.

#: Barred are eight pixels: those where 2 cos a + cos b > 1, the first angle +-30 degrees and the second +-30 or +-90.
MAP = np.full((6, 6), 2.0)
MAP[2:4, 1:5] = INF
MAP[2, 0] = MAP[3, 5] = INF  # two more that do not flip in time
MAP[5, 5] = 2.05  # its mirror image flips at 2.0
#: All of the four rows in the middle is edge, and nothing else.
EDGE, AWAY = 6, 0  # pixels: (1, 0) and (0, 0)
ALL = np.arange(36)


def changed(flips, **pixels):
    """Flip times (k,) with those of some pixels replaced."""
    flips = flips.copy()
    flips[[int(name[1:]) for name in pixels]] = list(pixels.values())
    return flips


def ours(tolerance):
    return Case(DOUBLE, "analytic", "adaptive", None, (("tolerance", tolerance),))


TRUTH = changed(MAP.ravel(), p6=2.5)
SOME = np.array([0, 6, 14, 35])
RK4, COARSE = Case(DOUBLE, "mujoco", "rk4", 1e-3), Case(DOUBLE, "mujoco", "rk4", 5e-3)
EULER = Case(DOUBLE, "pymunk", "tuned", 1e-3)
REFUSED = Case(DOUBLE, "mujoco", "euler", 1e-3)


def compared(case, flips, pixels=ALL, run_s=1e-3, drift=NAN, status="ok", reason=""):
    return Compared(case, FlipRun(status, reason, flips, run_s, drift), pixels, flips, TRUTH[pixels])


def made(*cases, flips=MAP, energies=()):
    """A report on a map at 1e-6, with 1e-12 for truth."""
    own = [
        compared(ours(1e-4), changed(TRUTH, p0=2.3)),
        compared(ours(1e-6), flips.ravel(), run_s=7.2e-3),
        compared(ours(1e-12), TRUTH),
    ]
    options = SimpleNamespace(
        tolerance=1e-6, changed=0.01, grid=6, exponents=SimpleNamespace(seconds=100.0, bins=2, starts=5)
    )
    found = Found(DOUBLE, flips, ours(1e-12), (*own, *cases), tuple(energies))
    return Report(Results("made", "Made up", "ensemble", found, options))


OTHERS = (
    compared(COARSE, changed(TRUTH[SOME], p0=2.11, p3=3.0), SOME, 8e-3, 2e-3),
    compared(RK4, TRUTH[SOME], SOME, 40e-3, 1e-5),
    compared(EULER, changed(TRUTH[SOME], p1=2.3, p2=3.0), SOME, 1e-3, 1e-2),
    compared(REFUSED, np.full(4, NAN), SOME, NAN, status="refused", reason="it cannot"),
)


def test_a_case_is_told_by_its_pixels():
    cases = {row.case: row for row in made(*OTHERS).cases}
    assert cases[COARSE].agrees == (4, 0, 2, 2, 2, pytest.approx(0.95))
    assert cases[COARSE].with_map.changed == 3  # the map has another time than the truth at one more of them
    assert cases[RK4].agrees == (4, 0, 2, 0, 0, 0.0)
    assert cases[EULER].agrees == (4, 0, 2, 2, 0, 0.0)  # a flip where there is none is at the edge, too
    assert cases[ours(1e-6)].agrees[:5] == (36, 0, 24, 1, 0)
    assert cases[ours(1e-4)].agrees[:5] == (36, 0, 24, 1, 1)


def test_an_engine_s_chains_take_all_their_time_and_have_the_worst_energy(monkeypatch):
    """Three of them: one flips at 2 s, one never does, and one fails before it does."""
    t, still = np.array([0.0, 1.0]), np.zeros((2, 2))
    runs = iter(
        [Trajectory(t, still, still, t, status, why) for status, why in (("ok", ""), ("ok", ""), ("torn", "it tore"))]
    )
    seconds, found_flips = iter([1.0, 2.0, 4.0]), iter([2.0, INF, INF])
    balances = iter([Balance(t, np.array([0.0, kept]), 2.0, np.array([0.0, floor]), works=True)
                     for kept, floor in ((0.2, 1e-3), (-0.8, 3e-3), (0.4, 2e-3))])  # fmt: skip
    monkeypatch.setattr(work, "run_case", lambda *_: next(runs))
    monkeypatch.setattr(work, "timed", lambda call: (call(), next(seconds)))
    monkeypatch.setattr(work, "first_flip", lambda *_: next(found_flips))
    monkeypatch.setattr(work, "energy_balance", lambda *_: next(balances))
    found = measure_engine_flips(RK4, np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]))
    np.testing.assert_array_equal(found.flips, [2.0, INF, NAN])
    assert (found.run_s, found.energy_drift_max, found.energy_floor) == (7.0, 0.4, 3e-3)
    assert (found.status, found.reason) == ("torn", "released from 0.5, 0.6 rad: it tore")


def test_columns_of_a_case():
    table = data_frame(made(*OTHERS).cases)
    [row] = table[(table.method == "rk4") & (table.dt == 5e-3)].itertuples()
    assert (row.chains, row.pixels, row.changed, row.changed_away, row.changed_from_map) == (4, 4, 2, 2, 3)
    assert (row.chain_us, row.run_s, row.energy_drift_max) == (pytest.approx(2000.0), 8e-3, 2e-3)
    [truth] = table[table.tolerance == 1e-12].itertuples()
    assert np.isnan([truth.changed, truth.changed_away, truth.largest_away_s]).all()
    assert truth.changed_from_map == 1
    assert set(table[table.method == "euler"].status) == {"refused"}


def test_chains_that_are_lost_make_a_case_fail():
    report = made(compared(RK4, changed(TRUTH[SOME], p0=NAN), SOME))
    row = report.cases.rows[-1]
    assert (row.status, row.reason) == ("work limit", "1 of 4 chains could not be followed")
    assert (row.agrees.pixels, row.agrees.failed) == (3, 1)
    whole = made(flips=changed(MAP.ravel(), p20=NAN).reshape(6, 6))
    assert whole.answer.startswith("There is no whole map: 1 of 36 chains could not be followed.")


def test_the_map_in_numbers():
    [own] = made().tables["maps"]
    assert (own.pixels, own.pixels_failed, own.pixels_at_edge) == (36, 0, 24)
    assert own.never_share == pytest.approx(10 / 36)
    assert own.barred_share == pytest.approx(8 / 36)
    assert own.barred_flips == 0
    assert own.mirror_largest_s == pytest.approx(0.05)
    [wrong] = made(flips=changed(MAP.ravel(), p14=1.0, p20=NAN).reshape(6, 6)).tables["maps"]
    assert (wrong.pixels, wrong.pixels_failed, wrong.barred_flips) == (35, 1, 1)
    assert wrong.mirror_largest_s == INF  # its mirror image does not flip


def test_the_map_as_a_table_has_a_column_for_each_second_angle():
    table = data_frame(made().tables["map"])
    assert list(table) == ["theta1_rad", *map(str, range(6))]
    np.testing.assert_array_equal(table["theta1_rad"], grid_angles(6))
    np.testing.assert_array_equal(table.drop(columns="theta1_rad"), MAP)


def test_many_columns_that_mean_the_same_are_named_by_their_ends():
    report = made()
    told = definitions([report.cases, report.tables["map"]])
    assert "`0`, `1`, `2`, `3`, `4`, `5`" in told
    assert "`0` to `29`" in definitions([Table("map", tuple(_map_columns(30)), [])])


def test_quartiles_leave_out_what_is_not_known():
    """Regular is below 3 ln(T) / 100 s, T of 100 s in units of sqrt(L / g): 0.16 / s."""
    rates = np.array([0.4, 0.1, NAN, 0.3, 0.2])
    run = ExponentRun("ok", "", np.zeros((5, 2)), np.full(5, 0.6), rates)
    report = made(energies=[Energies(0.0, 0.5, ExponentRun("timed out", "too slow")), Energies(0.5, 1.0, run)])
    none, some = report.tables["energies"]
    assert list(data_frame(report.tables["energies"]).status) == ["timed out", "ok"]
    assert none.chains == 0
    assert "- from 0 to 0.5: timed out, too slow" in report.markdown()
    assert np.isnan(none.quartiles).all()
    assert (some.chains, some.regular_share) == (4, 0.25)
    np.testing.assert_allclose(some.quartiles, [0.175, 0.25, 0.325])
    assert [row.is_regular for row in report.tables["exponents"]] == [False, True, False, False, False]


def test_the_answer_is_read_off_the_tables():
    report = made(*OTHERS)
    assert report.answer == (
        "36 double pendulums over 10 s at a tolerance of 1.0e-6 take 7.2 ms of processor time, 200 µs each. Run again "
        "at 1.0e-12, 1 of 36 pixels gets another time, none of them away from the map's edge. Of what runs one chain "
        "after the other, mujoco rk4, step 0.001 s, comes closest: none of 4 pixels gets another time."
    )
    page = report.markdown()
    [exact] = tables_of(section(page, "How exact the map is"))
    row = next(row for row in exact if row["tolerance"] == "1.0e-6")
    assert (row["chains"], row["chain, µs"]) == ("36", "200")
    assert (row["pixels"], row["different"], row["away from the edge"]) == ("36", "1", "0")
    [others] = tables_of(section(page, "Other methods and engines"))
    row = next(
        row for row in others if (row["engine"], row["step, s"]) == ("mujoco", "0.001") and row["method"] == "rk4"
    )
    assert (row["pixels"], row["different"]) == ("4", "0")
    assert "0.0072" in {row["run, s"] for row in tables_of(section(page, "Every case"))[0]}


def test_flip_times_may_differ_by_a_share_of_the_duration():
    report = made()
    assert facts(report.results, report.tables).allowed == pytest.approx(0.01 * 10.0)


def test_the_answer_says_what_is_wrong_away_from_the_edge():
    assert "2 of 4 pixels get another time, 2 of them away from the map's edge" in made(OTHERS[0]).answer
    assert "comes closest" not in made(OTHERS[3]).answer


def test_the_best_of_each_engine():
    """The method with the fewest differences, at the coarsest step with no more of them away from the edge."""
    finer = (compared(ours(1e-8), TRUTH), compared(replace(RK4, dt=5e-4), TRUTH[SOME], SOME))
    best, *_ = tables_of(made(*OTHERS, *finer).markdown())
    assert [(row["engine"], row["method"], row["step, s"], row["tolerance"]) for row in best] == [
        ("analytic", "adaptive", "its own", "1.0e-6"),
        ("mujoco", "rk4", "0.001", "\u2013"),
        ("pymunk", "tuned", "0.001", "\u2013"),
    ]


def test_loosest_tolerance_is_one_below_which_none_is_worse():
    text = "leaves every pixel away from the edge as it is: "
    assert f"{text}1.0e-6." in made().markdown()
    assert f"{text}1.0e-6." in made(compared(ours(1e-8), TRUTH)).markdown()  # a finer one is no looser
    worse = compared(ours(1e-8), changed(TRUTH, p0=2.3))
    assert f"{text}1.0e-6." not in made(worse).markdown()
    assert "None of them leaves every pixel away from the edge as it is." in made(worse).markdown()


def test_picture_tells_the_differences_apart():
    rows = [
        PixelRow(RK4, 0.0, 0.0, flip, 1.0, edge, changed)
        for flip, edge, changed in ((1.0, False, False), (2.0, True, True), (2.0, False, True), (NAN, False, False))
    ]
    figure = differences_figure(np.ones((4, 4)), 10.0, np.zeros((4, 4), bool), [rows])
    assert len(figure.legends[0].get_texts()) == 4
    alone = differences_figure(np.ones((4, 4)), 10.0, np.zeros((4, 4), bool), [rows[:1]])
    assert [text.get_text() for text in alone.legends[0].get_texts()] == ["the same time"]


def test_bundled_study_plans():
    for quick in (False, True):
        plan = load_plan("ensemble", quick=quick)
        assert pb.load_scene("double").digest == plan.scenes[0].digest
        assert {case.engine for case in plan.cases} >= {"analytic", "mujoco", "pymunk"}
