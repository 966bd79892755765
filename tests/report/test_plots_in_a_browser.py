"""The plots of a report in a real browser: they tell values, zoom, and show the engines that are wanted."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from matplotlib.figure import Figure

from pendbench.report.charts import Mark, chart_of
from pendbench.report.html_page import html_page
from pendbench.report.plots import Drawn, logarithmic
from support.browser import Visit, browser

X = np.linspace(0.0, 10.0, 101)
PAGE = "# Title\n\n## The answer\n\nOne.\n\n![one](plots/one.png)\n\n*caption*\n\n![bars](plots/bars.png)\n"


def two_panels():
    """An engine's errors in each panel, e = size exp(t); the second has two methods, and a failure."""
    figure = Figure(figsize=(8, 4))
    figure.suptitle("errors")
    figure.supylabel("e, in lengths")
    for axes, engine, sizes in zip(figure.subplots(1, 2), ("ours", "theirs"), ((1e-6,), (1e-4, 1e-2)), strict=True):
        logarithmic(axes, 1e-8, 1e4)
        axes.set(xlim=(0.0, 10.0), xlabel="t, s", title=engine)
        axes.axhline(1e-2, color="0.6")
        for size, method in zip(sizes, ("rk4", "euler"), strict=False):
            mark = Mark(engine, method, "step 0.01 s", (5.0, 1.5)).gid
            axes.plot(X, size * np.exp(X), color="#0072B2", gid=mark, linestyle=(0, (5, 1.5)))
        axes.annotate("not drawn: 1 refused", (0.02, 0.02), xycoords="axes fraction")
    return figure


def bars():
    figure = Figure()
    figure.subplots().bar([0, 1], [1, 2])
    return figure


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("plots") / "report.html"
    path.write_text(
        html_page(PAGE, "One.", {"plots/one.png": Drawn(two_panels), "plots/bars.png": Drawn(bars)}), "utf-8"
    )
    return path


@pytest.fixture(scope="module")
def chromium():
    with browser() as opened:
        yield opened


@pytest.fixture
def visit(chromium, page):
    seen = Visit(chromium, page)
    yield seen
    assert seen.complaints == []
    assert len(seen.requests) == 1
    seen.context.close()


def where(visit, panel, x, y):
    """Where the page has a value of a panel, px of the window: from the size of its canvas, and the axes' ends."""
    canvas = visit.page.locator(".panels canvas").nth(panel)
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    left, bottom = 46, 22
    across = (box["width"] - left - 8) * x / 10.0
    up = (box["height"] - bottom - 8) * (np.log10(y) + 8) / 12.0
    return box["x"] + left + across, box["y"] + box["height"] - bottom - up


def told(visit, panel, x, y):
    visit.page.mouse.move(*where(visit, panel, x, y))
    return visit.page.locator("#readout").text_content()


def test_a_figure_of_lines_is_read_back_as_it_was_drawn():
    chart = chart_of(two_panels())
    assert chart.title == "errors"
    first, second = chart.panels
    assert (first.x.low, first.x.high, first.x.log, first.x.label) == (0.0, 10.0, False, "t, s")
    assert (first.y.low, first.y.high, first.y.log, first.y.label) == (1e-8, 1e4, True, "e, in lengths")
    assert [line.mark.method for line in second.lines] == ["rk4", "euler"]
    assert second.lines[0].mark == Mark("theirs", "rk4", "step 0.01 s", (5.0, 1.5))
    assert np.allclose(second.lines[1].y, 1e-2 * np.exp(X))
    assert [(rule.along, rule.value) for rule in first.rules] == [("y", 1e-2)]
    assert first.notes == ("not drawn: 1 refused",)
    assert chart_of(bars()) is None


