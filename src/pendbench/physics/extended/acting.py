"""What acts on a chain besides gravity, for the reference: the effects' laws in 32 digits.

The reference is compiled once and not for every set of effects: what the scene does not call for is there with all its
numbers 0, which costs a little at each step and spares many seconds of compiling.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import part
from pendbench.effects import Effects, examples
from pendbench.physics.kernels import laws
from pendbench.scene.scene import Scene
from pendbench.solvers.extended.number import extended, load, store


class Acting(NamedTuple):
    """The terms that move the pivot, gravity among them, that act in the joints, and on the masses."""

    pivots: Any
    joints: Any
    drags: Any


def acting_on(scene: Scene) -> Acting:
    """All effects there are, as the scene has them."""
    there = {**Effects(**examples()).terms(2), **scene.effects.terms(scene.n)}
    terms = [_sized(term, scene.n, 1.0 if name in scene.terms else 0.0) for name, term in there.items()]
    laws_of = ("pivot_acceleration", "joint_torque", "drag")
    return Acting(*(tuple(term for term in terms if hasattr(term, law)) for law in laws_of))


def _sized(term: Any, n: int, factor: float) -> Any:
    """The term for n links, its numbers times a factor of 1 or 0; arrays are copied: kernels want writable ones."""
    return type(term)(*(factor * np.resize(x, n) if isinstance(x, np.ndarray) else factor * x for x in term))


@part
def write_torques(joints: Any, t: Any, y: FloatArray, out: FloatArray) -> None:
    """Write the torque on each rod (n, 2) N m: of its own joint, less that of the next one. y: theta, omega, ..."""
    n = len(out)
    drives = laws.drives(joints, t)
    outer = extended(0.0)
    for i in range(n - 1, -1, -1):
        bend, rate = load(y, i), load(y, n + i)
        if i > 0:
            bend, rate = bend - load(y, i - 1), rate - load(y, n + i - 1)
        own = extended(laws.joint_torque(joints, drives, i, bend, rate))
        store(out, i, own - outer)
        outer = own


@part
def pivot(pivots: Any, t: Any) -> tuple[Any, Any, Any, Any]:
    """The pivot's acceleration against free fall, and its velocity."""
    x, y = laws.pivot_acceleration(pivots, t)
    u, v = laws.pivot_velocity(pivots, t)
    return extended(x), extended(y), extended(u), extended(v)
