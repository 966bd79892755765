"""`pendbench truth`: the truth of a scene as a file of numbers, for tests in any language."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

from pendbench.base.errors import InputError
from pendbench.commands.completing import scene_names
from pendbench.commands.shell import OK, number, say

if TYPE_CHECKING:
    from pendbench.base.arrays import FloatArray
    from pendbench.scene.scene import Scene

_SPAN: Final = (1e-9, 1e9, "s")
KEEPS: Final = False
_MOST_ANGLES: Final = 10_000_000  # of all links and times


def add_options(options: argparse.ArgumentParser) -> None:
    """What the command takes."""
    scene = options.add_argument("scene", metavar="FILE-or-SCENE", help="a scene's name, or a scene's or model's file")
    scene.completer = scene_names  # type: ignore[attr-defined]
    options.add_argument("--out", metavar="FILE", help="ends in .npz or .csv (default: SCENE.truth.npz)")
    options.add_argument("--until", type=float, metavar="S", help="up to when (default: the scene's end)")
    options.add_argument("--every", type=float, metavar="S", help="how far the times lie apart (default: 1000 in all)")


def run(chosen: argparse.Namespace) -> int:
    """Write the file, and say how far the truth reaches."""
    from pendbench.base.files import file_path
    from pendbench.report.numbers import number_text
    from pendbench.report.text import file_name
    from pendbench.scene.scene import load_scene
    from pendbench.truth.reference import reference
    from pendbench.truth.truth_file import check_ending, write_truth

    if chosen.out == "":
        raise InputError("--out is empty; allowed: a file")
    scene = load_scene(chosen.scene)
    out = check_ending(f"{file_name(scene.name)}.truth.npz" if chosen.out is None else chosen.out)
    times = _times(scene, chosen)
    file_path(out, "--out")
    truth = reference(scene, times)
    file, checksum = write_truth(scene, truth, out)
    known = f"to {number_text(truth.error, '.1e')} of the chain's length until {number_text(truth.horizon)} s"
    ended = f"; it ends there: {truth.reason}" if truth.reason else ""
    say(f"Known {known}{ended}", f"Written: {file}, {checksum}")
    return OK


def _times(scene: Scene, chosen: argparse.Namespace) -> FloatArray:
    """The times (k,) s that were asked for."""
    import numpy as np

    end = scene.duration if chosen.until is None else number("--until", chosen.until, _SPAN)
    every = end / 1000 if chosen.every is None else number("--every", chosen.every, _SPAN)
    least = end * scene.n / _MOST_ANGLES
    if not least <= every <= end:
        raise InputError(f"--every is {every:g}; allowed: from {least:g} to {end:g} s, for {end:g} s")
    return np.float64(every) * np.arange(int(end / every * (1 + 1e-12)) + 1)
