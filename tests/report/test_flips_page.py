"""The map of flips in a browser: its own small integrator agrees with ours, and every part of the page works."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

import pendbench as pb
from pendbench.commands.flips import flip_stage
from pendbench.report.stage.page import flips_page
from pendbench.scene.scene import load_scene
from support.browser import Visit, browser

SIZE = 16


@pytest.fixture(scope="module")
def uneven():
    """Unequal masses and lengths, so that none of them can stand for another."""
    return pb.Scene("uneven", "Uneven", 3.0, [0.7, 0.4], [0.6, 0.3], [2.5, -1.0], [0.0, 0.0], {"gravity": 9.81})


@pytest.fixture(scope="module")
def stage(uneven):
    return flip_stage(uneven, SIZE)


@pytest.fixture(scope="module")
def chromium():
    with browser() as opened:
        yield opened


@pytest.fixture
def visit(chromium, stage, tmp_path):
    path = tmp_path / "flips.html"
    path.write_text(flips_page(stage), "utf-8")
    seen = Visit(chromium, path, reduced_motion="reduce")
    yield seen
    assert seen.complaints == []
    assert len(seen.requests) == 1
    seen.context.close()


def test_the_page_moves_as_our_engine_does(visit, uneven):
    """RK4 at 1 ms over a second: its error is some 1e-8 rad here, and that of a wrong term would be 1."""
    found = visit.page.evaluate(
        "() => { const state = Float64Array.of(2.5, -1, 0, 0);"
        "for (let i = 0; i < 1000; i += 1) pendbench.map.pendulum.step(state, 1e-3); return [...state]; }"
    )
    run = pb.simulate(uneven, times=[1.0])
    assert np.allclose(found, [*run.theta[0], *run.omega[0]], atol=1e-6)
    other = pb.simulate(uneven, method="rk4", dt=1e-3, times=[1.0])
    assert np.allclose(found, [*other.theta[0], *other.omega[0]], atol=1e-10)  # the same method: but for rounding


def test_the_page_finds_the_flips_that_we_find(visit, uneven):
    """Early flips, before chaos makes anything of the step: to a hundredth of it, by a line through two samples."""
    starts = np.array([[2.8, 2.0], [2.2, -2.9], [-3.0, 1.0], [0.2, 0.3], [1.9, 3.1]])
    ours = pb.first_flips(uneven, starts)
    find = "([a, b]) => { const t = pendbench.map.pendulum.firstFlip(a, b, 3, 1 / 400); return t < 1e9 ? t : 1e9; }"
    theirs = [visit.page.evaluate(find, start.tolist()) for start in starts]
    early = ours < 1.5
    assert early.sum() >= 3
    assert np.allclose(np.array(theirs)[early], ours[early], atol=1e-4)
    assert (np.array(theirs) == 1e9).tolist() == np.isinf(ours).tolist()


def test_the_map_in_the_page_is_ours(visit, stage):
    angle = partial(lambda i: (2 * i + 1 - SIZE) * math.pi / SIZE)
    pairs = [(row, column) for row in range(SIZE) for column in range(0, SIZE, 3)]
    ask = "(pairs) => pairs.map(([a, b]) => { const t = pendbench.map.timeAt(a, b); return t < 1e9 ? t : 1e9; })"
    found = visit.page.evaluate(ask, [[angle(row), angle(column)] for row, column in pairs])
    expected = [min(stage.times[pair], 1e9) for pair in pairs]
    assert np.allclose(found, expected, atol=3.0 / 65534)


def test_a_click_starts_the_pendulum_of_that_point(visit):
    box = visit.page.locator("#map").bounding_box()
    visit.page.locator("#map").click(position={"x": 0.75 * box["width"], "y": 0.4 * box["height"]})
    state = visit.page.evaluate("() => [...pendbench.swing.state]")
    assert state[:2] == pytest.approx([2 * math.pi * 0.1, math.pi * 0.5], abs=0.02)
    assert "θ₁ = 0.6" in visit.page.locator("#chosen").text_content()


def test_zooming_computes_what_is_finer_and_home_shows_all(visit):
    visit.page.get_by_role("button", name="Zoom in").click()
    visit.page.get_by_role("button", name="Zoom in").click()
    assert visit.page.evaluate("() => pendbench.map.view.span") == pytest.approx(math.pi / 2)
    visit.page.wait_for_function("() => pendbench.map.queue.next > 200")
    wrong = visit.page.evaluate(
        "() => { const m = pendbench.map, [one, two] = m.anglesAt(8 / 240, 8 / 240);"
        "return Math.abs(m.known[0] - m.pendulum.firstFlip(one, two, 3, 1 / 400)) > 0; }"
    )
    assert not wrong
    visit.page.get_by_role("button", name="all of it").click()
    assert visit.page.evaluate("() => [pendbench.map.view.span, pendbench.map.queue]") == [2 * math.pi, None]


def test_keys_move_and_zoom(visit):
    visit.page.locator("#map").focus()
    for key in ("+", "ArrowRight", "ArrowUp"):
        visit.page.keyboard.press(key)
    view = visit.page.evaluate("() => pendbench.map.view")
    assert view == pytest.approx({"x": 0.1 * math.pi, "y": 0.1 * math.pi, "span": math.pi})
    visit.page.keyboard.press("Enter")
    assert visit.page.evaluate("() => pendbench.map.chosen") == pytest.approx([0.1 * math.pi] * 2)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_checker_of_accessibility_finds_nothing_serious(chromium, stage, tmp_path, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    (tmp_path / "flips.html").write_text(flips_page(stage), "utf-8")
    seen = Visit(chromium, tmp_path / "flips.html", color_scheme=scheme, bypass_csp=True, reduced_motion="reduce")
    found = axe.Axe().run(seen.page).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"]) for each in found if each["impact"] in ("serious", "critical")] == []
    seen.context.close()


def test_only_a_double_pendulum_under_gravity_has_a_map():
    for name in ("single", "damped_double"):
        with pytest.raises(pb.InputError, match="two point masses under gravity"):
            flip_stage(load_scene(name))
