"""The page in a real browser: it moves, its views agree, and it keeps to itself."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from pendbench.report.numbers import NOTHING
from pendbench.report.stage.thinning import points_drawn
from support.browser import Visit, act, browser, small_stage, swinging, write_stage

HOSTILE = '</script><script>document.title="taken"</script><img src=x onerror=\'document.title="taken"\'>&lt;"\u2028'


@pytest.fixture(scope="module")
def chromium():
    with browser() as opened:
        yield opened


@pytest.fixture
def visit(chromium, tmp_path):
    seen = Visit(chromium, write_stage(small_stage(), tmp_path), reduced_motion="reduce")
    yield seen
    assert seen.complaints == []
    assert len(seen.requests) == 1, "something beside the page itself was asked for"
    seen.context.close()


def pixels(visit):
    """The stage as it is seen, (rows, columns, 3)."""
    return np.array(Image.open(io.BytesIO(visit.page.locator("#stage").screenshot())).convert("RGB"))


def shown_at(visit, body, point):
    """Where the page has a point of the body of an act, px, by the page's own account of its scale."""
    x, y = body.places[body.t.searchsorted(visit.time() - 1e-9), point]
    cell = visit.page.evaluate("() => { const c = pendbench.scene.cells()[0]; return [c.x, c.y, c.scale]; }")
    return cell[0] + cell[2] * x, cell[1] - cell[2] * y


def places_of(visit, colour):
    """The middles (columns, rows), px, of all that has exactly that colour on the stage."""
    rows, columns = np.nonzero((pixels(visit) == colour).all(axis=-1))
    return columns + 0.5, rows + 0.5


def test_with_reduced_motion_it_waits_and_otherwise_it_plays(chromium, tmp_path, visit):
    assert visit.time() == 0.0
    path = write_stage(small_stage(), tmp_path)
    moving = Visit(chromium, path, reduced_motion="no-preference")
    moving.page.wait_for_function("() => pendbench.clock.time > 0.05")
    moving.context.close()


def test_play_moves_the_masses_and_pause_stops_them(visit):
    before = pixels(visit)
    visit.page.get_by_role("button", name="Play").click()
    visit.page.wait_for_function("() => pendbench.clock.time > 0.2")
    visit.page.get_by_role("button", name="Pause").click()
    visit.settle()
    stopped = visit.time()
    assert (pixels(visit) != before).any()
    visit.settle()
    assert visit.time() == stopped


def test_it_stops_at_the_end_and_begins_again(visit):
    visit.page.select_option("#speed", "4")
    visit.set_time(3.9)
    visit.page.keyboard.press("Space")
    visit.page.wait_for_function("() => !pendbench.clock.playing")
    assert visit.time() == 4.0
    visit.page.keyboard.press("Space")
    visit.page.wait_for_function("() => pendbench.clock.time < 2 && pendbench.clock.time > 0")


def test_the_time_line_sets_the_time_in_all_views(visit):
    before = {name: visit.page.locator(f"#{name}").screenshot() for name in ("stage", "error", "energy")}
    visit.page.locator("#time").fill("2")
    visit.settle()
    assert visit.time() == 2.0
    assert visit.page.locator("#now").text_content() == "2.00 s"
    assert all(visit.page.locator(f"#{name}").screenshot() != picture for name, picture in before.items())
    assert visit.page.locator("#legend tr").first.locator("td").nth(1).text_content() == "4e-4"  # 1e-6 exp(6)


def test_dragging_in_a_chart_sets_the_time_and_hovering_tells_values(visit):
    box = visit.page.locator("#error").bounding_box()
    visit.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 60)
    told = visit.page.locator("#readout").text_content()
    assert "analytic" in told
    assert "mujoco" in told
    visit.page.mouse.down()
    visit.page.mouse.up()
    assert 1.7 < visit.time() < 2.4
    visit.page.mouse.move(2, 2)
    assert visit.page.locator("#readout").is_hidden()


@pytest.mark.parametrize(("key", "time"), [("End", 4.0), ("Home", 0.0), ("ArrowRight", 1.02), ("ArrowLeft", 0.98)])
def test_keys(visit, key, time):
    visit.set_time(1.0)
    visit.page.keyboard.press(key)
    assert visit.time() == pytest.approx(time)


def test_a_box_hides_its_run_everywhere(visit):
    visit.set_time(1.0)
    orange = [0xD5, 0x5E, 0x00]
    assert len(places_of(visit, orange)[0]) > 50
    visit.page.get_by_role("checkbox", name="mujoco").uncheck()
    visit.settle()
    assert len(places_of(visit, orange)[0]) == 0
    assert len(places_of(visit, [0x00, 0x72, 0xB2])[0]) > 50


@pytest.mark.parametrize("time", [0.0, 0.37, 1.5, 2.99])
def test_masses_are_where_the_run_has_them_to_a_pixel(visit, time):
    """The disc of a mass is found in the picture itself: its middle is that of the pixels of its colour around it."""
    visit.set_time(time)
    body = small_stage().acts[1].bodies[0]
    x, y = shown_at(visit, body, 2)
    columns, rows = places_of(visit, [0xD5, 0x5E, 0x00])
    near = np.hypot(columns - x, rows - y) < 5.0
    assert near.sum() > 60  # of the 78 px that lie within 5 px: the disc has a radius of 5.5
    assert abs(columns[near].mean() - x) < 1.0
    assert abs(rows[near].mean() - y) < 1.0


