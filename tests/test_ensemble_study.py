"""The kind of study `ensemble`: its definitions, its jobs, its report, and that it goes on where it was stopped."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import pendbench as pb
from pendbench.bundled import bundled
from pendbench.engines.protocol import Fault
from pendbench.ensemble import first_flips
from pendbench.errors import InputError
from pendbench.physics.energy import energy
from pendbench.report.ensemble import answer, markdown_page, pictures
from pendbench.report.ensemble_plots import differences_figure
from pendbench.scene import load_scene
from pendbench.study.api import run_study
from pendbench.study.exponents import energy_shares, largest_exponents, regular_below, starts_between
from pendbench.study.flip_work import measure_engine_flips
from pendbench.study.flips import (
    agreement,
    coarse_pixels,
    difference,
    edge_of,
    first_flip,
    grid_angles,
    mirrored,
    pixel_angles,
)
from pendbench.study.jobs import Outcome
from pendbench.study.lyapunov import lyapunov_exponent
from pendbench.study.plan import load_plan
from scenes import chain
from tiny_study import Idle, Inline, Log, run

DOUBLE = load_scene("double")
INF, NAN = math.inf, math.nan


# The definitions, with known answers.


def test_difference():
    one = np.array([1.0, 1.0, INF, INF, 1.0, NAN, INF])
    other = np.array([1.0, 1.5, INF, 2.0, INF, 1.0, NAN])
    np.testing.assert_array_equal(difference(one, other), [0.0, 0.5, 0.0, INF, INF, NAN, NAN])


def test_edge_is_a_pixel_and_its_eight_neighbours():
    flips = np.full((6, 7), 2.0)
    flips[2, 3] = 2.2
    expected = np.zeros((6, 7), bool)
    expected[1:4, 2:5] = True
    np.testing.assert_array_equal(edge_of(flips, 0.1), expected)
    assert not edge_of(flips, 0.3).any()


def test_edge_where_one_flips_and_its_neighbour_does_not():
    flips = np.array([[INF, INF, INF, 9.0], [INF, INF, INF, INF]])
    np.testing.assert_array_equal(edge_of(flips, 100.0), [[False, False, True, True]] * 2)


def test_edge_does_not_go_round_the_border():
    flips = np.tile([1.0, 2.0, 3.0, 4.0], (4, 1))
    assert not edge_of(flips, 1.5).any()
    assert edge_of(flips, 0.5).all()


def test_what_is_not_known_makes_no_edge():
    flips = np.full((3, 3), 1.0)
    flips[1, 1] = NAN
    assert not edge_of(flips, 0.1).any()


def test_agreement_counts():
    expected = np.array([1.0, 1.0, 1.0, INF, 2.0, NAN, 3.0])
    flips = np.array([1.0, 1.3, 1.05, 4.0, INF, 1.0, NAN])
    edge = np.array([True, True, False, True, False, True, False])
    found = agreement(flips, expected, edge, 0.1)
    assert found == (5, 2, 3, 3, 1, INF)
    assert agreement(flips[:4], expected[:4], edge[:4], 0.1).largest_away == pytest.approx(0.05)
    assert math.isnan(agreement(flips[:2], expected[:2], edge[:2], 0.1).largest_away)


@pytest.mark.parametrize("count", [1, 2, 7, 1000])
def test_grid_has_its_mirror_image(count):
    grid = grid_angles(count)
    np.testing.assert_array_equal(grid, -grid[::-1])
    np.testing.assert_allclose(np.diff(grid), 2 * math.pi / count)
    assert len(grid) == count
    assert grid[-1] == pytest.approx(math.pi - math.pi / count)


def test_pixels_are_numbered_row_by_row():
    grid = grid_angles(5)
    np.testing.assert_array_equal(pixel_angles(5, np.array([0, 7])), [[grid[0], grid[0]], [grid[1], grid[2]]])


def test_coarse_pixels_are_spread_evenly():
    np.testing.assert_array_equal(coarse_pixels(4, 4), np.arange(16))
    np.testing.assert_array_equal(coarse_pixels(10, 2), [22, 27, 72, 77])
    rows = np.unique(coarse_pixels(1000, 40) // 1000)
    np.testing.assert_array_equal(np.diff(rows), 25)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_first_flip_is_that_of_the_cubic(side):
    """The angle 3 + (t - 1)^3 is a cubic itself: when it is pi is known."""
    t = np.linspace(0.0, 3.0, 7)
    theta = np.stack([0.0 * t, side * (3.0 + (t - 1.0) ** 3)], axis=1)
    omega = np.stack([0.0 * t, side * 3.0 * (t - 1.0) ** 2], axis=1)
    assert first_flip(t, theta, omega) == pytest.approx(1.0 + (math.pi - 3.0) ** (1 / 3), abs=1e-9)
    assert first_flip(t[:4], theta[:4], omega[:4]) == INF
    assert first_flip(t[:0], theta[:0], omega[:0]) == INF


def test_earlier_of_two_rods_is_the_first():
    t = np.array([0.0, 1.0])
    theta, omega = np.array([[3.0, 3.1], [4.0, 4.1]]), np.ones((2, 2))
    assert first_flip(t, theta, omega) == pytest.approx(math.pi - 3.1)


# The map.


def test_mirrored_chains_flip_together():
    angles = np.random.default_rng(2).uniform(-math.pi, math.pi, (300, 2))
    flips, others = first_flips(DOUBLE, angles), first_flips(DOUBLE, -angles)
    assert np.isfinite(flips).sum() > 100
    assert np.isinf(flips).sum() > 50
    np.testing.assert_array_equal(flips, others)


# Exponents.


def test_energy_shares_run_from_hanging_to_upright():
    angles = np.array([[0.0, 0.0], [math.pi, math.pi], [math.pi / 2, math.pi / 2], [0.0, math.pi]])
    np.testing.assert_allclose(energy_shares(DOUBLE, angles), [0.0, 1.0, 0.5, 1 / 3], atol=1e-15)


def test_starts_have_the_energies_asked_for():
    angles = starts_between(DOUBLE, 0.9, 1.0, 50, 4)
    assert angles.shape == (50, 2)
    low, high = (energy(DOUBLE, np.full((1, 2), angle), np.zeros((1, 2)))[0] for angle in (0.0, math.pi))
    shares = (energy(DOUBLE, angles, np.zeros_like(angles)) - low) / (high - low)
    assert ((shares >= 0.9) & (shares < 1.0)).all()
    np.testing.assert_array_equal(angles, starts_between(DOUBLE, 0.9, 1.0, 50, 4))


def test_exponents_are_those_of_one_scene_at_a_time():
    """Both are means over the same time of motions that part: they agree to a few of their standard errors."""
    angles = np.array([[2.0, 2.0], [0.2, 0.1]])
    chaotic, regular = largest_exponents(DOUBLE, angles, 100.0)
    one = lyapunov_exponent(DOUBLE.with_start(angles[0], np.zeros(2)), 100.0)
    assert abs(chaotic - one.rate) < 5 * one.error
    assert regular < regular_below(DOUBLE, 100.0) < 0.2 < chaotic


def test_exponent_of_one_pendulum_falls_with_time():
    """Regular neighbours part linearly: the exponent over T is of the order of ln(T) / T."""
    single = chain(1, angle=0.0, length=1.0, duration=10.0)
    short, long = (largest_exponents(single, np.array([[1.5]]), seconds)[0] for seconds in (50.0, 500.0))
    assert 0.0 < long < 0.3 * short < 0.3 * regular_below(single, 50.0)


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
    for heading in ("The map", "What counts as a difference", "How exact the map is", "Other methods and engines"):
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
    pd.testing.assert_frame_equal(again.results.cases, table)


def test_lost_arrays_are_found_again(folder, table, tmp_path):
    first = run(folder / "small.toml", tmp_path, Inline)
    lost, *_ = sorted((tmp_path / "work").glob("*.npz"))
    lost.unlink()
    log = Log()
    again = run(folder / "small.toml", tmp_path, Inline, log=log)
    assert sum(total - done for total, done in log.stages.values()) == 1
    clocked = ["run_s", "chain_us"]
    pd.testing.assert_frame_equal(again.results.cases.drop(columns=clocked), first.results.cases.drop(columns=clocked))
    pd.testing.assert_frame_equal(first.results.cases.drop(columns=clocked), table.drop(columns=clocked))


class Failing(Inline):
    """Finishes nothing but the engines' own runs."""

    def run(self, jobs, *, alone=False):
        own = [job for job in jobs if job.function is measure_engine_flips]
        yield from super().run(own, alone=alone)
        yield from (Outcome(job, fault=Fault("timed out", "too slow")) for job in jobs if job not in own)


