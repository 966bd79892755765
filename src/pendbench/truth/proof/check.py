"""A proof, looked at by another way: Hamilton's form, another order, other steps and another precision."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pendbench.base.errors import InputError
from pendbench.truth.proof.certificate import SIZES, check_doubles
from pendbench.truth.proof.proof import Proof, check_installed


@dataclass(frozen=True)
class Checked:
    """agreed: at how many times the two enclosures have points in common, of how many that were looked at.

    until: the last time looked at, s; first_apart: the first time at which they have none, s, or nan. reason: why the
    other way ended before the proof does. how: the other way, in words.
    """

    agreed: int
    looked_at: int
    until: float
    first_apart: float
    reason: str
    how: str


def check_proof(
    proof: Proof,
    until: float = math.inf,
    *,
    keep: Path | None = None,
    within: float = math.inf,
    memory: float = math.inf,
    tell: Callable[[float, float, int], object] | None = None,
) -> Checked:
    """Enclose the same motion by another way, and see that every ball has points in common with the proof's.

    Both hold the truth if both are right; where they have no point in common, one is wrong. Raises `InputError` where
    the proof's arrays do not fit each other, or it has none of these times.
    """
    check_installed()
    from pendbench.truth.proof.enclose import enclose, other_effort
    from pendbench.truth.proof.polynomials import Effort
    from pendbench.truth.proof.system import Momenta
    from pendbench.truth.proof.text import read_ball

    check_doubles(proof)
    made = proof.made
    sizes = [int(made[name]) for name in SIZES]
    effort = other_effort(Effort(*sizes))
    times = [t for t in proof.t.tolist() if t <= until]
    if not times:
        raise InputError(f"the proof says nothing of times until {until:g} s; allowed: a later time, or another proof")
    limits = {"within": within, "memory": memory}
    found = enclose(proof.scene, times, form=Momenta, effort=effort, keep=keep, tell=tell, **limits)
    apart = []
    for its, texts in zip(found.seen, proof.balls.tolist(), strict=False):
        if not all(a.overlaps(read_ball(b)) for a, b in zip([*its.theta, *its.omega], texts, strict=True)):
            apart.append(its.t)
    used = found.effort
    return Checked(
        agreed=len(found.seen) - len(apart),
        looked_at=len(found.seen),
        until=found.seen[-1].t if found.seen else 0.0,
        first_apart=apart[0] if apart else math.nan,
        reason=found.reason,
        how=f"{Momenta.name}, order {used.order}, {used.bits} bits, {found.steps} steps",
    )
