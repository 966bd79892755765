"""Pages that are one file: what a browser may run and show is named by its hash, and nothing else is allowed."""

from __future__ import annotations

import base64
import hashlib
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup


@dataclass(frozen=True)
class Inline:
    """A style or a script that stands in a page. hash: what a Content-Security-Policy knows it by."""

    text: Markup
    hash: str


def inline(*files: Path, before: str = "") -> Inline:
    """These files, one after the other, as an element's content. They are ours, so nothing in them is escaped."""
    text = before + "\n".join(file.read_text("utf-8") for file in files)
    return Inline(Markup(text), base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii"))
