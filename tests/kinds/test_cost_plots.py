"""The plots of a cost study, looked at as figures: every case is where its numbers put it, and words can be read."""

from __future__ import annotations

import math

import matplotlib.style
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from pendbench.kinds.cost import plots as cost_plots
from pendbench.report.names import method_name
from pendbench.report.page import Report
from pendbench.report.styles import Styles, engine_hue
from support import cost_data
from support.cost_data import FAILURES, METHODS, results
from support.reading import assert_words_apart
from support.report_data import ENGINE

CROSS = "X"
TOP = pytest.approx(0.1)


@pytest.fixture(scope="module", autouse=True)
def report():
    with cost_data.made_up_engines():
        yield Report(results())


@pytest.fixture(scope="module")
def figures(report):
    """Every figure of the made-up results by the name of its file, laid out."""
    made = {}
    for picture in cost_plots.pictures(report.results, report.tables):
        with matplotlib.style.context("default"):
            made[picture.name] = picture.drawn.figure_of()
            FigureCanvasAgg(made[picture.name]).draw()
    return made


@pytest.fixture(scope="module")
def every(report):
    return [row.series for row in report.tables["orders"]]


@pytest.fixture(scope="module")
def styles(every):
    return Styles.of_cases(series.case for series in every)


def panels(figure):
    return {axes.get_title(): axes for axes in figure.axes}


def points(axes, *, crosses=False):
    """The points that are marked, by their colour: those of the cases, or the crosses."""
    lines = [line for line in axes.lines if line.get_marker() != "None" and (line.get_marker() == CROSS) == crosses]
    return {line.get_color(): list(zip(line.get_xdata(), line.get_ydata(), strict=True)) for line in lines}


def test_there_are_two_figures_for_each_scene_and_one_for_its_long_runs(figures):
    scenes = ("calm", "a01", "_a_b_1_1")
    assert set(figures) == {"long_calm", *(f"{kind}_{scene}" for kind in ("work", "steps") for scene in scenes)}


def test_no_word_is_cut_off_or_lies_upon_another(figures):
    assert_words_apart(figures)


def test_errors_stand_where_their_cost_puts_them_in_the_panel_of_their_engine(figures, every, styles):
    drawn = {engine: points(axes) for engine, axes in panels(figures["work_calm"]).items()}
    for series in (series for series in every if series.case.scene.name == "calm"):
        expected = [(pytest.approx(1e3 * row.timing.run_s / 2.0), pytest.approx(row.run.error_max))
                    for row in series.rows if row.status == "ok"]  # fmt: skip
        assert drawn[series.case.engine].get(styles.colour(series.case), []) == expected


def test_the_other_engines_are_there_in_grey(figures):
    for engine, axes in panels(figures["work_a01"]).items():
        grey = [line for line in axes.lines if line.get_color() == "0.85"]
        assert len(grey) == sum(key[0] != engine for key in METHODS)


def test_failed_steps_stand_at_the_top_at_what_they_would_have_cost(figures, styles, every):
    [rk4] = [series.case for series in every if (series.case.scene.name, series.case.engine, series.case.method)
             == ("calm", "other", "rk4")]  # fmt: skip
    its = panels(figures["work_calm"])
    assert points(its["other"], crosses=True) == {styles.colour(rk4): [(pytest.approx(1e-3 * 10.0 / 2e-2), TOP)]}
    assert its["other"].get_ylim()[1] == TOP
    assert [text.get_text() for text in its[ENGINE].texts] == ["not drawn: 2 refused"]  # which is no matter of the step


def test_the_front_is_what_nothing_cheaper_is_as_accurate_as(figures, every):
    for scene, seconds in (("calm", 2.0), ("a01", 2000.0)):
        rows = [row for series in every if series.case.scene.name == scene for row in series.rows if row.status == "ok"]
        known = [(1e3 * row.timing.run_s / seconds, row.run.error_max) for row in rows]
        best = [p for p in known if not any(c <= p[0] and e <= p[1] for c, e in known if (c, e) != p)]
        for axes in figures[f"work_{scene}"].axes:
            (front,) = [line for line in axes.lines if line.get_color() == "black"]
            assert front.get_drawstyle() == "steps-post"
            drawn = list(zip(front.get_xdata(), front.get_ydata(), strict=True))
            assert drawn[1:-1] == [pytest.approx(point) for point in sorted(best)]
            assert drawn[-1] == (axes.get_xlim()[1], drawn[-2][1])


