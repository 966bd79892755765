"""What joints and air do to the masses, each in the frame of its own rod: along it, and across it.

A torque on a rod is a pair of forces across it at its ends (docs/equations.md, (E43)), so that the recursion knows
forces on masses and nothing else.
"""

from __future__ import annotations

from typing import Any

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import chosen_by_type, inlined
from pendbench.physics.kernels import laws
from pendbench.physics.kernels.scratch import FORCE_ACROSS, FORCE_ALONG, TORQUE
from pendbench.solvers.trigonometry import direction


def write_forces(system: Any, t: float, theta: FloatArray, omega: FloatArray, cosine: int, sine: int) -> None:
    """Write the forces on the masses (n,) N into the scratch; the bends' cosines and sines are in two of its rows."""
    raise NotImplementedError


@chosen_by_type(write_forces)
def _choose_forces(system: Any, t: Any, theta: Any, omega: Any, cosine: Any, sine: Any) -> Any:  # noqa: ARG001
    """Nothing, where nothing pushes: a caller's test of that is compiled only when all that it guards has been."""
    kinds = dict(zip(system.fields, system.types, strict=True))
    if len(kinds["joints"]) + len(kinds["drags"]) == 0:
        return lambda system, t, theta, omega, cosine, sine: None  # noqa: ARG005
    return _write_forces


def _write_forces(system: Any, t: float, theta: FloatArray, omega: FloatArray, cosine: int, sine: int) -> None:
    scratch, tip = system.scratch, len(system.lengths) - 1
    scratch[cosine, tip], scratch[sine, tip] = 1.0, 0.0
    if len(system.drags) > 0:
        _write_drag(system, t, theta, omega, cosine, sine)
    else:
        for i in range(tip + 1):
            scratch[FORCE_ALONG, i], scratch[FORCE_ACROSS, i] = 0.0, 0.0
    if len(system.joints) > 0:
        _write_torques(system, t, theta, omega)
        _add_couples(system.lengths, scratch[TORQUE], scratch, cosine, sine)


@inlined
def _write_drag(system: Any, t: float, theta: FloatArray, omega: FloatArray, cosine: int, sine: int) -> None:
    lengths, scratch = system.lengths, system.scratch
    along, across = 0.0, 0.0
    if len(system.pivots) > 0:
        u, v = laws.pivot_velocity(system.pivots, t)
        c, s = direction(theta[0])
        along, across = s * u - c * v, c * u + s * v
    for i in range(len(lengths)):
        across = across + lengths[i] * omega[i]
        scratch[FORCE_ALONG, i], scratch[FORCE_ACROSS, i] = along, across
        c, s = scratch[cosine, i], scratch[sine, i]
        along, across = c * along + s * across, c * across - s * along
    for i in range(len(lengths)):
        scratch[FORCE_ALONG, i], scratch[FORCE_ACROSS, i] = laws.drag(
            system.drags, i, scratch[FORCE_ALONG, i], scratch[FORCE_ACROSS, i]
        )


@inlined
def _write_torques(system: Any, t: float, theta: FloatArray, omega: FloatArray) -> None:
    """Write the torque on each rod (n,) N m into the scratch: of its own joint, less that of the next one."""
    torques = system.scratch[TORQUE]
    drives = laws.drives(system.joints, t)
    torques[0] = laws.joint_torque(system.joints, drives, 0, theta[0], omega[0])
    for i in range(1, len(theta)):
        torques[i] = laws.joint_torque(system.joints, drives, i, theta[i] - theta[i - 1], omega[i] - omega[i - 1])
    for i in range(len(theta) - 1):
        torques[i] -= torques[i + 1]


@inlined
def _add_couples(lengths: FloatArray, torques: FloatArray, scratch: FloatArray, cosine: int, sine: int) -> None:
    """Add the forces at the rods' ends that do what the torques (n,) N m do."""
    tip = len(lengths) - 1
    for i in range(tip):
        outer = torques[i + 1] / lengths[i + 1]
        scratch[FORCE_ALONG, i] += scratch[sine, i] * outer
        scratch[FORCE_ACROSS, i] += torques[i] / lengths[i] - scratch[cosine, i] * outer
    scratch[FORCE_ACROSS, tip] += torques[tip] / lengths[tip]


@inlined
def write_couples(lengths: FloatArray, torques: FloatArray, scratch: FloatArray, cosine: int, sine: int) -> None:
    """Write into the scratch the forces on the masses that do what torques (n,) N m on the rods do."""
    for i in range(len(lengths)):
        scratch[FORCE_ALONG, i], scratch[FORCE_ACROSS, i] = 0.0, 0.0
    _add_couples(lengths, torques, scratch, cosine, sine)
