"""The effects of a scene in matrices: their laws for whole arrays, and what the dense form, energy and power need.

Arrays are (..., n); what depends on the time takes it as t s, a number or an array (...).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.physics.geometry import side_by_side, velocities
from pendbench.scene.links import Links
from pendbench.scene.scene import Scene


def _with(scene: Scene, law: str) -> list[Any]:
    return [term for term in scene.terms.values() if hasattr(term, law)]


def links(scene: Scene) -> Links:
    """What each link weighs beside the point at its end: the scene's rigid links, or uniform rods of some mass or none.

    equations.md (E53).
    """
    if scene.links is not None:
        return scene.links
    masses = np.sum([np.zeros(scene.n), *(term.rod_masses(term) for term in _with(scene, "rod_masses"))], axis=0)
    return Links(masses, 0.5 * scene.lengths, masses * scene.lengths**2 / 12.0)


def has_links(scene: Scene) -> bool:
    """Whether there is more than points on massless rods."""
    return scene.links is not None or bool(_with(scene, "rod_masses"))


def lumped_masses(scene: Scene) -> FloatArray:
    """The masses (n,) kg with a share of each link at each of its ends, as its centre is near. equations.md (E53)."""
    its = links(scene)
    outer = its.mass * (its.centre / scene.lengths)
    inner = its.mass * ((scene.lengths - its.centre) / scene.lengths)
    return np.asarray(scene.masses + outer + np.append(inner[1:], 0.0))


def link_inertias(scene: Scene) -> FloatArray:
    """What links with their masses at their ends lack on C's diagonal, (n,) kg m^2; often negative. (E53)."""
    its = links(scene)
    return np.asarray(its.inertia - its.mass * its.centre * (scene.lengths - its.centre))


def rotor_inertias(scene: Scene) -> FloatArray:
    """The rotors' inertias in the joints, (n,) kg m^2. equations.md (E55)."""
    rotors = [term.rotor_inertias(term) for term in _with(scene, "rotor_inertias")]
    return np.asarray(np.sum([np.zeros(scene.n), *rotors], axis=0))


def bends(angles: FloatArray) -> FloatArray:
    """Each rod's angle or rate (..., n) against the rod before it, the first's against the vertical."""
    between = np.array(angles)  # np.diff() takes four times as long for a short chain
    between[..., 1:] -= angles[..., :-1]
    return between


def pivot_acceleration(scene: Scene, t: npt.ArrayLike) -> FloatArray:
    """The pivot's acceleration against free fall, (..., 2) m/s^2. equations.md (E37)."""
    return _pivot(_with(scene, "pivot_acceleration"), t)


def pivot_position(scene: Scene, t: npt.ArrayLike) -> FloatArray:
    """Where the pivot is, (..., 2) m: at the origin where nothing drives it. t: (...,) s. equations.md (E37)."""
    return _pivot(_with(scene, "pivot_position"), t, "pivot_position")


def pivot_velocity(scene: Scene, t: npt.ArrayLike) -> FloatArray:
    """The pivot's velocity through the air, (..., 2) m/s. equations.md (E37)."""
    return _pivot(_with(scene, "pivot_velocity"), t, "pivot_velocity")


def _pivot(terms: list[Any], t: npt.ArrayLike, law: str = "pivot_acceleration") -> FloatArray:
    t = t if isinstance(t, float) else np.asarray(t, np.float64)  # of a float, numpy would take three times as long
    parts = [getattr(term, law)(term, t) for term in terms]
    return side_by_side(np.shape(t), sum(x for x, _ in parts), sum(y for _, y in parts))


