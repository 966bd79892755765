"""Reports, tables and figures as a reader's program sees them."""

from __future__ import annotations

import io
import itertools
import re

from markdown_it import MarkdownIt
from rich.console import Console

PNG = b"\x89PNG\r\n\x1a\n"


def cells_of(markdown_text: str) -> list[list[str]]:
    """The plain text of every cell of every table, by row, as a Markdown parser sees it."""
    rows: list[list[str]] = []
    for token in MarkdownIt("commonmark").enable("table").parse(markdown_text):
        if token.type == "tr_open":
            rows.append([])
        if token.type == "inline" and token.level >= 4:
            assert all(child.type in ("text", "strong_open", "strong_close", "text_special", "code_inline", "image")
                       for child in token.children), token.children  # fmt: skip
            rows[-1].append("".join(child.content for child in token.children))
    return rows


def section(page: str, heading: str) -> str:
    """What stands under one heading."""
    return re.split(r"^## ", page.split(f"## {heading}\n", 1)[1], maxsplit=1, flags=re.MULTILINE)[0]


def render(table_or_text) -> str:
    console = Console(width=200, file=io.StringIO(), color_system=None)
    console.print(table_or_text)
    return console.file.getvalue()


def texts_of(figure):
    """The words in a figure with their places, without the numbers at the axes."""
    ticks = {text for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for text in axis.get_ticklabels()}
    inside = {text for axes in figure.axes for text in axes.texts}  # drawn upon curves on purpose
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    texts = [*figure.texts, figure._suptitle, figure._supylabel]
    texts += [text for axes in figure.axes for text in (axes.title, axes.xaxis.label, axes.yaxis.label)]
    texts += [text for legend in legends for text in legend.get_texts()]
    chosen = dict.fromkeys(text for text in texts if text is not None and text.get_text())
    return [(text.get_text(), text.get_window_extent()) for text in chosen if text not in ticks | inside]


def tables_of(markdown_text: str) -> list[list[dict[str, str]]]:
    """Every table: its rows as a reader sees them, each cell by its column's heading."""
    blocks = re.findall(r"(?:^\|.*\n?)+", markdown_text, flags=re.MULTILINE)
    grids = [cells_of(block) for block in blocks]
    return [[dict(zip(heads, cells, strict=True)) for cells in rows] for heads, *rows in grids]


def assert_words_apart(figures):
    """That no word of the figures, by name, is cut off or lies upon another."""
    for name, figure in figures.items():
        found = texts_of(figure)
        assert len(found) > 5
        for text, box in found:
            inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
            assert inside, f"{name}: {text!r} at {box}"
        for (one, its), (other, others) in itertools.combinations(found, 2):
            assert not its.padded(-1).overlaps(others.padded(-1)), f"{name}: {one!r} and {other!r}"
