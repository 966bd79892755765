"""`pendbench history`: what releases of an engine changed, each run in an environment of its own."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendbench.base.errors import InputError
from pendbench.commands.completing import scene_names
from pendbench.commands.shell import OK, REGRESSION, names, say

if TYPE_CHECKING:
    from pendbench.commands.releases import Asked

_SCENES: Final = "double,heavy_tip,chain10"
_VERSION: Final = re.compile(r"[0-9A-Za-z][0-9A-Za-z.!+_-]{0,60}")
_MOST_VERSIONS: Final = 64
_MOST_ROUNDS: Final = 50


def add_options(options: argparse.ArgumentParser) -> None:
    """What the command takes."""
    options.add_argument("engine", metavar="ENGINE", help="an engine's name")
    options.add_argument("--versions", required=True, metavar="A,B", help="releases, the earliest first")
    scenes = options.add_argument("--scenes", default=_SCENES, metavar="A,B.toml", help=f"scenes ({_SCENES})")
    scenes.completer = scene_names  # type: ignore[attr-defined]
    options.add_argument("--rounds", type=int, default=3, metavar="N", help="of the clock over all releases (3)")
    options.add_argument("--out", metavar="DIR", help="folder for the report (default: results/history-ENGINE)")


def run(chosen: argparse.Namespace) -> int:
    """Do what was chosen, and return the exit code."""
    from pendbench.base.files import alone_in
    from pendbench.commands.history_record import History
    from pendbench.commands.progress import StageBars
    from pendbench.commands.releases import run_releases

    asked = _asked(chosen)
    with StageBars() as bars:
        _make(asked.out)
        with alone_in(asked.out, lambda: bars.begin("waiting for another history in this folder", 1, 0)):
            found = History(asked.engine, run_releases(asked, bars), asked.rounds)
            found.save(asked.out)
    say(*found.lines, found.answer, f"Report: {asked.out / 'report.md'}")
    return OK if found.measured else REGRESSION


def _asked(chosen: argparse.Namespace) -> Asked:
    from pendbench.commands.releases import Asked
    from pendbench.engines.registry import packages

    versions = names("--versions", chosen.versions, "versions")
    for at, version in enumerate(versions):
        if not _VERSION.fullmatch(version):
            raise InputError(f"--versions has {version[:60]!r}; allowed: versions such as 3.2.0, separated by commas")
        if version in versions[:at]:
            raise InputError(f"--versions has {version} twice; allowed: each once")
    if not 2 <= len(versions) <= _MOST_VERSIONS:
        raise InputError(f"--versions has {len(versions)}; allowed: 2 to {_MOST_VERSIONS}")
    if not 1 <= chosen.rounds <= _MOST_ROUNDS:
        raise InputError(f"--rounds is {chosen.rounds}; allowed: 1 to {_MOST_ROUNDS}")
    if chosen.out == "":
        raise InputError("--out is empty; allowed: a folder that can be written")
    packages(chosen.engine)  # an engine that there is not is said before a folder is made
    out = Path(chosen.out or Path("results") / f"history-{chosen.engine}").absolute()
    scenes = tuple(dict.fromkeys(names("--scenes", chosen.scenes, "names of scenes and files")))
    return Asked(chosen.engine, versions, scenes, chosen.rounds, out)


def _make(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: {error.strerror}; allowed: a folder that can be written") from None
