"""What a page shows, put together: the runs, the truth behind them, and the same said in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from pendbench import __version__
from pendbench.commands.takes import TRUTH_WORK, Take, acts_of, ghost, need_runs, truth_of
from pendbench.measures.energy import conserves_energy
from pendbench.physics.geometry import positions
from pendbench.report.numbers import number_text
from pendbench.report.stage.records import Act, Stage, Truth
from pendbench.scene.scene import Scene
from pendbench.study.ask import version
from pendbench.study.motions import Motions
from pendbench.study.truths import KeptTruth

_ERROR: Final = "Error: the farthest any mass is from the truth, in lengths of the chain"
_DRIFT: Final = "Energy: how far it is from its first value, in units of the scene's"
_BALANCE: Final = "Energy: what is missing from its balance with what damps and drives, in units of the scene's"


def stage_of(scene: Scene, takes: Sequence[Take], truth_work: float = TRUTH_WORK) -> Stage:
    """The page of some runs of a scene, with the truth as far as so much work gets.

    Raises `InputError` where no run has anything to show.
    """
    need_runs(takes)
    return staged(scene, takes, truth_of(scene, [take.run for take in takes], truth_work), scene.duration)


def stage_of_study(found: Motions | None) -> Stage | None:
    """What moves in a study's page; None where nothing does."""
    if found is None or not any(len(motion.t) for _, motion in found.motions):
        return None
    takes = [Take(case, motion.run) for case, motion in found.motions]
    return staged(takes[0].case.scene, takes, found.truth, found.until)


def staged(scene: Scene, takes: Sequence[Take], known: KeptTruth, duration: float) -> Stage:
    """The page of some runs of a scene and its truth, for so long, s."""
    truth = ghost(scene, known, len(takes) + 1)
    acts = acts_of(takes, known)
    return Stage(
        title=scene.title,
        name=scene.name,
        links=scene.n,
        duration=duration,
        length=scene.total_length,
        acts=acts,
        truth=truth,
        error_says=_ERROR if truth is not None else f"Error: not known, for the truth is not ({known.reason})",
        energy_says=_DRIFT if conserves_energy(scene) else _BALANCE,
        words=tuple(_words(scene, acts, truth)),
        facts=_facts(scene, takes, known),
    )


def _words(scene: Scene, acts: Sequence[Act], truth: Truth | None) -> list[str]:
    """The page for those who do not see it."""
    first = positions(scene.lengths, scene.angles)[-1]
    place = f"{number_text(first[0])} m to the right and {number_text(first[1])} m up"
    said = [f"{scene.title}. Its last mass starts {place} from the pivot."]
    if truth is not None:
        said.append(f"The truth is known for {number_text(truth.horizon)} s; {truth.ends}, and nothing is compared.")
    return said + [_act_in_words(act, truth) for act in acts]


def _act_in_words(act: Act, truth: Truth | None) -> str:
    said = f"{act.name} ({act.detail})"
    if truth is None or not len(act.error.t):
        return f"{said} ended: {act.ended}." if act.ended else f"{said} is not compared with the truth."
    if math.isfinite(act.leaves):
        after = f" is 1 % of the chain's length from the truth after {number_text(act.leaves)} s"
    else:
        after = f" stays within 1 % of the chain's length; it ends {number_text(act.error.values[-1])} lengths away"
    return f"{said}{after}{f', and ended: {act.ended}' if act.ended else ''}."


def _facts(scene: Scene, takes: Sequence[Take], truth: KeptTruth) -> tuple[tuple[str, str], ...]:
    engines = dict.fromkeys(take.case.engine for take in takes)
    known = f"{number_text(truth.horizon)} s, to {number_text(truth.error, '.1e')} of the length"
    return (
        ("pendbench", __version__),
        ("scene", f"{scene.name}, {scene.digest}"),
        *((name, version(name)) for name in engines if name != "analytic"),
        ("truth", known if len(truth.t) else truth.reason),
    )
