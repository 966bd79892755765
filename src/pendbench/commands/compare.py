"""`pendbench compare`: what got better or worse between two folders of results, or two gates."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

from pendbench.base.errors import InputError, printable
from pendbench.commands.shell import OK, REGRESSION, say

if TYPE_CHECKING:
    from pendbench.commands.comparing import Comparison

_MOST_LINES: Final = 40


def add_options(options: argparse.ArgumentParser) -> None:
    """What the command takes."""
    options.add_argument("a", metavar="A", help="a folder of results, or of several runs; or the JSON of a gate")
    options.add_argument("b", metavar="B", help="what it is compared with")
    options.add_argument("--out", metavar="DIR", help="write compare.md and compare.html into this folder")


def run(chosen: argparse.Namespace) -> int:
    """Do what was chosen, and return the exit code."""
    from pendbench.commands.comparing import compare

    if chosen.out == "":
        raise InputError("--out is empty; allowed: a folder")
    found = compare(chosen.a, chosen.b)
    if chosen.out is not None:
        found.save(chosen.out)
    say(*_lines(found), found.answer)
    if chosen.out is not None:
        say(f"Written: {chosen.out}/compare.md, {chosen.out}/compare.html")
    return REGRESSION if found.worse or found.lost else OK


def _lines(found: Comparison) -> list[str]:
    """What was lost, what got worse and what better, as many as a terminal can hold."""
    from pendbench.commands.comparing import line_of

    lost = (f"lost: {each}: only in {found.a}" for each in found.lost)
    lines = [*map(printable, lost), *(printable(line_of(each)) for each in (*found.worse, *found.better))]
    more = len(lines) - _MOST_LINES
    return lines if more <= 0 else [*lines[:_MOST_LINES], f"and {more} more"]
