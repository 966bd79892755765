"""The chain as the compiled kernels see it.

The *type* of a system says which effects it has, so a kernel compiled for it holds their arithmetic and no other.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.physics import acting
from pendbench.physics.kernels.scratch import BARE_ROWS, ROWS
from pendbench.scene.scene import Scene


class System(NamedTuple):
    """A chain on massless rods.

    masses (n,) kg; lengths (n,) m; ratios (n - 1,) of each mass to the next, inner_ratios (n,) to the one before, 0 for
    the first; gravity m/s^2 (0 where the scene has none: it enters once, at the pivot, and costs the same). pivots,
    joints, drags: the terms that move the pivot, act in the joints and on the masses, mostly (). scratch (rows, n):
    room for the recursion, so that a call allocates nothing. One thread, one system.
    """

    masses: FloatArray
    lengths: FloatArray
    inverse_masses: FloatArray
    ratios: FloatArray
    inner_ratios: FloatArray
    gravity: float
    pivots: Any
    joints: Any
    drags: Any
    scratch: FloatArray


class LinkSystem(NamedTuple):
    """A chain of links that have a mass along them: rods with a mass of their own, or rigid links.

    masses (n,) kg: with a share of each link at its ends; points (n,) kg: without; inertias (n,) kg m^2: what the
    shares at the ends lack. weights (n,) kg: of the links alone; about_centres, about_joints and about_ends (n,) kg:
    their inertias about the three, and leans (n,) kg: `inertias`, all over l^2. inner (n,) kg: the share at the joint.
    The rest is as in `System`.
    """

    masses: FloatArray
    lengths: FloatArray
    points: FloatArray
    inertias: FloatArray
    weights: FloatArray
    about_centres: FloatArray
    about_joints: FloatArray
    about_ends: FloatArray
    leans: FloatArray
    inner: FloatArray
    gravity: float
    pivots: Any
    joints: Any
    drags: Any
    scratch: FloatArray


class RotorSystem(NamedTuple):
    """A chain of links, with rotors (n,) kg m^2 in its joints."""

    chain: LinkSystem
    rotors: FloatArray


def system_of(scene: Scene) -> System | LinkSystem | RotorSystem:
    """The scene's chain and effects, ready for the kernels."""
    terms: list[Any] = [term for name, term in scene.terms.items() if name != "gravity"]
    pivots, joints, drags = (_with(terms, law) for law in ("pivot_acceleration", "joint_torque", "drag"))
    effects: dict[str, Any] = {
        "gravity": scene.effects.gravity or 0.0,
        "pivots": pivots,
        "joints": joints,
        "drags": drags,
    }
    rotors = acting.rotor_inertias(scene)
    heavy = acting.has_links(scene) or bool(rotors.any())
    scratch = np.empty((ROWS if joints or drags or heavy else BARE_ROWS, scene.n))
    if heavy:
        chain = LinkSystem(scratch=scratch, **_chain_of_links(scene), **effects)
        return RotorSystem(chain, rotors) if rotors.any() else chain
    return System(
        masses=np.array(scene.masses),
        lengths=np.array(scene.lengths),
        inverse_masses=1.0 / scene.masses,
        ratios=np.append(scene.masses[:-1] / scene.masses[1:], 0.0),
        inner_ratios=np.append(0.0, scene.masses[1:] / scene.masses[:-1]),
        scratch=scratch,
        **effects,
    )


def _chain_of_links(scene: Scene) -> dict[str, Any]:
    """What links weigh and how they turn, by the names of `LinkSystem`. docs/equations.md, (E53)."""
    its, lengths = acting.links(scene), np.array(scene.lengths)
    inertias = acting.link_inertias(scene)
    near, far = its.centre / lengths, (lengths - its.centre) / lengths
    about_centres = its.inertia / lengths / lengths
    return {
        "masses": acting.lumped_masses(scene),
        "lengths": lengths,
        "points": np.array(scene.masses),
        "inertias": inertias,
        "weights": np.array(its.mass),
        "about_centres": about_centres,
        "about_joints": about_centres + its.mass * near * near,
        "about_ends": about_centres + its.mass * far * far,
        "leans": about_centres - its.mass * near * far,
        "inner": its.mass * far,
    }


def _with(terms: list[Any], law: str) -> tuple[Any, ...]:
    """The terms with this law, whose arrays are copied: kernels are compiled for arrays that can be written."""
    return tuple(type(term)(*map(_own, term)) for term in terms if hasattr(term, law))


def _own(number: Any) -> Any:
    return np.array(number) if isinstance(number, np.ndarray) else number