def joint_torques(scene: Scene, t: npt.ArrayLike, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """The torque in each joint, (..., n) N m: on its rod, and the opposite on the rod before. equations.md (E38)."""
    return _torques(_with(scene, "joint_torque"), t, theta, omega)


def _torques(terms: list[Any], t: npt.ArrayLike, theta: FloatArray, omega: FloatArray) -> FloatArray:
    total = np.zeros(np.shape(theta))
    if not terms:
        return total
    bend, rate, t = bends(theta), bends(omega), np.asarray(t, np.float64)
    for term in terms:
        drive = term.drive(term, t)[..., np.newaxis] if hasattr(term, "drive") else 0.0
        total += term.joint_torque(term, drive, ..., bend, rate)
    return total


def drag_forces(scene: Scene, t: npt.ArrayLike, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """The air's force on each mass, (..., n, 2) N. equations.md (E39)."""
    terms = _with(scene, "drag")
    total = np.zeros((*np.shape(theta), 2))
    if not terms:
        return total
    speed = velocities(scene.lengths, theta, omega) + pivot_velocity(scene, t)[..., np.newaxis, :]
    for term in terms:
        x, y = term.drag(term, ..., speed[..., 0], speed[..., 1])
        total[..., 0] += x
        total[..., 1] += y
    return total


def generalized_forces(scene: Scene, t: npt.ArrayLike, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """What joints and air do to each rod's angle, (..., n) N m. equations.md (E40)."""
    joints = joint_torques(scene, t, theta, omega)
    total = np.array(joints)
    total[..., :-1] -= joints[..., 1:]
    if _with(scene, "drag"):
        forces = drag_forces(scene, t, theta, omega)
        pulled = np.cumsum(forces[..., ::-1, :], axis=-2)[..., ::-1, :]
        total += scene.lengths * (np.cos(theta) * pulled[..., 0] + np.sin(theta) * pulled[..., 1])
    return total


def mass_forces(scene: Scene, t: float, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """The forces on the masses, (n, 2) N, that do what joints and air do to the chain. equations.md (E39), (E43)."""
    joints, total = joint_torques(scene, t, theta, omega), drag_forces(scene, t, theta, omega)
    couples = joints.copy()
    couples[:-1] -= joints[1:]
    couples /= scene.lengths
    pairs = side_by_side(np.shape(theta), couples * np.cos(theta), couples * np.sin(theta))
    total += pairs
    total[:-1] -= pairs[1:]
    return total


def joint_potential(scene: Scene, theta: FloatArray) -> FloatArray:
    """The energy in the joints, (...,) J. equations.md (E41)."""
    bend = bends(theta)
    parts = [term.joint_potential(term, ..., bend) for term in _with(scene, "joint_potential")]
    return np.asarray(np.sum(parts, axis=(0, -1)) if parts else np.zeros(np.shape(theta)[:-1]))


def power(scene: Scene, t: npt.ArrayLike, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """What the effects without a potential do, (...,) W: the rate of `energy`. equations.md (E42).

    t: (...,) s; theta, omega: (..., n). A driven pivot does the work of the forces of inertia in its frame.
    """
    without = [term for term in _with(scene, "joint_torque") if not hasattr(term, "joint_potential")]
    speed = velocities(scene.lengths, theta, omega)
    shaking = _pivot([term for term in _with(scene, "pivot_acceleration") if not hasattr(term, "mass_potential")], t)
    shaken = shaking[..., np.newaxis, :] * lumped_masses(scene)[:, np.newaxis]
    forces = drag_forces(scene, t, theta, omega) - shaken
    torques = _torques(without, t, theta, omega)
    return np.asarray(np.sum(forces * speed, axis=(-1, -2)) + np.sum(torques * bends(omega), axis=-1))


def mass_potential(scene: Scene, places: FloatArray) -> FloatArray:
    """The weight's energy, (...,) J, with the masses at (..., n, 2) m from the pivot. equations.md (E4)."""
    total = np.zeros(places.shape[:-1])
    for term in _with(scene, "mass_potential"):
        total += term.mass_potential(term, places[..., 0], places[..., 1])
    return np.asarray(np.sum(lumped_masses(scene) * total, axis=-1))


def is_pulled(scene: Scene) -> bool:
    """Whether the pivot accelerates against free fall: under gravity, for one."""
    return bool(_with(scene, "pivot_acceleration"))


def is_shaken(scene: Scene) -> bool:
    """Whether the pivot's acceleration changes with time: a constant one has a potential."""
    return any(not hasattr(term, "mass_potential") for term in _with(scene, "pivot_acceleration"))


def is_pushed(scene: Scene) -> bool:
    """Whether joints or air push the chain."""
    return bool(_with(scene, "joint_torque") or _with(scene, "drag"))


def is_plain(scene: Scene) -> bool:
    """Whether nothing acts but gravity."""
    return scene.terms.keys() <= {"gravity"}


def check_plain(scene: Scene, what: str) -> None:
    """Raise InputError where more than gravity acts, which `what` does not know of."""
    if not is_plain(scene):
        others = ", ".join(name for name in scene.terms if name != "gravity")
        raise InputError(f"scene {scene.name!r} calls for {others}; allowed: gravity, which is all that {what} knows")
