"""The chain as the compiled kernels see it.

The *type* of a system says which effects it has, so a kernel compiled for it holds their arithmetic and no other.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.physics import acting
from pendbench.scene import Scene

# The rows of a system's scratch: those of the bare recursion, and of one with forces on the masses or heavy rods.
_BARE_ROWS, _ROWS = 5, 10


class System(NamedTuple):
    """A chain on massless rods.

    masses (n,) kg; lengths (n,) m; ratios (n - 1,) of each mass to the next; gravity m/s^2 (0 where the scene has none:
    it enters once, at the pivot, and costs the same). frames, joints, drags: the terms that move the pivot, act in the
    joints and on the masses, mostly (). scratch (rows, n): room for the recursion, so that a call allocates nothing.
    One thread, one system.
    """

    masses: FloatArray
    lengths: FloatArray
    inverse_masses: FloatArray
    ratios: FloatArray
    gravity: float
    frames: Any
    joints: Any
    drags: Any
    scratch: FloatArray


class RodSystem(NamedTuple):
    """A chain on rods with masses (n,) kg of their own.

    masses (n,) kg: with half of each rod at its ends; points (n,) kg: without; inertias (n,) kg m^2: what the halves at
    the ends have too much of, negative. The rest is as in `System`.
    """

    masses: FloatArray
    lengths: FloatArray
    points: FloatArray
    rods: FloatArray
    inertias: FloatArray
    gravity: float
    frames: Any
    joints: Any
    drags: Any
    scratch: FloatArray


def system_of(scene: Scene) -> System | RodSystem:
    """The scene's chain and effects, ready for the kernels."""
    terms: list[Any] = [term for name, term in scene.terms.items() if name != "gravity"]
    frames, joints, drags = (_with(terms, law) for law in ("pivot_acceleration", "joint_torque", "drag"))
    effects: dict[str, Any] = {
        "gravity": scene.effects.gravity or 0.0,
        "frames": frames,
        "joints": joints,
        "drags": drags,
    }
    heavy = bool(_with(terms, "rod_masses"))
    scratch = np.empty((_ROWS if joints or drags or heavy else _BARE_ROWS, scene.n))
    if heavy:
        return RodSystem(
            masses=acting.lumped_masses(scene),
            lengths=np.array(scene.lengths),
            points=np.array(scene.masses),
            rods=acting.rods(scene),
            inertias=acting.rod_inertias(scene),
            scratch=scratch,
            **effects,
        )
    return System(
        masses=np.array(scene.masses),
        lengths=np.array(scene.lengths),
        inverse_masses=1.0 / scene.masses,
        ratios=scene.masses[:-1] / scene.masses[1:],
        scratch=scratch,
        **effects,
    )


def _with(terms: list[Any], law: str) -> tuple[Any, ...]:
    """The terms with this law, whose arrays are copied: kernels are compiled for arrays that can be written."""
    return tuple(type(term)(*map(_own, term)) for term in terms if hasattr(term, law))


def _own(number: Any) -> Any:
    return np.array(number) if isinstance(number, np.ndarray) else number
