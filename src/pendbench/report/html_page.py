"""A study's report as a page for a browser: the same Markdown, so that it says the same, made to be looked through."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import jinja2
from markdown_it import MarkdownIt
from markupsafe import Markup

from pendbench.report.inline import Inline, inline
from pendbench.report.plots import Drawn
from pendbench.report.stage.packing import json_text, packed_chart, packed_stage
from pendbench.report.stage.page import FOLDER as STAGE
from pendbench.report.stage.page import REPORT as SCRIPTS
from pendbench.report.stage.page import subtitle
from pendbench.report.stage.records import Stage

_FOLDER: Final = Path(__file__).resolve().parent / "templates"
_FOLDED: Final = "Appendix"
_ANSWER: Final = "The answer"  # below it stands what moves
#: Of all lines of a page's plots together, and of each at least.
_POINTS: Final = 120_000
_FEWEST_POINTS: Final = 40


@dataclass(frozen=True)
class Part:
    """A section of the page. folded: whether it opens when it is asked for. name: for links to it."""

    heading: str
    name: str
    body: Markup
    folded: bool


def html_page(markdown: str, answer: str, pictures: Mapping[str, Drawn], stage: Stage | None = None) -> str:
    """The page. markdown: the report; answer: its first lines as plain text; pictures: what was drawn, by the paths of
    their PNGs in it; stage: what moves below the answer, where something does.
    """
    title, parts = _parts(markdown, pictures)
    charts = {path: drawn.chart for path, drawn in pictures.items() if drawn.chart is not None}
    lines = sum(len(panel.lines) for chart in charts.values() for panel in chart.panels)
    most = max(_FEWEST_POINTS, _POINTS // max(1, lines))
    place = next((place for place, part in enumerate(parts) if part.heading == _ANSWER), 0)
    moving = None if stage is None else packed_stage(stage)
    data = {"charts": {path: packed_chart(chart, most) for path, chart in charts.items()}, "stage": moving}
    return page_of("report.html.j2", title=title, answer=answer, parts=parts, stage=stage, place=place,
                   subtitle=stage and subtitle(stage), legend="run", data=Markup(json_text(data)))  # fmt: skip


def page_of(template: str, **facts: Any) -> str:
    """A page for a browser from a template of this room. Whatever the facts hold stays text."""
    return _environment().get_template(template).render(facts, style=_style(), script=_script())


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader((_FOLDER, STAGE)),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        trim_blocks=True,
    )


@cache
def _style() -> Inline:
    return inline(STAGE / "colours.css", _FOLDER / "report.css", STAGE / "stage.css", STAGE / "plot.css")


@cache
def _script() -> Inline:
    scripts = (*(STAGE / name for name in SCRIPTS), _FOLDER / "report.js")
    return inline(*scripts, before='"use strict";\n')


def _parts(markdown: str, pictures: Mapping[str, Drawn]) -> tuple[str, list[Part]]:
    """The title as plain text, and the parts; what stands before the first heading has none."""
    first, *sections = re.split(r"^## ", markdown, flags=re.MULTILINE)
    title, _, lead = first.partition("\n")
    said = [_part("", lead, pictures)] if lead.strip() else []
    for section in sections:
        heading, _, body = section.partition("\n")
        first, *details = re.split(r"^(?=### )", body, maxsplit=1, flags=re.MULTILINE)
        if heading.strip() != _ANSWER or not details:
            said.append(_part(heading, body, pictures))
            continue
        said += [_part(heading, first, pictures), *(_part("", more, pictures) for more in details)]
    return _plain(title.removeprefix("# ")), said


def _part(heading: str, body: str, pictures: Mapping[str, Drawn]) -> Part:
    text = _plain(heading)
    name = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
    return Part(text, name, _html(body, pictures), text.startswith(_FOLDED))


def _markdown() -> MarkdownIt:
    return MarkdownIt("commonmark", {"html": False}).enable("table")


def _plain(markdown: str) -> str:
    """A line of Markdown as plain text."""
    (inline_token,) = _markdown().parseInline(markdown.strip())
    return "".join(token.content for token in inline_token.children or ())


def _html(markdown: str, pictures: Mapping[str, Drawn]) -> Markup:
    """The HTML of some Markdown, in which nothing runs; a picture holds its own bytes."""
    parser = _markdown()
    tokens = parser.parse(markdown)
    for token in tokens:
        if token.attrs.pop("style", None) == "text-align:right":  # a page allows no styles but its own
            token.attrs["class"] = "number"
        for child in token.children or ():
            if child.type == "image":
                _hold(child.attrs, pictures)
    return Markup(parser.renderer.render(tokens, parser.options, {}))


def _hold(attributes: dict[str, str | int | float], pictures: Mapping[str, Drawn]) -> None:
    path = str(attributes["src"])
    drawn = pictures.get(path)
    if drawn is None:
        return
    attributes["src"] = f"data:image/png;base64,{base64.b64encode(drawn.png).decode('ascii')}"
    if drawn.chart is not None:
        attributes["data-plot"] = path