def test_the_scale_of_the_stage_is_that_of_the_chain(visit):
    """The pivot and a mass are as far apart as the chain says: the page's own scale is not taken on trust."""
    low, high, scale = visit.page.evaluate(
        "() => [pendbench.scene.bounds.low, pendbench.scene.bounds.high, pendbench.scene.cells()[0].scale]"
    )
    reached = np.concatenate([swinging(401, rate, 1.0).reshape(-1, 2) for rate in (3.0, 3.2)])
    assert np.allclose(low, np.minimum(reached.min(axis=0), 0.0), atol=1e-4)
    assert np.allclose(high, np.maximum(reached.max(axis=0), 0.0), atol=1e-4)
    width, height = (visit.page.locator("#stage").bounding_box()[side] for side in ("width", "height"))
    assert scale * (high[0] - low[0]) <= width
    assert scale * (high[1] - low[1]) <= height


def test_between_samples_a_mass_stays_on_its_circle(visit):
    """The cubic between samples 10 ms apart is off by a hundredth of a pixel, where a chord would be by a tenth."""
    found = visit.page.evaluate(
        "() => placesAt(pendbench.stage.acts[0].bodies[0], 1.005, new Float64Array(6)).join(' ')"
    )
    angle = np.cos(3.0 * 1.005)
    assert np.allclose(np.array(found.split(), float)[2:4], [0.5 * np.sin(angle), -0.5 * np.cos(angle)], atol=3e-5)


def test_past_the_horizon_nobody_knows(visit):
    note = visit.page.get_by_text("past here nobody knows")
    visit.set_time(2.9)
    assert note.is_hidden()
    visit.set_time(3.1)
    assert note.is_visible()
    assert visit.page.locator("#legend tr").first.locator("td").nth(1).text_content() == NOTHING


def test_a_hostile_title_stays_text(chromium, tmp_path):
    acts = (replace(act(HOSTILE, "#0072b2", 3.0), detail=HOSTILE, ended=HOSTILE),)
    stage = small_stage(HOSTILE, name=HOSTILE, acts=acts, words=(HOSTILE,), facts=((HOSTILE, HOSTILE),))
    seen = Visit(chromium, write_stage(stage, tmp_path))
    assert seen.page.locator("h1").text_content() == HOSTILE
    assert seen.page.title().startswith("</script><script>")
    assert seen.page.locator("img").count() == 0
    assert seen.page.locator("#legend .name").text_content() == HOSTILE
    assert seen.complaints == []
    assert len(seen.requests) == 1
    seen.context.close()


def test_the_page_may_ask_no_network(visit):
    refused = visit.page.evaluate("() => fetch('data:text/plain,a').then(() => 'sent', () => 'refused')")
    assert refused == "refused"
    visit.complaints.clear()  # the browser says so


def test_the_theme_follows_the_system_and_the_button(chromium, tmp_path):
    path = write_stage(small_stage(), tmp_path)
    for scheme, other in (("light", "dark"), ("dark", "light")):
        seen = Visit(chromium, path, color_scheme=scheme)
        theme = "() => document.documentElement.dataset.theme"
        assert seen.page.evaluate(theme) == scheme
        seen.page.get_by_role("button", name="Dark or light").click()
        assert seen.page.evaluate(theme) == other
        seen.context.close()


@pytest.mark.parametrize("width", [360, 768, 1400])
def test_nothing_is_wider_than_the_screen(chromium, tmp_path, width):
    path = write_stage(small_stage(), tmp_path)
    seen = Visit(chromium, path, viewport={"width": width, "height": 740}, has_touch=width < 800)
    assert seen.page.evaluate("() => document.documentElement.scrollWidth") <= width
    seen.context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_checker_of_accessibility_finds_nothing_serious(chromium, tmp_path, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    stage = small_stage(acts=(replace(small_stage().acts[0], ended="refused: no such joint"), small_stage().acts[1]))
    seen = Visit(chromium, write_stage(stage, tmp_path), color_scheme=scheme, bypass_csp=True)
    for summary in seen.page.locator("summary").all():
        summary.click()
    found = axe.Axe().run(seen.page).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"]) for each in found if each["impact"] != "minor"] == []
    seen.context.close()


def test_a_long_chain_is_thinned_and_shown(chromium, tmp_path):
    points = points_drawn(1000)
    t = np.linspace(0.0, 4.0, 101)
    angle = np.cos(t)[:, None] * np.linspace(0.0, 1.0, 1000)
    places = np.cumsum(np.stack([np.sin(angle), -np.cos(angle)], axis=-1) / 1000, axis=1)
    body = replace(small_stage().acts[0].bodies[0], t=t, places=np.insert(places, 0, 0.0, axis=1)[:, points])
    one = replace(small_stage().acts[0], bodies=(body,))
    seen = Visit(chromium, write_stage(small_stage(acts=(one,), links=1000), tmp_path), reduced_motion="reduce")
    seen.set_time(2.0)
    assert len(places_of(seen, [0x00, 0x72, 0xB2])[0]) > 300
    assert seen.complaints == []
    seen.context.close()
