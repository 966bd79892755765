"""How far the reference is off where there is a proof, and what it claims.

By hand: python benchmarks/reference_against_proofs.py [names of scenes]. Writes lines of the table in docs/proofs.md.
Whole numbers of Python read the balls: the extra `proof` is needed only for scenes without a certificate, of which the
first seconds are proved for it.
"""

from __future__ import annotations

import sys
from fractions import Fraction

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.bundled import bundled, bundled_names
from pendbench.physics.geometry import distance
from pendbench.scene.scene import Scene, load_scene
from pendbench.truth.proof.certificate import read_proof
from pendbench.truth.proof.proof import Proof
from pendbench.truth.reference import Truth, reference


def farthest(text: str, high: float, low: float) -> float:
    """How far a number of 32 digits is from a ball's farthest point, with the sign of its distance from the middle."""
    m, e, r, f = (int(part, 16) for part in text.split(":"))
    off = Fraction(high) + Fraction(low) - m * Fraction(2) ** e
    return float(abs(off) + r * Fraction(2) ** f) * (1 if off >= 0 else -1)


def true_errors(truth: Truth, proof: Proof) -> FloatArray:
    """How far the reference is off at each of its times, at most, in lengths of the chain."""
    lengths, errors = truth.scene.lengths, []
    for theta, low, texts in zip(truth.theta, truth.theta_low, proof.balls.tolist(), strict=False):
        off = [farthest(*its) for its in zip(texts, theta.tolist(), low.tolist(), strict=False)]
        errors.append(float(distance(lengths, theta, np.array(off))))
    return np.array(errors)


def first_seconds(scene: Scene) -> Proof:
    """A proof of as much of the first two seconds as a minute of processor time gives."""
    from pendbench.truth.proof.proof import prove_at  # wants the extra

    return prove_at(scene, np.linspace(0.0, min(2.0, scene.duration), 51).tolist(), within=60.0)


def line(name: str) -> str:
    """The line of a scene."""
    scene, kept = load_scene(name), bundled("truths") / f"{name}.npz"
    proof = read_proof(kept, scene) if kept.is_file() else first_seconds(scene)
    truth = reference(scene, proof.t)
    errors = true_errors(truth, proof)
    later = truth.bound > 0.0
    share = float((errors[later] / truth.bound[later]).max())
    made, until = proof.made, f"{truth.horizon:g} s"
    return (
        f"| `{name}` | {proof.until:g} s | {proof.sharpest:.1e} | {made['bits']} | {made['steps']} | "
        f"{float(made['seconds']):.0f} s | {until} | {errors.max():.1e} | {truth.error:.1e} | {share:.1e} |"
    )


if __name__ == "__main__":
    known = [name for name in bundled_names("models") if (bundled("truths") / f"{name}.npz").is_file()]
    for wanted in sys.argv[1:] or known:
        print(line(wanted), flush=True)
