"""The report for a browser: it says what the Markdown says, and what it holds does nothing but be read."""

from __future__ import annotations

import re
from types import SimpleNamespace

import pytest
from markdown_it import MarkdownIt

from pendbench.report.html_page import html_page
from pendbench.report.index import write_index
from pendbench.report.write import write_report
from support.browser import Visit, browser, small_stage
from support.report_data import HOSTILE, report

SHORT = """# A title & more

Said before.

## The answer

One, then **two**.

| engine | e max |
| --- | ---: |
| ours | 1.0e-9 |
| theirs | 0.2 |
| nobody's | \u2013 |
| mine | 3.0e-4 |

![plot](plots/plot.png)

## Appendix: what it means

More.
"""


#: Stands for one that is drawn.
PLOT = SimpleNamespace(png=b"png", chart=None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("report")
    write_report(report(), out)
    return out


@pytest.fixture(scope="module")
def chromium():
    with browser() as opened:
        yield opened


@pytest.fixture
def visit(chromium, tmp_path):
    path = tmp_path / "report.html"
    path.write_text(html_page(SHORT, "One, then two.", {"plots/plot.png": PLOT}), "utf-8")
    seen = Visit(chromium, path)
    yield seen
    assert seen.complaints == []
    seen.context.close()


def texts(markdown):
    """All that a reader of the Markdown sees of it, word by word."""
    tokens = MarkdownIt("commonmark").enable("table").parse(markdown)
    inside = [child for token in tokens for child in token.children or ()]
    return " ".join(child.content for child in inside if child.type in ("text", "code_inline")).split()


def test_it_says_all_that_the_markdown_says_in_the_same_order(folder):
    html = (folder / "report.html").read_text("utf-8")
    body = re.sub(r"<(script|button).*?</\1>", "", html[html.index("<h1>") :], flags=re.DOTALL)
    shown = re.sub(r"<[^>]*>", " ", body)
    for escape, letter in (
        ("&lt;", "<"),
        ("&gt;", ">"),
        ("&quot;", '"'),
        ("&#34;", '"'),
        ("&#39;", "'"),
        ("&amp;", "&"),
    ):
        shown = shown.replace(escape, letter)
    assert "".join(shown.split()) == "".join(texts((folder / "report.md").read_text("utf-8")))


def test_pictures_are_inside_and_nothing_is_asked_for(folder):
    html = (folder / "report.html").read_text("utf-8")
    pictures = re.findall(r'<img src="([^"]*)"', html)
    assert len(pictures) >= 3
    assert all(source.startswith("data:image/png;base64,") for source in pictures)
    assert not re.search(r"<link|<a |<iframe|@import", html)


def test_appendices_are_folded_and_the_answer_is_not(visit):
    assert visit.page.get_by_role("heading", name="The answer").is_visible()
    assert visit.page.get_by_text("More.").is_hidden()
    visit.page.get_by_text("Appendix: what it means").click()
    assert visit.page.get_by_text("More.").is_visible()
    assert visit.page.title() == "A title & more"
    assert visit.page.locator("meta[name=description]").get_attribute("content") == "One, then two."


def rows(visit):
    return [row.locator("td").first.text_content() for row in visit.page.locator("tbody tr:visible").all()]


def test_tables_sort_by_numbers_and_what_is_none_comes_last(visit):
    heading = visit.page.get_by_role("button", name="e max")
    heading.click()
    assert rows(visit) == ["ours", "mine", "theirs", "nobody's"]
    assert visit.page.locator("th[aria-sort=ascending]").text_content() == "e max"
    heading.click()
    assert rows(visit) == ["theirs", "mine", "ours", "nobody's"]
    visit.page.get_by_role("button", name="engine").click()
    assert rows(visit) == ["mine", "nobody's", "ours", "theirs"]


def test_a_hostile_study_runs_nothing_and_long_tables_filter(chromium, folder):
    seen = Visit(chromium, folder / "report.html")
    assert HOSTILE.split()[0] in seen.page.locator("h1").text_content()
    assert seen.complaints == []
    assert [url for url in seen.requests if not url.startswith("data:")] == [(folder / "report.html").as_uri()]
    filters = seen.page.locator(".filter input")
    assert filters.count() >= 1
    table = seen.page.locator(".filter + .rows").first
    before = table.locator("tbody tr:visible").count()
    filters.first.fill("ours rk4")
    left = table.locator("tbody tr:visible")
    assert 0 < left.count() < before
    assert all("ours" in text for text in left.all_text_contents())
    seen.context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_checker_of_accessibility_finds_nothing_serious(chromium, folder, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    seen = Visit(chromium, folder / "report.html", color_scheme=scheme, bypass_csp=True)
    found = axe.Axe().run(seen.page).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"]) for each in found if each["impact"] in ("serious", "critical")] == []
    seen.context.close()


def test_it_fits_a_phone(chromium, folder):
    seen = Visit(chromium, folder / "report.html", viewport={"width": 360, "height": 740})
    assert seen.page.evaluate("() => document.documentElement.scrollWidth") <= 360
    seen.context.close()


def test_an_index_lists_the_reports_of_a_folder(chromium, folder, tmp_path):
    (tmp_path / "a b").mkdir()
    (tmp_path / "a b" / "report.html").write_bytes((folder / "report.html").read_bytes())
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "report.html").write_bytes(b"\xff<title>")
    write_index(tmp_path)
    seen = Visit(chromium, tmp_path / "index.html")
    assert HOSTILE.split()[0] in seen.page.locator("h2").first.text_content()
    assert seen.page.locator("h2").nth(1).text_content() == "broken"
    assert seen.complaints == []
    seen.page.locator("h2 a").first.click()
    assert seen.page.get_by_role("heading", name="The answer").is_visible()
    seen.context.close()


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    path = tmp_path_factory.mktemp("moving") / "report.html"
    path.write_text(html_page(SHORT, "One, then two.", {"plots/plot.png": PLOT}, small_stage()), "utf-8")
    return path


def test_what_moves_in_a_report_waits_to_be_asked_and_leaves_the_keys_to_the_page(chromium, moving):
    seen = Visit(chromium, moving)
    seen.page.get_by_role("heading", name="The answer").click()
    seen.page.keyboard.press("Space")
    seen.settle()
    assert seen.time() == 0.0
    seen.page.get_by_role("button", name="Play").click()
    seen.page.wait_for_function("() => pendbench.clock.time > 0.1")
    seen.page.locator("#time").focus()
    seen.page.keyboard.press("End")
    seen.settle()
    assert seen.time() == 4.0
    assert seen.complaints == []
    assert len(seen.requests) == 1
    seen.page.emulate_media(media="print")
    assert seen.page.locator("#motion").is_hidden()
    seen.context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_checker_of_accessibility_finds_nothing_serious_in_what_moves(chromium, moving, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    seen = Visit(chromium, moving, color_scheme=scheme, bypass_csp=True, viewport={"width": 360, "height": 740})
    found = axe.Axe().run(seen.page).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"]) for each in found if each["impact"] in ("serious", "critical")] == []
    assert seen.page.evaluate("() => document.documentElement.scrollWidth") <= 360
    seen.context.close()
