"""The plots of a cost study, looked at as figures: every case is where its numbers put it, and words can be read."""

from __future__ import annotations

import itertools
import math

import matplotlib.style
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from cost_data import FAILURES, METHODS, results
from pendbench.report import cost_plots
from pendbench.report.cost_series import without_tolerance
from pendbench.report.look import Look
from pendbench.report.rows import method_name, records
from report_data import ENGINE
from test_report_plots import texts_of

CROSS = "X"
TOP = pytest.approx(0.1)


@pytest.fixture(scope="module")
def figures():
    """Every figure of the made-up results by the name of its file, laid out."""
    made = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cost_plots, "draw", lambda figure_of: figure_of)
        for picture in cost_plots.pictures(results()):
            with matplotlib.style.context("default"):
                made[picture.name] = picture.png()
                FigureCanvasAgg(made[picture.name]).draw()
    return made


@pytest.fixture(scope="module")
def look():
    return Look.of_cases([without_tolerance(row) for row in records(results().cases)])


def points(axes, *, crosses=False):
    """The points that are marked, by their colour: those of the cases, or the crosses."""
    lines = [line for line in axes.lines if line.get_marker() != "None" and (line.get_marker() == CROSS) == crosses]
    return {line.get_color(): list(zip(line.get_xdata(), line.get_ydata(), strict=True)) for line in lines}


def cases(scene, engine, method):
    return [row for row in records(results().cases)
            if (row["scene"], row["engine"], row["method"]) == (scene, engine, method)]  # fmt: skip


def test_there_are_two_figures_for_each_scene_and_one_for_its_long_runs(figures):
    scenes = ("calm", "a01", "_a_b_1_1")
    assert set(figures) == {"long_calm", *(f"{kind}_{scene}" for kind in ("work", "steps") for scene in scenes)}


def test_no_word_is_cut_off_or_lies_upon_another(figures):
    for name, figure in figures.items():
        found = texts_of(figure)
        assert len(found) > 5
        for text, box in found:
            inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
            assert inside, f"{name}: {text!r} at {box}"
        for (one, its), (other, others) in itertools.combinations(found, 2):
            assert not its.padded(-1).overlaps(others.padded(-1)), f"{name}: {one!r} and {other!r}"


def test_errors_stand_where_their_cost_puts_them(figures, look):
    (axes,) = figures["work_calm"].axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    drawn = points(axes)
    for engine, method, settings in METHODS:
        own = [row for row in cases("calm", engine, method) if row["status"] == "ok"]
        name = method_name({"method": method, "settings": settings})
        expected = [(pytest.approx(1e3 * row["run_s"] / 2.0), pytest.approx(row["error_max"])) for row in own]
        assert drawn.get(look.colour(engine, name), []) == expected


def test_failed_steps_stand_at_the_top_at_what_they_would_have_cost(figures, look):
    (axes,) = figures["work_calm"].axes
    assert points(axes, crosses=True) == {look.colour("other", "rk4"): [(pytest.approx(1e-3 * 10.0 / 2e-2), TOP)]}
    assert axes.get_ylim()[1] == TOP
    (note,) = [text.get_text() for text in axes.texts]
    assert note == "not drawn: 2 refused"  # which is no matter of the step


def test_the_front_is_what_nothing_cheaper_is_as_accurate_as(figures):
    for scene, seconds in (("calm", 2.0), ("a01", 2000.0)):
        (axes,) = figures[f"work_{scene}"].axes
        (front,) = [line for line in axes.lines if line.get_color() == "black"]
        assert front.get_drawstyle() == "steps-post"
        known = [(1e3 * row["run_s"] / seconds, row["error_max"]) for row in records(results().cases)
                 if row["scene"] == scene and row["status"] == "ok"]  # fmt: skip
        best = [
            point for point in known if not any(c <= point[0] and e <= point[1] for c, e in known if (c, e) != point)
        ]
        drawn = list(zip(front.get_xdata(), front.get_ydata(), strict=True))
        assert drawn[1:-1] == [pytest.approx(point) for point in sorted(best)]
        assert drawn[-1] == (axes.get_xlim()[1], drawn[-2][1])


def test_every_case_stands_at_its_step_or_is_counted(figures, look):
    panels = figures["steps_calm"].axes
    assert [axes.get_title() for axes in panels] == ["ours", "other", ENGINE]
    for axes, engine in zip(panels, look.engines, strict=True):
        drawn, crossed = points(axes), points(axes, crosses=True)
        refused = 0
        for _, method, settings in (key for key in METHODS if key[0] == engine):
            colour = look.colour(engine, method_name({"method": method, "settings": settings}))
            for row in cases("calm", engine, method):
                place = row["dt"] if math.isfinite(row["dt"]) else 2.0 / row["steps"]
                if row["status"] == "ok":
                    assert (pytest.approx(place), pytest.approx(row["error_max"])) in drawn[colour]
                elif row["status"] == "refused":
                    refused += 1
                else:
                    assert (pytest.approx(place), TOP) in crossed[colour]
        notes = [text.get_text() for text in axes.texts if text.get_text().startswith("not drawn")]
        assert notes == ([f"not drawn: {refused} refused"] if refused else [])
    assert sum(scene == "calm" for scene, *_ in FAILURES) == 3


def test_slopes_are_those_of_the_claimed_orders_through_what_was_seen(figures):
    ours, other, theirs = figures["steps_calm"].axes
    for axes, orders in ((ours, [4]), (other, [4, 1]), (theirs, [])):
        slopes = [line for line in axes.lines if line.get_linestyle() == "--"]
        found = []
        for line in slopes:
            (x0, x1), (y0, y1) = line.get_xdata(), line.get_ydata()
            found.append(round(math.log(y1 / y0) / math.log(x1 / x0), 6))
            error = y0 * (1e-3 / x0) ** found[-1]
            assert error == pytest.approx({4: 1e-8, 1: 1e-3}[round(found[-1])])
        assert found == orders
        assert [text.get_text() for text in axes.texts if text.get_text().startswith("order")] == [
            f"order {order}" for order in orders
        ]


def test_long_runs_show_the_largest_error_so_far_and_who_failed(figures):
    ours, other, theirs = figures["long_calm"].axes
    for axes in (ours, other):
        for line in axes.lines:
            assert list(line.get_ydata()) == sorted(line.get_ydata())
    assert [text.get_text() for text in theirs.texts] == ["not drawn: 1 crashed"]
    assert figures["long_calm"]._suptitle.get_text() == "calm: energy over 1000000 steps"


def test_an_engine_has_one_hue_in_every_plot(figures, look):
    for name in ("work_a01", "steps_a01"):
        colours = {
            line.get_color() for axes in figures[name].axes for line in axes.lines if line.get_marker() != "None"
        }
        assert colours <= {look.colour(engine, method) for engine in look.engines for method in look.methods[engine]}
    assert look.methods["ours"] == ["adaptive", "rk4"]  # its tolerances have one shade


def test_where_nothing_was_measured_there_is_no_plot():
    assert list(cost_plots.pictures(results(failing=True))) == []
