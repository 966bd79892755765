"""`pendbench judge`: how far an engine can be trusted with your chain, and what to set."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendbench.commands.completing import scene_names
from pendbench.commands.shell import OK, WIDTH, names, number, say

if TYPE_CHECKING:
    import pandas as pd

    from pendbench.commands.run import Finished, Request
    from pendbench.scene.scene import Scene

_ERROR: Final = (1e-12, 0.5, "of the chain's length")
_UNTIL: Final = (1e-9, 1e9, "s")
_SHOWN: Final = ("engine", "method", "dt", "verdict", "error_max", "energy_error", "cost_s_per_s")


@dataclass(frozen=True)
class Judgement:
    """What was found about a chain. answer: in a few sentences. table: a pandas DataFrame, a row for each method with
    what is recommended, the best first. folder: where the report is.
    """

    answer: str
    table: pd.DataFrame
    folder: Path

    def _repr_html_(self) -> str:
        from html import escape

        report = escape(str(self.folder / "report.md"))
        return f"<p>{escape(self.answer)}</p>{self.table.to_html(index=False, na_rep='')}<p>Report: {report}</p>"


def judge(
    scene: Scene | str | os.PathLike[str],
    error: float = 1e-3,
    *,
    until: float | None = None,
    engines: str | Sequence[str] = (),
    out: str | os.PathLike[str] | None = None,
    jobs: int | None = None,
    fresh: bool = False,
) -> Judgement:
    """How far engines can be trusted with a chain, and what to set for an error.

    scene: a `Scene`, or what `load_scene` takes; a model file is run as it stands, too. error: in lengths of the chain.
    until: s, up to when; by default to the scene's end, or to where chaos makes small errors a thousand times larger.
    engines: only this one, or these; all that are installed by default. out: the report's folder, `results/judge-NAME`
    by default. jobs: worker processes. fresh: run again what an earlier run left in `out`. Scripts that call this need
    the usual `if __name__ == "__main__":` guard, since it starts processes.

    >>> import pendbench as pb
    >>> found = pb.judge("double", error=1e-3)  # doctest: +SKIP
    >>> found.answer, found.table  # doctest: +SKIP

    Raises InputError, one line, for whatever cannot be used.
    """
    from pendbench.commands.run import folder_of, names_of, run_request
    from pendbench.report.tables import data_frame

    others = {"out": folder_of(out), "jobs": jobs, "fresh": fresh}
    finished = run_request(_request(scene, error, until, names_of(engines), **others))
    return Judgement(finished.report.answer, data_frame(finished.report.tables["methods"]), finished.out)


def _request(
    scene: Scene | str | os.PathLike[str], error: float, until: float | None, engines: Sequence[str], **others: Any
) -> Request:
    """The study that is run. others: as in `Request`."""
    from pendbench.commands.run import Request
    from pendbench.scene.scene import scene_of

    known = scene_of(scene)
    changes = {
        "title": f"How far to trust an engine with {known.title}"[:200],
        "error": number("error", error, _ERROR),
    }
    if until is not None:
        changes["until"] = number("until", until, _UNTIL)
    if (path := _model_file(scene)) is not None:
        changes["file"] = path
    return Request("judge", engines=engines, scenes=(known,), changes=changes, **others)


def _model_file(scene: Scene | str | os.PathLike[str]) -> str | None:
    """The file that a scene is read from, where it is an engine's own."""
    if not isinstance(scene, str | os.PathLike):
        return None
    from pendbench.scene.toml_file import MODEL_FILES

    path = os.fsdecode(scene)
    return os.path.abspath(path) if path.lower().endswith(MODEL_FILES) else None


def add_options(options: argparse.ArgumentParser) -> None:
    """What the command takes."""
    scene = options.add_argument(
        "scene", metavar="FILE-or-SCENE", help="a model (.xml, .urdf), a scene (.toml) or its name"
    )
    scene.completer = scene_names  # type: ignore[attr-defined]
    options.add_argument("--error", type=float, default=1e-3, metavar="E", help="in lengths of the chain (1e-3)")
    options.add_argument("--until", type=float, metavar="S", help="up to when (default: while chaos lets one follow)")
    options.add_argument("--engines", metavar="A,B", help="only these engines (default: all that are installed)")
    options.add_argument("--out", metavar="DIR", help="folder for the report (default: results/judge-NAME)")
    options.add_argument("--jobs", type=int, metavar="N", help="worker processes (default: one per processor)")
    options.add_argument("--fresh", action="store_true", help="run again what is already in the folder")


def run(chosen: argparse.Namespace) -> int:
    """Do what was chosen, and return the exit code."""
    from pendbench.commands.progress import StageBars
    from pendbench.commands.run import folder_of, run_request

    out = folder_of(chosen.out)
    engines = names("--engines", chosen.engines, "names of engines")
    asked = _request(chosen.scene, chosen.error, chosen.until, engines, out=out, jobs=chosen.jobs, fresh=chosen.fresh)
    say(*_read(asked))
    with StageBars() as bars:
        finished = run_request(asked, bars)
    _tell(finished)
    return OK


def _read(asked: Request) -> list[str]:
    """What was understood of a scene or a model."""
    from pendbench.report.start import start_text
    from pendbench.scene.scene import scene_of

    scene = scene_of(asked.scenes[0])
    acting = ", ".join(scene.terms) or "nothing"
    links = f"{scene.n} link{'s' if scene.n > 1 else ''}"
    lines = [f"{scene.name}: {links}, {scene.total_length:.4g} m; acting: {acting}; start: {start_text(scene)}"]
    if "file" in asked.changes:
        from pendbench.scene.models.read import read_model

        lines += [f"  {note}" for note in read_model(asked.changes["file"]).notes]
    return lines


def _tell(finished: Finished) -> None:
    from rich.console import Console

    from pendbench.report.terminal import shown_table

    methods = finished.report.tables["methods"]
    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    with console.capture() as shown:
        console.print(finished.report.answer, markup=False, soft_wrap=True)  # a line to paste stays one
        if methods.rows:
            console.print(shown_table(methods, _SHOWN))
    say(f"{shown.get()}Report: {finished.out / 'report.md'}")
