"""Text from files, engines and machines, made safe for Markdown, for spreadsheets and for plots."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any, Final

from pendbench.base.errors import printable

# What a spreadsheet takes for the beginning of a formula, in the widths in which it can be typed.
_FORMULA: Final = tuple("=+-@|%\uff1d\uff0b\uff0d\uff20")
_LONGEST: Final = 240
_LAST_GLYPH: Final = "\u052f"  # Latin, Greek and Cyrillic: what every copy of the plots' font can draw


class Safe(str):
    """Text that is Markdown already: a template leaves it as it is."""

    __slots__ = ()


def clipped(text: str, longest: int = _LONGEST) -> str:
    """The text, and no more than `longest` characters of it."""
    return text if len(text) <= longest else text[: longest - 1] + "…"


def markdown(text: Any, longest: int = _LONGEST) -> Safe:
    """Any text on one line, such that Markdown shows it and does nothing else with it, in a table as well.

    What is Markdown already stays as it is.
    """
    if isinstance(text, Safe):
        return text
    line = clipped(printable(str(text)), longest)
    line = line.replace("&", "&amp;").replace("\\", "\\\\")
    line = re.sub(r"([`*\[\]|~$#])", r"\\\1", line).replace("<", "&lt;").replace(">", "&gt;")
    line = re.sub(r"(?<![0-9A-Za-z])_|_(?![0-9A-Za-z])", r"\\_", line)  # inside a word it stands for itself
    return Safe(line.replace("://", "\\://").replace("www.", "www\\."))  # no link that nobody meant


def code(text: Any, longest: int = _LONGEST) -> Safe:
    """Any text on one line as Markdown's code, to be copied as it is; as other text where it has backticks itself."""
    line = clipped(printable(str(text)), longest)
    return markdown(line) if "`" in line or not line.strip() else Safe(f"`{line}`")


def spreadsheet(text: str) -> str:
    """Any text for a cell of a CSV file: on one line, and never a formula."""
    line = printable(text)
    return f"'{line}" if text.lstrip().startswith(_FORMULA) else line


def label(text: Any, longest: int = 40) -> str:
    """Any text for a plot: no formulas, no glyphs that the font may lack, and not hidden from the legend."""
    line = clipped(printable(str(text)), longest).replace("…", "...")
    line = "".join(c if c <= _LAST_GLYPH else "?" for c in line).replace("$", r"\$")
    return f" {line}" if line.startswith("_") else line


def file_name(text: str, taken: Iterable[str] = ()) -> str:
    """A name for a file, of letters, digits and `_-` only, that is not among those `taken`."""
    used = {name.lower() for name in taken}
    stem = re.sub(r"[^0-9A-Za-z_-]+", "_", text)[:60] or "_"
    name, number = stem, 1
    while name.lower() in used:
        number += 1
        name = f"{stem}_{number}"
    return name


def grid(headings: Sequence[str], rows: Iterable[Sequence[str]], numbers: Iterable[int] = ()) -> Safe:
    """A Markdown table of cells that are safe already. numbers: the columns that are aligned to the right."""
    right = set(numbers)
    rule = ["---:" if i in right else "---" for i in range(len(headings))]
    return Safe("\n".join("| " + " | ".join(cells) + " |" for cells in (headings, rule, *rows)))


def listed(words: Sequence[str], joint: str = "and") -> str:
    """``a, b and c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {joint} {words[-1]}" if words else "none"


def counted(number: int, one: str, many: str = "") -> str:
    """``1 case``, ``2 cases``."""
    return f"{number} {one if number == 1 else many or one + 's'}"
