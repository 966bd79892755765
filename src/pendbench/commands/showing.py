"""`pendbench.show`: runs as a page, which a notebook shows as it is."""

from __future__ import annotations

import html
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from pendbench.base.errors import InputError
from pendbench.base.files import file_path, write_whole
from pendbench.base.strict import show as shown
from pendbench.commands.staging import stage_of
from pendbench.commands.takes import TRUTH_WORK, Take, default_cases, takes_of
from pendbench.report.stage.page import stage_page
from pendbench.report.stage.records import Stage
from pendbench.scene.scene import Scene, scene_of
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case

_TALL: Final = 820  # px, of the page in a notebook


@dataclass(frozen=True)
class Page:
    """A page, HTML. path: where it was written, if it was. In a notebook it shows itself."""

    html: str = field(repr=False)
    path: Path | None = None

    def _repr_html_(self) -> str:
        inside = html.escape(self.html, quote=True)
        style = f"width:100%;height:{_TALL}px;border:0"
        return f'<iframe sandbox="allow-scripts" title="pendbench" style="{style}" srcdoc="{inside}"></iframe>'


def show(
    scene: Scene | str | os.PathLike[str] | Trajectory | Sequence[Trajectory],
    out: str | os.PathLike[str] | None = None,
) -> Page:
    """See a scene move: runs of it, or every engine that is installed, and the truth behind them.

    scene: one run or several of one scene, as `simulate` gives them; or a `Scene`, or what `load_scene` takes, which
    each engine then runs with its first method: one with a fixed step takes 1 ms, or a thousandth of a scene that is
    shorter than a second. out: the file that the page is written to, if any. The page is one file that asks nothing of
    any network; in a notebook what is returned shows itself.

    >>> import pendbench as pb
    >>> pb.show("double", out="double.html")  # doctest: +SKIP
    >>> pb.show([pb.simulate("single"), pb.simulate("single", engine="pymunk", dt=0.01)])
    Page(path=None)

    Raises `InputError`, one line, for whatever cannot be used.
    """
    path = None if out is None else file_path(out, "out")
    page = stage_page(_stage(scene))
    if path is not None:
        write_whole(path, lambda file: file.write(page.encode()))
    return Page(page, path)


def _stage(asked: Scene | str | os.PathLike[str] | Trajectory | Sequence[Trajectory]) -> Stage:
    if isinstance(asked, Scene | str | os.PathLike):
        return stage_of_cases(scene_of(asked))
    runs = [asked] if isinstance(asked, Trajectory) else asked
    if not isinstance(runs, Sequence) or not all(isinstance(run, Trajectory) for run in runs):
        raise InputError(f"scene is {shown(asked)}; allowed: a scene, a run, or a list of runs")
    takes = [Take(_case_of(run), run) for run in runs]
    if len({take.case.scene.digest for take in takes}) > 1:
        raise InputError("the runs are of different scenes; allowed: runs of one scene")
    if not takes:
        raise InputError("there are no runs; allowed: one run or more")
    return stage_of(takes[0].case.scene, takes)


def _case_of(run: Trajectory) -> Case:
    if run.scene is None or run.maker is None:
        raise InputError("a run does not say what it is of and what made it; allowed: runs that simulate gave")
    return Case(run.scene, run.maker.engine, run.maker.method, run.maker.dt, run.maker.settings)


def stage_of_cases(scene: Scene, cases: Sequence[Case] = (), truth_work: float = TRUTH_WORK) -> Stage:
    """The stage of some cases of a scene, or of every engine's first method."""
    return stage_of(scene, takes_of(cases or default_cases(scene)), truth_work)