def test_a_page_holds_the_points_to_what_can_be_read(page):
    """To a 65000th of one and a half axes: of twelve decades, to 0.03 % of a value."""
    import base64

    data = json.loads(re.search(r'id="data">(.*?)</script>', page.read_text("utf-8"), re.DOTALL)[1])
    packed = data["charts"]["plots/one.png"]["panels"][0]["lines"][0]["points"]
    places = np.frombuffer(base64.b64decode(packed), "<u2").reshape(-1, 2) / 65535 * 1.5 - 0.25
    assert np.allclose(10.0 * places[:, 0], X, atol=2e-4)
    assert np.allclose(10 ** (12 * places[:, 1] - 8), 1e-6 * np.exp(X), rtol=4e-4)


def test_pointing_tells_whose_a_value_is_and_what_it_is(visit):
    text = told(visit, 0, 5.0, 1e-6 * np.exp(5.0))
    assert "ours rk4, step 0.01 s" in text
    assert "1.48e-4" in text  # 1e-6 exp(5)
    assert "5" in text.splitlines()[-1]
    visit.page.mouse.move(2, 2)
    assert visit.page.locator("#readout").is_hidden()


def test_dragging_zooms_all_panels_and_the_button_shows_all(visit):
    back = visit.page.get_by_role("button", name="all of it")
    assert back.is_hidden()
    visit.page.mouse.move(*where(visit, 0, 4.0, 1e-6))
    visit.page.mouse.down()
    visit.page.mouse.move(*where(visit, 0, 6.0, 1e-2), steps=3)
    visit.page.mouse.up()
    ends = "({view}) => [view.across.low, view.across.high, view.up.low, view.up.high]"
    ends = f"() => pendbench.plots.views[0].views.map({ends})"
    for low, high, bottom, top in visit.page.evaluate(ends):
        assert (low, high) == (pytest.approx(4.0, abs=0.1), pytest.approx(6.0, abs=0.1))
        assert (bottom, top) == (pytest.approx(1e-6, rel=0.3), pytest.approx(1e-2, rel=0.3))
    back.click()
    assert visit.page.evaluate(ends)[0] == pytest.approx([0.0, 10.0, 1e-8, 1e4])


def test_keys_zoom(visit):
    canvas = visit.page.locator(".panels canvas").first
    canvas.press("+")
    assert visit.page.evaluate("() => pendbench.plots.views[0].views[1].view.across.low") > 1.0
    canvas.press("Home")
    assert visit.page.evaluate("() => pendbench.plots.views[0].views[1].view.across.low") == 0.0


def test_an_engine_and_a_method_can_be_switched_off(visit):
    place = (1, 5.0, 1e-2 * np.exp(5.0))
    assert "theirs euler" in told(visit, *place)
    visit.page.get_by_role("button", name="euler").click()
    visit.page.mouse.move(2, 2)
    visit.page.mouse.move(*where(visit, *place))
    assert visit.page.locator("#readout").is_hidden()
    visit.page.get_by_role("button", name="theirs").click()
    assert visit.page.locator(".panels figure:visible").count() == 1
    assert visit.page.get_by_role("button", name="theirs").get_attribute("aria-pressed") == "false"


def test_panels_with_the_same_axes_can_be_one(visit):
    visit.page.get_by_role("button", name="in one panel").click()
    assert visit.page.locator(".panels canvas").count() == 1
    assert "ours rk4" in told(visit, 0, 5.0, 1e-6 * np.exp(5.0))
    assert "theirs euler" in told(visit, 0, 5.0, 1e-2 * np.exp(5.0))


def test_on_paper_a_plot_is_its_picture(visit):
    picture = visit.page.locator("img[data-plot]")
    assert picture.is_hidden()
    assert visit.page.locator("img:not([data-plot])").is_visible()
    visit.page.emulate_media(media="print")
    assert picture.is_visible()
    assert visit.page.locator(".plot").is_hidden()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_checker_of_accessibility_finds_nothing_serious(chromium, page, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    seen = Visit(chromium, page, color_scheme=scheme, bypass_csp=True)
    seen.page.get_by_role("button", name="euler").click()
    found = axe.Axe().run(seen.page).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"]) for each in found if each["impact"] in ("serious", "critical")] == []
    seen.context.close()
