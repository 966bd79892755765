"""Templates: facts become sentences, and no text from elsewhere becomes Markdown."""

from __future__ import annotations

import jinja2
import pytest

from pendbench.report import template
from pendbench.report.text import Safe

HOSTILE = "<script>alert(1)</script> | [a](http://b) `c` *d* # e"


@pytest.fixture
def rendered(tmp_path, monkeypatch):
    """Render a template of the test's own."""
    monkeypatch.setattr(template, "_FOLDERS", (tmp_path,))
    template._environment.cache_clear()

    def render(text, block="", **facts):
        (tmp_path / "page.md.j2").write_text(text)
        return template.render_block("page.md.j2", block, facts) if block else template.render("page.md.j2", facts)

    yield render
    template._environment.cache_clear()


def test_text_from_elsewhere_is_shown_and_does_nothing(rendered):
    page = rendered("{{ name }} {% for each in names %}{{ each }}{% endfor %}", name=HOSTILE, names=[HOSTILE])
    assert "<" not in page
    assert "[a]" not in page
    assert "http://" not in page
    assert page.count("\\|") == 2


def test_what_is_markdown_already_stays_as_it_is(rendered):
    assert rendered("{{ name }}", name=Safe("| a | b |")) == "| a | b |"


def test_numbers_are_formatted_in_one_place(rendered):
    assert rendered("{{ 1234.5|number }} {{ 0.0021|duration }} {{ 3.14159|times }}") == "1230 2.1 ms 3.1\u00d7"


def test_a_fact_that_is_not_there_is_an_error(rendered):
    with pytest.raises(jinja2.UndefinedError):
        rendered("{{ nobody_said_this }}")


def test_an_answer_is_plain_text_on_one_line(rendered):
    text = "# {{ a }}\n{% block answer %}\n{{ a }}\nholds.\n{% endblock %}\nmore"
    assert rendered(text, "answer", a="heavy_tip [x] \x1b[31m") == "heavy_tip [x] \\x1b[31m holds."
