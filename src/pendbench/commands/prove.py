"""`pendbench prove`: a scene's motion enclosed, so that its truth comes with a proof; or the check of such a proof."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendbench.base.errors import InputError
from pendbench.base.processes import machine_memory
from pendbench.commands.completing import scene_names
from pendbench.commands.shell import OK, REGRESSION, number, say

if TYPE_CHECKING:
    from pendbench.scene.scene import Scene

_SPAN: Final = (1e-9, 1e9, "s")
_MEMORY: Final = (1.0, 1e9, "MB")
_SAMPLES: Final = 1001
_TELL_EVERY: Final = 100  # steps


def add_options(options: argparse.ArgumentParser) -> None:
    """What the command takes."""
    scene = options.add_argument("scene", metavar="FILE-or-SCENE", help="a scene's name, or a scene's or model's file")
    scene.completer = scene_names  # type: ignore[attr-defined]
    options.add_argument("--until", type=float, metavar="S", help="up to when (default: the scene's end)")
    options.add_argument("--out", metavar="F.npz", help="the certificate (default: SCENE.proof.npz)")
    options.add_argument("--check", metavar="F.npz", help="check this certificate by another way; makes none")
    options.add_argument("--within", type=float, metavar="S", help="at most so much processor time; it can go on later")
    options.add_argument(
        "--memory", type=float, metavar="MB", help="at most so much memory (default: half of the machine's)"
    )


def run(chosen: argparse.Namespace) -> int:
    """Prove, or check a proof, and say what came of it."""
    from pendbench.scene.scene import load_scene
    from pendbench.truth.proof.proof import check_installed

    check_installed()
    if chosen.out is not None and chosen.check is not None:
        raise InputError("--out and --check; allowed: one of them, since a check makes no certificate")
    if "" in (chosen.out, chosen.check):
        raise InputError(f"{'--out' if chosen.out == '' else '--check'} is empty; allowed: a file that ends in .npz")
    scene = load_scene(chosen.scene)
    return _prove(scene, chosen) if chosen.check is None else _check(scene, chosen)


def _prove(scene: Scene, chosen: argparse.Namespace) -> int:
    import numpy as np

    from pendbench.base.files import file_path
    from pendbench.report.numbers import number_text
    from pendbench.report.text import file_name
    from pendbench.truth.proof.certificate import check_ending
    from pendbench.truth.proof.proof import prove_at

    out = check_ending(f"{file_name(scene.name)}.proof.npz" if chosen.out is None else chosen.out)
    end = scene.duration if chosen.until is None else number("--until", chosen.until, _SPAN)
    keep = file_path(out, "--out").with_name(f"{out.name}.part")
    proof = prove_at(scene, np.linspace(0.0, end, _SAMPLES).tolist(), keep, tell=_Teller(), **_limits(chosen))
    proof.save(out)
    if not proof.reason:
        keep.unlink(missing_ok=True)
    ended = f"; it ends there: {proof.reason}" if proof.reason else ""
    say(
        f"Proved until {number_text(proof.until)} s: every angle to {number_text(proof.sharpest, '.1e')} rad, "
        f"in doubles to {number_text(proof.error, '.1e')} rad{ended}",
        f"Written: {out}",
    )
    return OK


def _check(scene: Scene, chosen: argparse.Namespace) -> int:
    from pendbench.report.numbers import number_text
    from pendbench.truth.proof.certificate import read_proof
    from pendbench.truth.proof.check import check_proof

    file = Path(chosen.check)
    proof = read_proof(file, scene)
    until = math.inf if chosen.until is None else number("--until", chosen.until, _SPAN)
    say(f"{file} is whole, and of this scene, until {number_text(proof.until)} s")
    keep = file.with_name(f"{file.name}.check.part")
    found = check_proof(proof, until, keep=keep, tell=_Teller(), **_limits(chosen))
    if not found.reason:
        keep.unlink(missing_ok=True)
    say(f"By another way ({found.how}): {found.agreed} of {found.looked_at} times agree, until {found.until:g} s")
    if found.reason:
        say(f"The other way ends there: {found.reason}")
    if not math.isnan(found.first_apart):
        say(f"At {found.first_apart:g} s the two have no point in common: one of them is wrong")
    return OK if math.isnan(found.first_apart) else REGRESSION


def _limits(chosen: argparse.Namespace) -> dict[str, float]:
    within = math.inf if chosen.within is None else number("--within", chosen.within, _SPAN)
    memory = machine_memory() / 2 if chosen.memory is None else 1e6 * number("--memory", chosen.memory, _MEMORY)
    return {"within": within, "memory": memory}


class _Teller:
    """Says now and then how far it is, on standard error."""

    def __init__(self) -> None:
        self._calls = 0

    def __call__(self, done: float, end: float, bits: int) -> None:
        self._calls += 1
        if self._calls % _TELL_EVERY == 0:
            print(f"{done:.4g} of {end:g} s, {bits} bits", file=sys.stderr, flush=True)
