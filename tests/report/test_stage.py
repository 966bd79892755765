"""What a page holds: numbers as they were, to what a pixel can show; text as text; never too much of either."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from pendbench.report.stage.packing import json_text, packed_stage
from pendbench.report.stage.page import stage_page, subtitle
from pendbench.report.stage.records import Body, Curve
from pendbench.report.stage.thinning import curve_drawn, moments_drawn, points_drawn
from support.browser import act, small_stage


def unpacked(body):
    places = np.frombuffer(base64.b64decode(body["places"]), "<i2").reshape(-1, body["points"], 2)
    return np.frombuffer(base64.b64decode(body["t"]), "<f8"), places * (body["reach"] / 32767)


def test_places_are_kept_to_a_sixty_thousandth_of_the_length():
    stage = small_stage()
    body = stage.acts[0].bodies[0]
    t, places = unpacked(packed_stage(stage)["acts"][0]["bodies"][0])
    assert (t == body.t).all()
    assert np.abs(places - body.places).max() <= 0.5 * 1.0 / 32767 * (1 + 1e-9)


def test_a_place_beyond_the_length_is_kept_too():
    far = Body(np.zeros(1), np.array([[[0.0, 0.0], [3.0, -4.0]]]), "#000000")
    stage = small_stage(acts=(replace(act("a", "#000000", 1.0), bodies=(far,)),))
    _, places = unpacked(packed_stage(stage)["acts"][0]["bodies"][0])
    assert np.allclose(places, far.places, atol=1e-4)


def test_what_a_logarithm_cannot_show_is_not_in_a_curve():
    curve = Curve(np.arange(4.0), np.array([np.nan, -1e-3, np.inf, 0.0]))
    stage = small_stage(acts=(replace(act("a", "#000000", 1.0), error=curve),))
    values = np.frombuffer(base64.b64decode(packed_stage(stage)["acts"][0]["error"]["values"]), "<f4")
    assert np.allclose(values, [0.0, 1e-3, 1e30, 0.0])


@pytest.mark.parametrize("text", ["</script>", "<!--", "]]>", "&amp;", "\u2028"])
def test_no_text_ends_the_script_that_holds_it(text):
    held = json_text({"a": text})
    assert json.loads(held) == {"a": text}
    assert not re.search(r"[<>&]", held)


def test_the_page_says_what_it_may_do_and_names_no_other_file():
    page = stage_page(small_stage())
    assert "default-src 'none'" in page
    assert not re.search(r"(?:src|href)\s*=", page)
    assert "http" not in page.replace("http-equiv", "")


def test_the_same_stage_is_the_same_page():
    assert stage_page(small_stage()) == stage_page(small_stage())


@pytest.mark.parametrize(("n", "bodies"), [(1, 1), (2, 6), (100, 6), (1000, 2), (10_000, 6), (2, 1000)])
def test_a_page_stays_below_three_megabytes(n, bodies):
    """What is drawn of 5000 samples of so many chains, with ten times as much for curves as five engines have."""
    points = points_drawn(n)
    moments = moments_drawn(5000, len(points), bodies)
    raw = bodies * len(moments) * (4 * len(points) + 8)
    assert raw * 4 / 3 < 2_600_000
    assert len(moments) >= 50


def test_both_ends_are_drawn_and_what_is_short_is_drawn_whole():
    assert points_drawn(2).tolist() == [0, 1, 2]
    assert points_drawn(10_000)[[0, -1]].tolist() == [0, 10_000]
    assert moments_drawn(100, 3, 2).tolist() == list(range(100))
    assert moments_drawn(1, 3, 2).tolist() == [0]
    assert len(moments_drawn(0, 3, 2)) <= 1


def test_a_thinned_curve_keeps_its_peaks():
    values = np.full(100_000, 1e-3)
    values[77_777], values[3] = 5.0, 1e-9
    kept = curve_drawn(values)
    assert len(kept) < 2000
    assert {77_777, 3, 0, 99_999} <= set(kept.tolist())


def test_the_subtitle_says_how_far_the_truth_is_known():
    assert subtitle(small_stage()) == "2 links, 1 m, 4 s. The ghost is the truth, known for 3 s."
    assert subtitle(small_stage(truth=None)) == "2 links, 1 m, 4 s"
