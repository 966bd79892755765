"""The plots, looked at as figures: what is drawn, where, and that it can be read."""

from __future__ import annotations

import colorsys
import itertools
import math
from functools import partial

import matplotlib.style
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb

import report_data
from pendbench.report import chaos_plots
from pendbench.report.chaos_cost import cost_figure
from pendbench.report.columns import is_missing
from pendbench.report.look import Look
from pendbench.report.plots import bounds, draw, hue, shades
from pendbench.report.rows import records
from report_data import ENGINE, results


@pytest.fixture(scope="module")
def figures():
    """Every figure of the made-up results by the name of its file, laid out."""
    made = {}
    found = results()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chaos_plots, "draw", lambda figure_of: figure_of)
        for picture in chaos_plots.pictures(found):
            with matplotlib.style.context("default"):
                made[picture.name] = picture.png()
                FigureCanvasAgg(made[picture.name]).draw()
    return made


def texts_of(figure):
    """The words in a figure with their places, without the numbers at the axes."""
    ticks = {text for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for text in axis.get_ticklabels()}
    inside = {text for axes in figure.axes for text in axes.texts}  # drawn upon curves on purpose
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    texts = [*figure.texts, figure._suptitle, figure._supylabel]
    texts += [text for axes in figure.axes for text in (axes.title, axes.xaxis.label, axes.yaxis.label)]
    texts += [text for legend in legends for text in legend.get_texts()]
    chosen = dict.fromkeys(text for text in texts if text is not None and text.get_text())
    return [(text.get_text(), text.get_window_extent()) for text in chosen if text not in ticks | inside]


def test_there_is_a_figure_for_each_scene_and_one_for_all(figures):
    assert set(figures) == {
        "cost",
        *(f"{kind}_{scene}" for kind in ("error", "energy") for scene in ("calm", "wild", "_a_b_1_1")),
    }


def test_no_word_is_cut_off_or_lies_upon_another(figures):
    for name, figure in figures.items():
        found = texts_of(figure)
        assert len(found) > 5
        for text, box in found:
            inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
            assert inside, f"{name}: {text!r} at {box}"
        for (one, its), (other, others) in itertools.combinations(found, 2):
            assert not its.padded(-1).overlaps(others.padded(-1)), f"{name}: {one!r} and {other!r}"


def test_every_case_is_a_curve_or_is_counted(figures):
    for scene, name in (("calm", "error_calm"), ("wild", "error_wild")):
        cases = [row for row in records(results().cases) if row["scene"] == scene]
        panels = figures[name].axes
        assert [axes.get_title().strip() for axes in panels] == ["ours", "other", ENGINE]
        curves = sum(len(line.get_xdata()) > 2 for axes in panels for line in axes.lines)
        missing = [text.get_text() for axes in panels for text in axes.texts if text.get_text() != "horizon"]
        silent = [row["status"] for row in cases if not row["starts"]]
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


def test_a_run_that_failed_past_the_horizon_is_not_crossed_in_the_errors():
    rows = [{**row, "t_s": 2.5 * row["t_s"]} for row in report_data.curve_rows(torn())]  # it ended at 10 s
    starts = list(report_data.start_rows(torn()))
    (within,), (beyond,) = (chaos_plots.curves_of(rows, "error", starts, until) for until in (10.0, 8.0))
    assert within.ended_badly
    assert not beyond.ended_badly


def torn():
    return report_data.case("wild", ENGINE, report_data.METHOD, 1e-2)


def test_the_horizon_is_drawn_and_named(figures):
    for axes in figures["error_wild"].axes:
        assert "horizon" in [text.get_text() for text in axes.texts]
        assert any(list(line.get_xdata()) == [8.0, 8.0] for line in axes.lines)


def test_blown_up_energies_do_not_squash_the_others(figures):
    bottom, top = figures["energy_wild"].axes[0].get_ylim()
    assert top == 100.0
    assert bottom < 1e-15


def test_costs_stand_where_the_cases_left_the_truth(figures):
    cases = [row for row in records(results().cases) if row["scene"] == "wild"]
    wild = figures["cost"].axes[1]
    assert wild.get_title() == "wild"
    marks = {
        (line.get_marker(), round(float(line.get_xdata()[0]), 3)) for line in wild.lines if line.get_marker() != "None"
    }
    failed = {("X", round(row["t_1e-2_s"], 3)) for row in cases if row["status"] in ("torn", "not finite")}
    assert len(failed) == 2
    assert failed <= marks
    assert (">", 8.0) in marks  # stayed up to the horizon
    assert any(mark not in "X>" and time == pytest.approx(4.605) for mark, time in marks)  # ln(1e4) / 2
    assert [text.get_text() for text in wild.texts] == ["not drawn: 1 timed out, 1 crashed"]


def test_open_arrows_are_open(figures):
    arrows = [line for axes in figures["cost"].axes for line in axes.lines if line.get_marker() == ">"]
    assert arrows
    assert all(line.get_markerfacecolor() == "none" for line in arrows)


def test_a_case_looks_the_same_in_every_plot(figures):
    look = Look.of_cases(records(results().cases))
    for name in ("error_calm", "energy_wild"):
        colours = {to_rgb(line.get_color()) for line in figures[name].axes[0].lines if len(line.get_xdata()) > 2}
        assert colours == {look.colour("ours", "adaptive"), look.colour("ours", "rk4")}


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
    cases = [row for row in records(results(scenes=("wild",)).cases) if not is_missing(row["step_us"])]
    figure_of = partial(cost_figure, Look.of_cases(cases), cases)
    plain = draw(figure_of)
    with matplotlib.rc_context({"font.size": 20, "axes.facecolor": "black", "savefig.dpi": 30}):
        assert draw(figure_of) == plain
        assert matplotlib.rcParams["font.size"] == 20
