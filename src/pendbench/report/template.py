"""Pages from templates: facts come from Python, sentences stand in the template."""

from __future__ import annotations

import re
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import jinja2

from pendbench.base.errors import printable
from pendbench.report import numbers, sections
from pendbench.report.names import case_name, pair_name
from pendbench.report.start import turns_at_start
from pendbench.report.tables import markdown_table
from pendbench.report.text import Safe, code, counted, listed, markdown

_PACKAGE: Final = Path(__file__).resolve().parents[1]
_FOLDERS: Final = (_PACKAGE / "report" / "templates", _PACKAGE / "kinds")


def _as_markdown(value: Any) -> str:
    """Whatever a template writes is text that Markdown shows as it is, but for what is Markdown already."""
    return value if isinstance(value, Safe) else markdown(value, 2000)


def _as_plain(value: Any) -> str:
    return printable(str(value))


@cache
def _environment(plain: bool) -> jinja2.Environment:
    made = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_FOLDERS),
        undefined=jinja2.StrictUndefined,
        finalize=_as_plain if plain else _as_markdown,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # finalize makes text safe, for Markdown and not for HTML
        extensions=["jinja2.ext.do", "jinja2.ext.loopcontrols"],
    )
    made.filters |= {
        "number": numbers.number_text,
        "duration": numbers.duration_text,
        "times": numbers.times_text,
        "listed": lambda words, joint="and": listed([str(word) for word in words], joint),
        "case": case_name,
        "code": str if plain else code,
        "pair": pair_name,
        "turns": turns_at_start,
    }
    made.globals |= {
        "counted": counted,
        "table": markdown_table,
        **{name: getattr(sections, name) for name in sections.PARTS},
    }
    return made


def render(name: str, facts: dict[str, Any]) -> str:
    """A whole page. name: of the template, as in ``effects/page.md.j2``."""
    page = _environment(plain=False).get_template(name).render(facts)
    return re.sub(r"\n{3,}", "\n\n", page)  # a part that says nothing leaves no gap


def render_block(name: str, block: str, facts: dict[str, Any]) -> str:
    """One block of a page as plain text, on one line."""
    template = _environment(plain=True).get_template(name)
    found = partial(template.new_context, facts)()
    return " ".join("".join(template.blocks[block](found)).split())
