"""The plots of chaos, looked at as figures: what is drawn, where, and that it can be read."""

from __future__ import annotations

import colorsys
import itertools
import math
from functools import partial

import matplotlib.style
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from pendbench.kinds.chaos import page
from pendbench.kinds.chaos.plots import TIME, cost_figure, error_curves
from pendbench.kinds.chaos.rows import CurveRow
from pendbench.report.plots import Drawn, bounds, hue, shades
from pendbench.report.styles import Styles
from support.reading import assert_words_apart
from support.report_data import ENGINE, report, results


def cases_of(scene):
    return [row for row in report().cases if row.case.scene.name == scene]


def styles():
    return Styles.of_cases(row.case for row in report().cases)


@pytest.fixture(scope="module")
def figures():
    """Every figure of the made-up results by the name of its file, laid out."""
    made = {}
    for picture in page.pictures(results(), report().tables):
        with matplotlib.style.context("default"):
            made[picture.name] = picture.drawn.figure_of()
            FigureCanvasAgg(made[picture.name]).draw()
    return made


def test_a_figure_is_drawn_once_and_when_somebody_looks():
    drawn = []

    def figure_of():
        drawn.append(Figure())
        return drawn[-1]

    picture = Drawn(figure_of)
    assert not drawn
    assert picture.png.startswith(b"\x89PNG")
    assert picture.chart is None
    assert len(drawn) == 1


def test_there_are_figures_for_each_scene_and_two_for_all(figures):
    assert set(figures) == {
        "cost",
        "cost_regular",
        *(f"{kind}_{scene}" for kind in ("error", "energy") for scene in ("calm", "wild", "_a_b_1_1")),
    }


def test_no_word_is_cut_off_or_lies_upon_another(figures):
    assert_words_apart(figures)


def test_every_case_is_a_curve_or_is_counted(figures):
    for scene, name in (("calm", "error_calm"), ("wild", "error_wild")):
        cases = cases_of(scene)
        panels = figures[name].axes
        assert [axes.get_title().strip() for axes in panels] == ["ours", "other", ENGINE]
        curves = sum(len(line.get_xdata()) > 2 for axes in panels for line in axes.lines)
        missing = [text.get_text() for axes in panels for text in axes.texts if text.get_text() != "horizon"]
        silent = [row.status for row in cases if not len(row.own.curves.t)]
        assert sorted(missing) == sorted(f"not drawn: 1 {status}" for status in silent)
        assert curves == len(cases) - len(silent)


def test_runs_that_ended_are_crossed_where_they_ended(figures):
    crosses = {
        axes.get_title(): [
            (line.get_xdata()[0], line.get_ydata()[0]) for line in axes.lines if line.get_marker() == "X"
        ]
        for axes in figures["error_wild"].axes
    }
    assert crosses["ours"] == []
    ((t, e),) = crosses["other"]
    assert (t, e) == (4.0, 1.5)  # it became infinite there, with e at its largest
    assert len(crosses[ENGINE]) == 1
    assert not any(line.get_marker() == "X" for axes in figures["error_calm"].axes for line in axes.lines)


@pytest.mark.parametrize(("factor", "crossed"), [(1.0, True), (2.5, False)])
def test_a_run_that_failed_past_the_horizon_is_not_crossed_in_the_errors(factor, crossed):
    [torn] = [row for row in cases_of("wild") if row.status == "torn"]  # it ended at 4 s, or at 10: the horizon is 8 s
    rows = [CurveRow(row.case, factor * row.t_s, 1e-3, row.energy_error) for row in report().tables["curves"]
            if row.case is torn.case]  # fmt: skip
    _, [curve] = error_curves(torn.scene, [torn], rows)
    assert curve.ended_badly == crossed


def test_the_horizon_is_drawn_and_named(figures):
    for axes in figures["error_wild"].axes:
        assert "horizon" in [text.get_text() for text in axes.texts]
        assert any(list(line.get_xdata()) == [8.0, 8.0] for line in axes.lines)


