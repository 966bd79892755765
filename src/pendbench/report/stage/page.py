"""The page: a template, its style and its scripts, written into one file that asks nothing of any network."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Final

import jinja2
from markupsafe import Markup

from pendbench.report.inline import Inline, inline
from pendbench.report.numbers import number_text
from pendbench.report.stage.packing import json_text, packed_flips, packed_stage
from pendbench.report.stage.records import FlipStage, Stage
from pendbench.report.text import counted

FOLDER: Final = Path(__file__).resolve().parent
_COMMON: Final = ("unpack.js", "canvas.js", "theme.js")
_MOVING: Final = ("chain.js", "clock.js", "stage.js", "axes.js", "chart.js", "readout.js", "page.js")
_STAGE: Final = (*_COMMON, *_MOVING, "main.js")
#: Those of a report, which moves where a study has something that does.
REPORT: Final = (*_COMMON, *_MOVING, "marks.js", "panel.js", "plot.js")
_FLIPS: Final = (*_COMMON, "pendulum.js", "flips.js")
_STYLES: Final = ("colours.css", "page.css", "stage.css")


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER), undefined=jinja2.StrictUndefined, autoescape=True, trim_blocks=True
    )


@cache
def _script(names: tuple[str, ...]) -> Inline:
    return inline(*(FOLDER / name for name in names), before='"use strict";\n')


@cache
def _style() -> Inline:
    return inline(*(FOLDER / name for name in _STYLES))


def stage_page(stage: Stage) -> str:
    """The whole page, HTML. What comes from a scene or an engine stays text, whatever it holds."""
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            stage=stage,
            subtitle=subtitle(stage),
            legend="run" if len(stage.acts) == 1 else "runs",
            data=Markup(json_text(packed_stage(stage))),  # escaped there
            script=_script(_STAGE),
            style=_style(),
        )
    )


def flips_page(stage: FlipStage) -> str:
    """The page of a map, HTML, as safe as the other."""
    return (
        _environment()
        .get_template("flips.html.j2")
        .render(
            stage=stage,
            subtitle=f"When a rod first goes over the top within {number_text(stage.duration)} s, from rest anywhere.",
            data=Markup(json_text(packed_flips(stage))),  # escaped there
            script=_script(_FLIPS),
            style=_style(),
        )
    )


def subtitle(stage: Stage) -> str:
    """``2 links, 1 m, 10 s; the truth is known for all of it``."""
    size = f"{counted(stage.links, 'link')}, {number_text(stage.length)} m, {number_text(stage.duration)} s"
    if stage.truth is None:
        return size
    whole = stage.truth.horizon >= stage.duration * (1 - 1e-9)
    known = "to its end" if whole else f"for {number_text(stage.truth.horizon)} s"
    return f"{size}. The ghost is the truth, known {known}."
