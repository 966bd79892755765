"""Energy, angular momentum and tensions, from the positions and velocities of the masses.

Never from an engine, and never from the matrices of the equations of motion: these are what they are checked with.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.physics import acting, dense
from pendbench.physics.geometry import TURN, positions, velocities
from pendbench.scene.scene import Scene, load_scene


def energy(scene: Scene | str, theta: npt.ArrayLike, omega: npt.ArrayLike) -> FloatArray:
    """Kinetic plus potential energy, (...,) J; that of the weight is zero at the pivot. equations.md (E3), (E4), (E41).

    Where the pivot is driven, this is the energy for someone who rides on it. scene: a `Scene`, or the name or path of
    one. theta: (..., n) rad; omega: (..., n) rad/s. Raises InputError where the two have other shapes than that.

    >>> import pendbench as pb
    >>> scene = pb.Scene.chain(n=1, length=2.0, mass=3.0, angles=0.0, gravity=10.0)
    >>> float(pb.energy(scene, [0.0], [1.0]))  # 3 kg, 2 m below the pivot, at 2 m/s
    -54.0
    """
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    theta, omega = np.asarray(theta, np.float64), np.asarray(omega, np.float64)
    if theta.shape != omega.shape or theta.shape[-1:] != (scene.n,):
        raise InputError(f"theta {theta.shape} and omega {omega.shape}; allowed: the same shape, (..., {scene.n})")
    return kinetic_energy(scene, theta, omega) + potential_energy(scene, theta)


def kinetic_energy(scene: Scene, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """That of masses, links and rotors, (...,) J: a sum of squares, so it never cancels. (E3), (E53), (E55)."""
    speeds = velocities(scene.lengths, theta, omega)
    total = 0.5 * np.sum(scene.masses * np.sum(speeds**2, axis=-1), axis=-1)
    if acting.has_links(scene):
        its = acting.links(scene)
        inner = np.concatenate([np.zeros_like(speeds[..., :1, :]), speeds[..., :-1, :]], axis=-2)
        share = (its.centre / scene.lengths)[:, np.newaxis]
        centres = np.sum((inner + share * (speeds - inner)) ** 2, axis=-1)
        total += 0.5 * np.sum(its.mass * centres + its.inertia * omega**2, axis=-1)
    return np.asarray(total + 0.5 * np.sum(acting.rotor_inertias(scene) * acting.bends(omega) ** 2, axis=-1))


def potential_energy(scene: Scene, theta: FloatArray) -> FloatArray:
    """The weight's energy and that of the joints' springs, (...,) J; zero without either. equations.md (E4), (E41)."""
    return acting.mass_potential(scene, positions(scene.lengths, theta)) + acting.joint_potential(scene, theta)


def energy_scale(scene: Scene) -> float:
    """What energy drift is measured against, J. equations.md (E21).

    The full range of the weight's potential, or where one of these is larger, the energy of motion and springs at the
    start, or what constant torques do in a turn. It is 0 for a chain at rest that nothing pulls at: no energy is at
    stake there, and a relative drift has no meaning.
    """
    gravity = scene.effects.gravity or 0.0
    potential_range = 2.0 * gravity * float(np.abs(dense.hanging_masses(acting.lumped_masses(scene))) @ scene.lengths)
    springs = float(acting.joint_potential(scene.without("joint_torque"), scene.angles))
    turn = TURN * float(np.abs(np.broadcast_to(scene.effects.joint_torque or 0.0, scene.n)).sum())
    return max(potential_range, float(kinetic_energy(scene, scene.angles, scene.rates)) + springs, turn)


def angular_momentum(scene: Scene, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """Angular momentum about the pivot, (...,) kg m^2/s, counter-clockwise positive. (E5), (E53), (E55).

    theta: (..., n) rad; omega: (..., n) rad/s. Without gravity it is conserved.
    """
    place = positions(scene.lengths, theta)
    speed = velocities(scene.lengths, theta, omega)
    turning = place[..., 0] * speed[..., 1] - place[..., 1] * speed[..., 0]
    spinning = acting.link_inertias(scene) * omega
    rotor = acting.rotor_inertias(scene)[0] * omega[..., 0]  # the others turn with one link and against another
    return np.asarray(np.sum(acting.lumped_masses(scene) * turning + spinning, axis=-1) + rotor)


def tensions(scene: Scene, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """How hard each rod pulls, (n,) N; negative where it pushes. equations.md (E20).

    theta: (n,) rad; omega: (n,) rad/s. From the dense accelerations; raises as `dense.accelerations` does.
    """
    along = np.stack([np.sin(theta), -np.cos(theta)], axis=-1)
    return np.asarray(np.sum(along * rod_forces(scene, theta, omega), axis=-1))


def rod_forces(scene: Scene, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """The force that rod i passes inwards, (n, 2) N: Newton's second law for all the masses from i outwards, together.

    theta: (n,) rad; omega: (n,) rad/s. A massless rod can pass force only along itself, so the part of it across the
    rod is zero exactly when the accelerations are right. equations.md (E20).
    """
    acting.check_plain(scene, "the rods' force by (E20)")
    below_free_fall = -_accelerations_against_free_fall(scene, theta, omega)
    weighed = scene.masses[:, np.newaxis] * below_free_fall
    return np.cumsum(weighed[::-1], axis=0)[::-1]


def _accelerations_against_free_fall(scene: Scene, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """a'_i = a_i + (0, g), (n, 2) m/s^2. equations.md (E11)."""
    turning = scene.lengths * dense.accelerations(scene, theta, omega)
    centripetal = scene.lengths * omega**2
    sin, cos = np.sin(theta), np.cos(theta)
    steps = np.stack([turning * cos - centripetal * sin, turning * sin + centripetal * cos], axis=-1)
    gravity = scene.effects.gravity or 0.0
    return np.asarray(np.cumsum(steps, axis=0) + np.array([0.0, gravity]))
