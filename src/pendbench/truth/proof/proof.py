"""The proof of a scene's motion: balls in which every angle and rate must be, at the times asked for."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from platform import python_version
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pendbench import __version__
from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.base.ranges import rising_times
from pendbench.base.strict import show
from pendbench.scene.scene import DURATION, Scene, scene_of

if TYPE_CHECKING:
    from pendbench.truth.proof.walk import Seen

INSTALL = 'pip install "pendbench[proof]"'
_SAMPLES = 1001


@dataclass(frozen=True, eq=False)
class Proof:
    """What is proved of a scene's motion.

    t: (k,) s. theta_mid, omega_mid: (k, n) rad and rad/s; theta_rad, omega_rad: (k, n), how far the truth can be from
    them, everything that was rounded included. balls: (k, 2 n) the same to full precision, of the angles first, as
    ``m:e:r:f`` for m 2^e +- r 2^f in base 16. reason: why it ends before the last time that was asked for, or nothing.
    made: how it was made, in words and numbers.
    """

    scene: Scene
    t: FloatArray
    theta_mid: FloatArray
    theta_rad: FloatArray
    omega_mid: FloatArray
    omega_rad: FloatArray
    balls: npt.NDArray[np.str_]
    reason: str
    made: dict[str, str | int | float]

    def __repr__(self) -> str:
        return f"<Proof of {self.scene.name!r} until {self.until:g} s: angles to {self.error:.1e} rad>"

    @property
    def until(self) -> float:
        """The last time of which something is proved, s."""
        return float(self.t[-1]) if len(self.t) else 0.0

    @property
    def error(self) -> float:
        """The largest radius of an angle, rad, as doubles can say it."""
        return float(self.theta_rad.max()) if len(self.t) else 0.0

    @property
    def sharpest(self) -> float:
        """The largest radius of an angle, rad, of the full balls."""
        radii = [text.split(":")[2:] for text in self.balls[:, : self.scene.n].ravel().tolist()]
        largest = max((math.ldexp(int(r, 16), int(f, 16)) for r, f in radii), default=0.0)
        return math.nextafter(largest, math.inf)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it as a certificate, an `.npz` of plain arrays; docs/proofs.md says what is in it."""
        from pendbench.truth.proof.certificate import write_proof

        return write_proof(self, path)


def prove(
    scene: Scene | str | os.PathLike[str], until: float | None = None, times: npt.ArrayLike | None = None
) -> Proof:
    """Enclose the motion of a scene: balls that hold the truth, proved with every rounding and truncation bounded.

    scene: a `Scene`, or what `load_scene` takes. until: s, by default the scene's end, at 1001 times; or give the
    times (k,) s, rising. Costs a second or so of processor for each simulated one at two links, and grows like n^3.

    >>> import pendbench as pb
    >>> try:
    ...     proof = pb.prove("single", times=[0.0, 0.5])
    ... except pb.InputError as error:  # python-flint, an extra, is not installed
    ...     assert "pendbench[proof]" in str(error)
    ... else:
    ...     assert proof.until == 0.5 and proof.error < 1e-15

    Raises InputError where times are not rising or `until` is no time, where the equations are not analytic (quadratic
    drag), and where python-flint is not installed. Source: docs/proofs.md.
    """
    scene = scene_of(scene)
    if until is not None and times is not None:
        raise InputError("until and times are given; allowed: one of them")
    asked = np.linspace(0.0, _end(scene, until), _SAMPLES) if times is None else times
    return prove_at(scene, rising_times(asked).tolist())


def _end(scene: Scene, until: object) -> float:
    try:
        return scene.duration if until is None else DURATION.read(until)
    except ValueError as problem:
        raise InputError(f"until is {show(until)}; allowed: {problem}") from None


def prove_at(
    scene: Scene,
    times: Sequence[float],
    keep: Path | None = None,
    within: float = math.inf,
    memory: float = math.inf,
    tell: Callable[[float, float, int], object] | None = None,
) -> Proof:
    """The same at these times; what `keep`, `within`, `memory` and `tell` do, `enclose` says."""
    check_installed()
    from pendbench.truth.proof.enclose import enclose
    from pendbench.truth.proof.system import Rates, check_provable

    check_provable(scene)
    found = enclose(scene, times, keep=keep, within=within, memory=memory, tell=tell)
    made: dict[str, str | int | float] = {
        "form": Rates.name,
        "bits": found.effort.bits,
        "order": found.effort.order,
        "variation_bits": found.effort.small_bits,
        "variation_order": found.effort.small_order,
        "steps": found.steps,
        "seconds": round(found.seconds, 3),
        **versions(),
    }
    return proof_of(scene, found.seen, found.reason, made)


def proof_of(scene: Scene, seen: Sequence[Seen], reason: str, made: dict[str, str | int | float]) -> Proof:
    """In arrays, rounded outwards."""
    from pendbench.truth.proof.text import ball_text, outwards

    k, n = len(seen), scene.n
    balls = [ball for its in seen for ball in (*its.theta, *its.omega)]
    doubles = np.array([outwards(ball) for ball in balls]).reshape(k, 2 * n, 2)
    return Proof(
        scene=scene,
        t=np.array([its.t for its in seen], np.float64),
        theta_mid=doubles[:, :n, 0],
        theta_rad=doubles[:, :n, 1],
        omega_mid=doubles[:, n:, 0],
        omega_rad=doubles[:, n:, 1],
        balls=np.array([ball_text(ball) for ball in balls], np.str_).reshape(k, 2 * n),
        reason=reason,
        made=made,
    )


def versions() -> dict[str, str | int | float]:
    """Of all that is trusted."""
    import flint

    return {
        "pendbench": __version__,
        "python-flint": importlib.metadata.version("python-flint"),
        "flint": flint.__FLINT_VERSION__,
        "python": python_version(),
    }


def check_installed() -> None:
    """Raise `InputError` where python-flint is not installed."""
    if importlib.util.find_spec("flint") is None:
        raise InputError(f"a proof needs python-flint, which is not installed; {INSTALL}")
