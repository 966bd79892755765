"""What is in a folder of reports: a page with a line for each, made of what their own pages say of themselves."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Final
from urllib.parse import quote

from pendbench.base.files import write_whole
from pendbench.report.html_page import page_of

_HEAD: Final = 20_000  # characters of a page that hold its title and its answer
_TITLE: Final = re.compile(r"<title>(.*?)</title>", re.DOTALL)
_ANSWER: Final = re.compile(r'<meta name="description" content="(.*?)">', re.DOTALL)


@dataclass(frozen=True)
class Entry:
    """A report of the folder: its name, where it is, its title and its answer."""

    name: str
    link: str
    title: str
    answer: str


def write_index(folder: Path) -> None:
    """Write index.html into a folder whose folders hold reports."""
    page = page_of("index.html.j2", title="Studies", entries=list(_entries(folder)))
    write_whole(folder / "index.html", lambda file: file.write(page.encode()))


def _entries(folder: Path) -> Iterator[Entry]:
    for path in sorted(folder.glob("*/report.html")):
        with path.open(encoding="utf-8", errors="replace") as page:
            head = page.read(_HEAD)
        name = path.parent.name
        yield Entry(name, f"{quote(name)}/report.html", _found(_TITLE, head) or name, _found(_ANSWER, head))


def _found(pattern: re.Pattern[str], text: str) -> str:
    found = pattern.search(text)
    return unescape(found[1]) if found else ""
