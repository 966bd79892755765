"""The league's tables in docs/league.md, from a folder of results.

``python -m pendbench.commands.league_page results/league DATE`` writes them again, below the working folder, with the
date as it is given, the versions and the machine.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any, Final

from pendbench.base.errors import InputError

_BEGINS, _ENDS = "<!-- tables -->\n", "<!-- end of tables -->"
_CHALLENGE: Final = re.compile(r"^### (\S+)\n\n((?:\|.*\n)+)", re.MULTILINE)
_MACHINE: Final = (
    "processor",
    "logical processors",
    "worker processes",
    "operating system",
    "python",
    "numpy",
    "scipy",
)


def tables_of(folder: Path, date: str) -> str:
    """What a league found, as Markdown. Raises InputError for a folder without its report."""
    try:
        report = (folder / "report.md").read_text("utf-8")
        facts: dict[str, Any] = json.loads((folder / "provenance.json").read_text("utf-8"))
    except (OSError, ValueError):
        raise InputError(f"{folder}: no report of a study; allowed: the folder of a league's results") from None
    if facts.get("kind") != "league":
        raise InputError(f"{folder}: a study of kind {facts.get('kind')!r}; allowed: the folder of a league's results")
    here, *others = _grids(report)
    parts = [f"{date}, {'the quick variant' if facts['quick'] else 'in full'}. All engines:", here]
    if "## Without our own engine" in report:
        parts += ["Without our own:", others[0]]
    for scene, grid in _CHALLENGE.findall(report):
        parts += [f"The Pendulum Challenge, scene `{scene}`:", grid.rstrip()]
    return "\n\n".join([*parts, *_sources(facts)]) + "\n"


def _grids(report: str) -> list[str]:
    """The report's tables, in their order."""
    lines = report.splitlines()
    return ["\n".join(own) for is_row, own in groupby(lines, lambda line: line.startswith("|")) if is_row]


def _sources(facts: dict[str, Any]) -> Iterator[str]:
    engines = {key.removeprefix("engine "): value for key, value in facts.items() if key.startswith("engine ")}
    here = {name: version for name, version in engines.items() if not version.startswith("left out")}
    yield f"Versions: {', '.join(f'{name} {version}' for name, version in here.items())}."
    if gone := [name for name in engines if name not in here]:
        yield f"Not there: {', '.join(gone)}."
    yield f"Machine: {', '.join(f'{name} {facts[name]}' for name in _MACHINE if name in facts)}."


def with_tables(page: str, folder: Path, date: str) -> str:
    """The page with the tables in their place."""
    before, _, rest = page.partition(_BEGINS)
    _, _, after = rest.partition(_ENDS)
    return f"{before}{_BEGINS}{tables_of(folder, date)}{_ENDS}{after}"


def main() -> None:
    """Write them into docs/league.md, below the working folder."""
    page = Path("docs/league.md")
    try:
        if len(sys.argv) != 3:
            raise InputError("league_page needs the folder of a league's results and the date")
        text = with_tables(page.read_text("utf-8"), Path(sys.argv[1]), sys.argv[2])
    except InputError as error:
        sys.exit(f"error: {error}")
    page.write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