def test_every_case_stands_at_its_step_or_is_counted(figures, styles, every):
    its = panels(figures["steps_calm"])
    assert list(its) == ["ours", "other", ENGINE]
    for engine, axes in its.items():
        drawn, crossed, refused = points(axes), points(axes, crosses=True), 0
        for series in (one for one in every if (one.case.scene.name, one.case.engine) == ("calm", engine)):
            colour = styles.colour(series.case)
            for row in series.rows:
                if row.status == "refused":
                    refused += 1
                    continue
                place = row.case.dt or 2.0 / row.run.steps
                if row.status == "ok":
                    assert (pytest.approx(place), pytest.approx(row.run.error_max)) in drawn[colour]
                else:
                    assert (pytest.approx(place), TOP) in crossed[colour]
        notes = [text.get_text() for text in axes.texts if text.get_text().startswith("not drawn")]
        assert notes == ([f"not drawn: {refused} refused"] if refused else [])
    assert sum(scene == "calm" for scene, *_ in FAILURES) == 3


def test_slopes_are_those_of_the_claimed_orders_through_what_was_seen(figures):
    its = panels(figures["steps_calm"])
    for engine, orders in (("ours", [4]), ("other", [4, 1]), (ENGINE, [])):
        slopes = [line for line in its[engine].lines if line.get_linestyle() == "--" and line.get_marker() == "None"]
        found = []
        for line in slopes:
            (x0, x1), (y0, y1) = line.get_xdata(), line.get_ydata()
            found.append(round(math.log(y1 / y0) / math.log(x1 / x0), 6))
            error = y0 * (1e-3 / x0) ** found[-1]
            assert error == pytest.approx({4: 1e-8, 1: 1e-3}[round(found[-1])])
        assert found == orders
        assert [text.get_text() for text in its[engine].texts if text.get_text().startswith("order")] == [
            f"order {order}" for order in orders
        ]


def test_long_runs_show_the_largest_error_so_far_and_who_failed(figures):
    its = panels(figures["long_calm"])
    for engine in ("ours", "other"):
        for line in its[engine].lines:
            assert list(line.get_ydata()) == sorted(line.get_ydata())
    assert [text.get_text() for text in its[ENGINE].texts] == ["not drawn: 1 crashed"]
    assert figures["long_calm"]._suptitle.get_text() == "calm: energy over 1000000 steps"


def test_the_methods_of_an_engine_differ_by_more_than_their_shade(figures):
    for name in ("work_a01", "steps_a01", "long_calm"):
        for axes in figures[name].axes:
            lines = [line for line in axes.lines if line.get_marker() not in ("None", CROSS)]
            strokes = [(line.get_marker(), str(line._dash_pattern)) for line in lines]
            assert len(set(strokes)) == len(strokes)
            assert {line.get_linewidth() for line in lines} <= {1.2}  # a width would have to mean something
            names = [text.get_text() for text in axes.get_legend().get_texts()] if axes.get_legend() else []
            assert len(names) == len(lines)


def test_a_curve_that_lies_upon_another_shows_its_markers_beside_those(figures):
    (axes,) = [axes for axes in figures["long_calm"].axes if axes.get_title() == "other"]
    starts = [line.get_markevery()[0] for line in axes.lines]
    assert len(starts) == len(set(starts)) == 2


def test_an_engine_has_one_hue_in_every_plot(figures, styles, every):
    assert styles.methods["ours"] == ["adaptive", "rk4"]  # its tolerances have one shade
    colours = {engine: {styles.colour(series.case) for series in every if series.case.engine == engine}
               for engine in styles.engines}  # fmt: skip
    for name in ("work_a01", "steps_a01"):
        for engine, axes in panels(figures[name]).items():
            assert set(points(axes)) <= colours[engine]
    assert engine_hue("mujoco") != engine_hue("pymunk")
    assert {method_name(series.case) for series in every if series.case.engine == "ours"} == {"adaptive", "rk4"}


def test_where_nothing_was_measured_there_is_no_plot():
    assert Report(results(failing=True)).pictures == []
    assert np.isfinite(Report(results()).tables["cases"].rows[0].measured.run.error_max)