def test_blown_up_energies_do_not_squash_the_others(figures):
    bottom, top = figures["energy_wild"].axes[0].get_ylim()
    assert top == 100.0
    assert bottom < 1e-15


def marks_of(axes):
    return {
        (line.get_marker(), round(float(line.get_xdata()[0]), 3), round(float(line.get_ydata()[0]), 3))
        for line in axes.lines
        if line.get_marker() != "None"
    }


def test_costs_stand_where_the_cases_left_the_truth(figures):
    wild = figures["cost"].axes[0]
    assert [axes.get_title().strip() for axes in figures["cost"].axes] == ["wild", "../a|b\\n=1+1"]
    marks = marks_of(wild)
    failed = {("X", round(row.left.median, 3), 1.0) for row in cases_of("wild") if row.status in ("torn", "not finite")}
    assert len(failed) == 2
    assert failed <= marks
    assert (">", 8.0, 10.0) in marks  # stayed up to the horizon; 10 ms, of 1e5 s per s times a step of 1e-3 s
    assert any(mark not in "X>" and time == pytest.approx(4.605) for mark, time, _ in marks)  # ln(1e4) / 2
    assert [text.get_text() for text in wild.texts] == ["not drawn: 1 timed out, 1 crashed"]


def test_where_the_motion_is_regular_costs_stand_over_errors(figures):
    [calm] = figures["cost_regular"].axes
    assert calm.get_title() == "calm"
    marks = {(error, cost) for _, error, cost in marks_of(calm)}
    assert (round(1e-2, 3), 1.0) in marks  # euler: e = h, and 1 ms
    assert calm.get_xscale() == calm.get_yscale() == "log"
    assert not any(line.get_marker() == ">" for line in calm.lines)
    assert [text.get_text() for text in calm.texts] == ["not drawn: 1 refused"]


def test_open_arrows_are_open(figures):
    arrows = [line for axes in figures["cost"].axes for line in axes.lines if line.get_marker() == ">"]
    assert arrows
    assert all(line.get_markerfacecolor() == "none" for line in arrows)


def test_a_case_looks_the_same_in_every_plot(figures):
    ours = {styles().colour(row.case) for row in cases_of("calm") if row.case.engine == "ours"}
    for name in ("error_calm", "energy_wild"):
        colours = {to_rgb(line.get_color()) for line in figures[name].axes[0].lines if len(line.get_xdata()) > 2}
        assert colours == ours
        assert len(colours) == 2


def test_shades_of_an_engine_have_its_hue_and_can_be_told_apart():
    for engine in range(6):
        its = [colorsys.rgb_to_hls(*shade) for shade in shades(hue(engine), 4)]
        assert all(shade[0] == pytest.approx(its[0][0], abs=0.01) for shade in its)
        steps = [light - dark for (_, dark, _), (_, light, _) in itertools.pairwise(its)]
        assert min(steps) > 0.05
    assert len({hue(engine) for engine in range(6)}) == 6


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([2e-5, 0.3], (1e-5, 1.0)),
        ([1e-40, 1e200], (1e-17, 10.0)),
        ([0.5], (0.01, 1.0)),
        ([], (1e-17, 10.0)),
        ([0.0, math.inf, math.nan], (1e-17, 10.0)),
        ([1e-30], (1e-18, 1e-16)),
        ([1e30], (0.1, 10.0)),
    ],
)
def test_limits_are_decades_around_what_there_is(values, expected):
    assert bounds(values, 1e-17, 10.0) == pytest.approx(expected)


def test_the_style_of_the_user_changes_nothing():
    figure_of = partial(cost_figure, styles(), cases_of("wild"), TIME)
    plain = Drawn(figure_of).png
    with matplotlib.rc_context({"font.size": 20, "axes.facecolor": "black", "savefig.dpi": 30}):
        assert Drawn(figure_of).png == plain
        assert matplotlib.rcParams["font.size"] == 20
