"""What is proved of the scenes at hand, by the certificates that come with pendbench."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pendbench.base.bundled import bundled
from pendbench.base.errors import InputError
from pendbench.scene.scene import Scene
from pendbench.truth.proof.certificate import read_proof
from pendbench.truth.proof.proof import Proof


@dataclass(frozen=True)
class Proven:
    """scene: its name. error: how far the truth can be from the certificate's balls, rad, until then, s."""

    scene: str
    error: float
    until: float


def certificate_of(scene: Scene) -> Proof | None:
    """The bundled certificate of a scene's name, where it is of the same motion."""
    try:
        return read_proof(bundled("truths") / f"{scene.name}.npz", scene)
    except InputError:
        return None


def proven(scenes: Iterable[Scene]) -> list[Proven]:
    """What is proved of each scene that has a certificate."""
    proofs = [certificate_of(scene) for scene in scenes]
    return [Proven(proof.scene.name, proof.sharpest, proof.until) for proof in proofs if proof is not None]
