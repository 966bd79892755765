"""Why accelerations are wrong: each suspect is a torque that, so many times, would explain what is seen.

A right engine's accelerations a obey C a = S w^2 - h (equations.md, E6). What is left of that with the engine's own a
is a torque r, and a suspect is named where one number s makes s times its torque the whole of r, in several states.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.physics.dense import accelerations, coupling_matrix, mass_matrix, weight_torques
from pendbench.scene.scene import Scene

# A suspect has to explain all but so much of what is seen.
_LEFT: Final = 0.02
_MOST: Final = 0.3


class Seen(NamedTuple):
    """The accelerations (n,) rad/s^2 that an engine has at the start of a scene."""

    scene: Scene
    found: FloatArray


@dataclass(frozen=True)
class Suspect:
    """torque: (n,) N m, of what is seen. said: what is wrong, with the factor s in it."""

    torque: Callable[[Seen], FloatArray]
    said: Callable[[float], str]


def suspect(seen: Sequence[Seen], known: float) -> str | None:
    """What explains the accelerations of chains with equally many links, or None.

    known: how well what is wrong with them is known, as a share of it.
    """
    best, why = min(max(_LEFT, known), _MOST), None
    for other, said in _OTHERS.items():
        left = _part([each.found - other(each) for each in seen], [each.found - _right(each) for each in seen])
        if left < best:
            best, why = left, said
    rest = np.concatenate([_rest(each) for each in seen])
    for each in _suspects(seen[0].scene.n):
        torque = np.concatenate([each.torque(one) for one in seen])
        if not (square := float(torque @ torque)):
            continue
        s = float(torque @ rest) / square
        left = _part([rest - s * torque], [rest])
        if left < (0.5 * best if why else best):  # a later one has to be clearly better
            best, why = left, each.said(s)
    return why


def _part(left: Sequence[FloatArray], whole: Sequence[FloatArray]) -> float:
    size = float(np.abs(np.concatenate(list(whole))).max())
    return float(np.abs(np.concatenate(list(left))).max()) / size if size else np.inf


def _right(seen: Seen) -> FloatArray:
    return accelerations(seen.scene, seen.scene.angles, seen.scene.rates)


def _rest(seen: Seen) -> FloatArray:
    """The torque (n,) N m that is needed beside those of the equations."""
    scene = seen.scene
    return np.asarray(mass_matrix(scene, scene.angles) @ seen.found - _coriolis(seen) - _weight(seen))


def _coriolis(seen: Seen) -> FloatArray:
    return np.asarray(coupling_matrix(seen.scene, seen.scene.angles) @ seen.scene.rates**2)


def _weight(seen: Seen) -> FloatArray:
    return -weight_torques(seen.scene, seen.scene.angles)


def _turning(seen: Seen) -> FloatArray:
    """What a further inertia m l^2 of each link about its joint would take."""
    return -seen.scene.masses * seen.scene.lengths**2 * seen.found


def _between(rates: FloatArray) -> FloatArray:
    """Dampers in the joints: each turns against the rods that it joins."""
    bends = np.diff(rates, prepend=0.0)
    return np.asarray(-bends + np.append(bends[1:], 0.0))


def _term(i: int, j: int) -> Suspect:
    def torque(seen: Seen) -> FloatArray:
        found = np.zeros(seen.scene.n)
        found[i] = coupling_matrix(seen.scene, seen.scene.angles)[i, j] * seen.scene.rates[j] ** 2
        return found

    return Suspect(torque, lambda s: f"the Coriolis term of rod {j + 1} in the equation of rod {i + 1} {_times(s)}")


def _times(s: float) -> str:
    """What a term is that is 1 + s times what it should be."""
    factor = 1.0 + s
    words = {-1.0: "has the wrong sign", 0.0: "is missing", 2.0: "counts twice", 0.5: "counts half"}
    for known, said in words.items():
        if abs(factor - known) < 1e-3:
            return said
    return f"is {factor:.6g} times what it should be"


def _suspects(n: int) -> Iterator[Suspect]:
    yield Suspect(_weight, lambda s: f"gravity {_times(s)}")
    yield Suspect(_coriolis, lambda s: f"the Coriolis terms: what the rods' turning does {_times(s)}")
    yield Suspect(
        lambda seen: mass_matrix(seen.scene, seen.scene.angles) @ seen.found,
        lambda s: f"time: every acceleration is {1 / (1 - s):.6g} times what it should be",
    )
    yield Suspect(
        _turning,
        lambda s: f"inertia about the wrong point: each link has {s:.4g} m l^2 more than its mass at its end has",
    )
    yield Suspect(lambda seen: -seen.scene.rates, lambda s: f"damping unasked: {s:.4g} N m s on each rod")
    yield Suspect(
        lambda seen: -mass_matrix(seen.scene, seen.scene.angles) @ seen.scene.rates,
        lambda s: f"damping unasked: every rate dies at {s:.4g} of itself a second",
    )
    yield Suspect(lambda seen: _between(seen.scene.rates), lambda s: f"damping unasked: {s:.4g} N m s in the joints")
    yield Suspect(
        lambda seen: _between(seen.scene.angles),
        lambda s: f"springs unasked: {s:.4g} N m in the joints",
    )
    yield from (_term(i, j) for i, j in product(range(n), range(n)) if i != j)


def _as_if(scene: Callable[[Scene], Scene]) -> Callable[[Seen], FloatArray]:
    return lambda seen: _right(Seen(scene(seen.scene), seen.found))


def _relative(seen: Seen) -> FloatArray:
    """The accelerations of one who takes absolute angles for those between the rods, and gives such, too."""
    scene = seen.scene
    return np.diff(
        _right(Seen(scene.with_start(np.cumsum(scene.angles), np.cumsum(scene.rates)), seen.found)), prepend=0.0
    )


def _flat(seen: Seen) -> FloatArray:
    scene = seen.scene
    weights = -weight_torques(scene, np.full(scene.n, 0.5 * np.pi)) * scene.angles
    return np.asarray(np.linalg.solve(mass_matrix(scene, scene.angles), _coriolis(seen) + weights), np.float64)


def _alone(seen: Seen) -> FloatArray:
    return _weight(seen) / np.diag(mass_matrix(seen.scene, seen.scene.angles))


_OTHERS: Final[dict[Callable[[Seen], FloatArray], str]] = {
    _relative: "angles are taken as relative to the rod before, where absolute ones are promised",
    _as_if(lambda scene: scene.with_(masses=scene.masses[::-1].copy())): "the masses are in the reverse order",
    _as_if(lambda scene: scene.with_(lengths=scene.lengths[::-1].copy())): "the lengths are in the reverse order",
    _as_if(lambda scene: scene.with_(masses=np.full(scene.n, scene.masses[0]))): "every mass is taken for the first",
    _as_if(
        lambda scene: scene.with_(lengths=np.full(scene.n, scene.lengths[0]))
    ): "every length is taken for the first",
    _as_if(lambda scene: scene.with_(lengths=0.5 * scene.lengths)): "the masses are in the middle of their rods",
    _flat: "small angles: the sine of an angle is taken for the angle",
    _alone: "each rod moves alone: the links are not coupled",
}