def test_what_did_not_finish_is_a_row_with_its_reason(folder, tmp_path):
    found = run(folder / "small.toml", tmp_path, Failing, report=True).results
    ours = found.cases[found.cases.method == "adaptive"]
    assert set(ours.status) == {"timed out"}
    assert set(ours.reason) == {"too slow"}
    others = found.cases[found.cases.method != "adaptive"]
    assert set(others.status) == {"ok"}  # they ran, and have nothing to be compared with
    assert (others.pixels == 0).all()
    assert set(found.tables["energies"].status) == {"timed out"}
    page = (tmp_path / "report.md").read_text()
    assert "3 cases of 6 did not end well" in page
    assert "There is no whole map (too slow)." in page


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


# The report.


def test_empty_study_has_a_page():
    results = SimpleNamespace(
        title="T", name="n", kind="ensemble", quick=False, provenance={}, options={}, cases=pd.DataFrame(), tables={}
    )
    assert list(pictures(results)) == []
    assert "## The answer" in markdown_page(results, [])
    assert answer(results) == ""


def test_picture_tells_the_differences_apart():
    rows = [
        {"engine": "e", "method": "m", "theta1_rad": 0.0, "theta2_rad": 0.0, "flip_s": flip, "expected_flip_s": 1.0,
         "is_at_edge": edge, "is_changed": changed}
        for flip, edge, changed in ((1.0, False, False), (2.0, True, True), (2.0, False, True), (NAN, False, False))
    ]  # fmt: skip
    figure = differences_figure(np.ones((4, 4)), 10.0, np.zeros((4, 4), bool), [rows])
    assert len(figure.legends[0].get_texts()) == 4
    alone = differences_figure(np.ones((4, 4)), 10.0, np.zeros((4, 4), bool), [rows[:1]])
    assert [text.get_text() for text in alone.legends[0].get_texts()] == ["the same time"]


def test_bundled_study_plans():
    for quick in (False, True):
        plan = load_plan("ensemble", quick=quick)
        assert pb.load_scene("double").digest == plan.scenes[0].digest
        assert {case.engine for case in plan.cases} >= {"analytic", "mujoco", "pymunk"}
