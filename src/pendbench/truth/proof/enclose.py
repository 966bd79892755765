"""From a scene's start to its end, with as many bits as that takes; what has been proved is kept on the way."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from pendbench import __version__
from pendbench.base.files import write_whole
from pendbench.base.processes import memory_held
from pendbench.scene.scene import Scene
from pendbench.truth.proof.numbers import precision
from pendbench.truth.proof.place import Place, at
from pendbench.truth.proof.polynomials import Effort
from pendbench.truth.proof.system import Rates, own_scale
from pendbench.truth.proof.text import ball_text, read_ball, trimmed
from pendbench.truth.proof.walk import Seen, Walk

#: Angles are to be known to this, rad: more bits are taken until they are.
AIM: Final = 1e-20
_FIRST_BITS, MOST_BITS = 192, 6000
_SPARE_BITS = 24
_SAVE_EVERY = 20.0  # s

TOO_LONG: Final = "it ran into its time limit; the same line, run again, goes on from here"
TOO_LARGE: Final = "it ran into its memory limit; the same line with a higher one goes on from here"
TOO_WIDE: Final = "it would need more than %d bits"


def effort_of(bits: int) -> Effort:
    """An order and a low precision that suit: the step is about a third of the disc that is covered."""
    order = round(0.6 * bits)
    return Effort(bits, order, 128, max(44, order // 4))


def other_effort(effort: Effort) -> Effort:
    """Another one, for the same radii."""
    bits = effort.bits + 41
    return Effort(bits, round(0.5 * bits), 144, effort.small_order + 5)


@dataclass(frozen=True)
class Enclosed:
    """What is proved at each time, in order; why there is no more; and with what effort, in how many steps, and s."""

    seen: list[Seen]
    reason: str
    effort: Effort
    steps: int
    seconds: float


@dataclass
class _Progress:
    """A walk, and what it has seen."""

    walk: Walk
    seen: list[Seen] = field(default_factory=list)
    seconds: float = 0.0


def enclose(
    scene: Scene,
    times: Sequence[float],
    *,
    form: type[Rates] = Rates,
    effort: Effort | None = None,
    keep: Path | None = None,
    within: float = math.inf,
    memory: float = math.inf,
    tell: Callable[[float, float, int], object] | None = None,
) -> Enclosed:
    """Enclose the motion at `times` (s, rising, from 0 on), as far as it can be.

    effort: the first to be tried; more is taken where angles are not known to AIM. keep: a file from which it goes on,
    if it is of the same scene and times, and where it is kept. within: s of processor. memory: bytes that the process
    may hold, looked at after each step. tell: is told how far it is
    (s), of how much, and with how many bits.
    """
    keeper = _Keeper(keep, scene, times, form)
    progress = keeper.read() or _begin(scene, form, effort or effort_of(_FIRST_BITS))
    before, spent, clock = progress.seconds, 0.0, time.process_time()
    try:
        while True:
            wide = _go_on(progress, times)
            spent = time.process_time() - clock
            progress.seconds = before + spent
            if wide:
                bits = _bits_needed(progress, times[-1])
                if bits > MOST_BITS:
                    return _end(progress, TOO_WIDE % MOST_BITS)
                progress = _begin(scene, form, _scaled(progress.walk.effort, bits))
                continue
            if progress.walk.reason or len(progress.seen) == len(times):
                return _end(progress, progress.walk.reason)
            if spent > within:
                return _end(progress, TOO_LONG)
            if memory_held() > memory:
                return _end(progress, TOO_LARGE)
            keeper.write_now_and_then(progress)
            if tell is not None:
                tell(float(progress.walk.t), times[-1], progress.walk.effort.bits)
    finally:
        keeper.write(progress)


def _begin(scene: Scene, form: type[Rates], effort: Effort) -> _Progress:
    with precision(effort.bits):
        system = form(scene)
        return _Progress(Walk(system, at(system.start(scene)), system.start(scene)[0] * 0, effort))


def _end(progress: _Progress, reason: str) -> Enclosed:
    walk = progress.walk
    return Enclosed(progress.seen, reason, walk.effort, walk.steps, progress.seconds)


def _go_on(progress: _Progress, times: Sequence[float]) -> bool:
    """One step; whether what was seen is wider than the aim, and not kept."""
    walk, left = progress.walk, times[len(progress.seen) :]
    if left and walk.t == left[0]:
        with precision(walk.effort.bits):
            progress.seen.append(Seen(left[0], *walk.system.motion(walk.place.balls())))
        return False
    for found in walk.advance(left, times[-1]):
        if not max(float(ball.rad()) for ball in found.theta) <= AIM:
            return True
        progress.seen.append(_trimmed(found))
    return not float(walk.place.extent()) <= 1e3 * AIM


def _trimmed(found: Seen) -> Seen:
    return Seen(found.t, [trimmed(ball) for ball in found.theta], [trimmed(ball) for ball in found.omega])


def _bits_needed(progress: _Progress, end: float) -> int:
    """From how many were lost until now."""
    now, bits = max(float(progress.walk.t), 1e-6), progress.walk.effort.bits
    lost = bits + math.log2(AIM)
    return max(math.ceil(lost * end / now - math.log2(AIM)), bits) + _SPARE_BITS


def _scaled(effort: Effort, bits: int) -> Effort:
    share = bits / effort.bits
    order = round(effort.order * share)
    return Effort(bits, order, effort.small_bits, max(effort.small_order, order // 4))


class _Keeper:
    """The file in which progress is kept, and goes on from; one that is not whole counts for nothing."""

    def __init__(self, path: Path | None, scene: Scene, times: Sequence[float], form: type[Rates]) -> None:
        self._path, self._scene, self._form = path, scene, form
        about = (__version__, motion_digest(scene), own_scale(scene), list(times), form.name)
        self._key = _hash(repr(about))
        self._last = time.monotonic()

    def read(self) -> _Progress | None:
        """What was kept; None where that is nothing, or of something else, or no longer whole."""
        if self._path is None or not self._path.is_file():
            return None
        try:
            mark, content = self._path.read_text().split("\n", 1)
            kept = json.loads(content)
            return self._restored(kept) if kept["key"] == self._key and mark == _hash(content) else None
        except (ValueError, KeyError, TypeError, OSError):
            return None

    def _restored(self, kept: dict[str, Any]) -> _Progress:
        from flint import arb_mat

        effort = Effort(**kept["effort"])
        with precision(effort.bits):
            frame = arb_mat([[read_ball(entry) for entry in row] for row in kept["frame"]])
            place = Place([read_ball(c) for c in kept["centre"]], frame, [read_ball(r) for r in kept["radii"]])
            walk = Walk(self._form(self._scene), place, read_ball(kept["t"]), effort)
        walk.steps = kept["steps"]
        seen = [
            Seen(t, [read_ball(ball) for ball in theta], [read_ball(ball) for ball in omega])
            for t, theta, omega in kept["seen"]
        ]
        return _Progress(walk, seen, kept["seconds"])

    def write_now_and_then(self, progress: _Progress) -> None:
        """Write, if that is some time ago."""
        if time.monotonic() - self._last > _SAVE_EVERY:
            self.write(progress)

    def write(self, progress: _Progress) -> None:
        """Write what there is."""
        if self._path is None:
            return
        walk = progress.walk
        kept = {
            "key": self._key,
            "effort": asdict(walk.effort),
            "t": ball_text(walk.t),
            "steps": walk.steps,
            "seconds": progress.seconds,
            "centre": [ball_text(c) for c in walk.place.centre],
            "radii": [ball_text(r) for r in walk.place.radii],
            "frame": [[ball_text(entry) for entry in row] for row in walk.place.frame.tolist()],
            "seen": [
                [its.t, [ball_text(ball) for ball in its.theta], [ball_text(ball) for ball in its.omega]]
                for its in progress.seen
            ],
        }
        content = json.dumps(kept)
        write_whole(self._path, lambda out: out.write(f"{_hash(content)}\n{content}".encode()))
        self._last = time.monotonic()


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def motion_digest(scene: Scene) -> str:
    """What decides a scene's motion, however long it is followed."""
    return scene.with_(duration=1.0).digest
