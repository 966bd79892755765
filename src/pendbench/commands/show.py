"""`pendbench show`: see a chain move, every engine against the truth, in one page that people share."""

from __future__ import annotations

import argparse
import math
import re
from typing import TYPE_CHECKING, Final

from pendbench.base.errors import InputError
from pendbench.commands.completing import scene_names
from pendbench.commands.shell import OK, output_files, say

if TYPE_CHECKING:
    from pathlib import Path

    from pendbench.report.stage.records import Stage
    from pendbench.scene.scene import Scene
    from pendbench.study.case import Case

KEEPS: Final = False
_RUN: Final = "an engine, then if need be its method and its step in s: mujoco:rk4:0.001"

_MOST_STEPS: Final = 1e7  # at five links some 3 s of our RK4, a minute of MuJoCo's
_PICTURES: Final = {"gif": "a film", "mp4": "a film, by ffmpeg", "strip": "six moments side by side, PNG"}


def add_options(options: argparse.ArgumentParser) -> None:
    """The options of the verb."""
    scene = options.add_argument("scene", metavar="FILE-or-SCENE", help="a bundled scene, or a path to a scene's file")
    scene.completer = scene_names  # type: ignore[attr-defined]
    options.add_argument(
        "--run", action="append", default=[], metavar="ENGINE:METHOD:DT",
        help="a run to show, once for each; method and step can be left out (default: every engine that is installed)",
    )  # fmt: skip
    options.add_argument(
        "--butterfly", type=int, metavar="K", help="K neighbours 1e-6 rad apart in place of engines: when they fan out"
    )
    options.add_argument(
        "--flips",
        action="store_true",
        help="the map of when a double pendulum first flips, from rest at any two angles",
    )
    options.add_argument(
        "--whole-truth", action="store_true", help="compute the truth to its horizon, however long that takes"
    )
    options.add_argument("--out", metavar="FILE", help="the page (default: the scene's name, and .html)")
    for kind, what in _PICTURES.items():
        options.add_argument(f"--{kind}", metavar="FILE", help=f"{what}; without --out it is written instead of a page")


def run(chosen: argparse.Namespace) -> int:
    """Write what was asked for, and say where it is."""
    from pendbench.base.files import write_whole
    from pendbench.scene.scene import load_scene

    scene = load_scene(chosen.scene)
    wanted = output_files(_wanted(scene, chosen), chosen.scene)
    if chosen.flips:
        return _show_flips(scene, chosen, wanted)
    stage = _stage(scene, chosen)
    made = {path: _made(stage, kind) for kind, path in wanted.items()}
    for path, content in made.items():
        write_whole(path, lambda file, content=content: file.write(content))  # type: ignore[misc]
    say(*(f"Written: {path}" for path in made))
    return OK


def _show_flips(scene: Scene, chosen: argparse.Namespace, wanted: dict[str, Path]) -> int:
    from pendbench.base.files import write_whole
    from pendbench.commands.flips import flip_stage
    from pendbench.report.stage.page import flips_page

    if chosen.run or chosen.butterfly is not None or set(wanted) != {"out"}:
        raise InputError("--flips is a page of its own; allowed beside it: --out")
    page = flips_page(flip_stage(scene)).encode()
    write_whole(wanted["out"], lambda file: file.write(page))
    say(f"Written: {wanted['out']}")
    return OK


def _wanted(scene: Scene, chosen: argparse.Namespace) -> dict[str, str | None]:
    """Which files were asked for, by kind; a page where nothing was.

    Raises `InputError` for a picture with another kind's ending; one without an ending, as a device has, is none.
    """
    from pathlib import Path

    from pendbench.base.strict import shown_path
    from pendbench.report.text import file_name

    given = {kind: getattr(chosen, kind) for kind in ("out", *_PICTURES)}
    for kind in _PICTURES:
        ending, allowed = Path(given[kind] or "").suffix, ".png" if kind == "strip" else f".{kind}"
        if ending and ending.lower() != allowed:
            raise InputError(f"--{kind} {shown_path(given[kind])}: allowed: a name that ends in {allowed}")
    return {kind: out for kind, out in given.items() if out is not None} or {"out": f"{file_name(scene.name)}.html"}


def _made(stage: Stage, kind: str) -> bytes:
    from pendbench.report.stage.film import film, strip
    from pendbench.report.stage.page import stage_page

    if kind == "out":
        return stage_page(stage).encode()
    return strip(stage) if kind == "strip" else film(stage, kind)


def _stage(scene: Scene, chosen: argparse.Namespace) -> Stage:
    """What was asked to be seen. Raises `InputError`."""
    from pendbench.commands.butterfly import butterfly
    from pendbench.commands.showing import stage_of_cases

    if chosen.butterfly is None:
        work = {"truth_work": math.inf} if chosen.whole_truth else {}
        return stage_of_cases(scene, [_case(scene, text) for text in chosen.run], **work)
    if chosen.run:
        raise InputError("--run and --butterfly; allowed: one of them, since the neighbours are ours")
    return butterfly(scene, chosen.butterfly)


def _case(scene: Scene, text: str) -> Case:
    """The case that --run asks for. Raises `InputError`."""
    from pendbench.commands.takes import case_of

    name, *rest = text.split(":")
    if len(rest) > 2 or not name:
        raise InputError(f"--run is {text!r}; allowed: {_RUN}")
    method, step = (*rest, "", "")[:2]
    dt = _step(text, step) if step else None
    if dt is not None and scene.duration > _MOST_STEPS * dt:
        least = f"{scene.duration / _MOST_STEPS:.2g} s and more"
        raise InputError(f"--run {text!r} takes {scene.duration / dt:.1g} steps to be seen; allowed: {least}")
    return case_of(scene, name, method or None, dt)


def _step(text: str, step: str) -> float:
    from pendbench.base.ranges import STEP, Step

    try:
        return Step(STEP.low, STEP.high, STEP.unit).read(step if re.search("[/z]", step) else float(step))
    except ValueError:
        said = f"{STEP}, a fraction, as 1/60, or a rate, as 60Hz"
        raise InputError(f"--run {text!r} has the step {step!r}; allowed: {said}") from None
