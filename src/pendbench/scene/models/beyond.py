"""What a model holds beyond a chain: what acts, and so is refused, and what is left out, for it acts on nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import mujoco
import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.scene.models.start import Start

_OFF: Final = mujoco.mjtDisableBit
#: Sizes of a compiled model that say how many things it has which are seen or read, and push nothing.
_SEEN: Final = {
    "nlight": "lights",
    "ncam": "cameras",
    "nsite": "sites",
    "nsensor": "sensors",
    "nskin": "skins",
    "nmat": "materials",
    "ntex": "textures",
    "nexclude": "excluded pairs",
}


def refused(model: mujoco.MjModel, start: Start) -> Iterator[str]:
    """What acts on the chain and is in no scene, a line each."""
    for acts, line in (
        (_is_on(model, "EQUALITY") and np.any(model.eq_active0), "equality constraints"),
        (_is_on(model, "FRICTIONLOSS") and np.any(model.dof_frictionloss), "friction loss of joints"),
        (model.opt.density or model.opt.viscosity, "a fluid (option density or viscosity)"),
        (np.any(model.body_gravcomp), "gravity compensation (gravcomp)"),
        (np.any(model.jnt_stiffnesspoly), "springs that are not linear"),
        (np.any(model.dof_dampingpoly), "damping that is not linear"),
        (np.any(model.jnt_springyield), "springs that yield"),
        (model.nflex, "flexible bodies"),
        (model.nplugin, "plugins"),
        (_carries_mocap(model), "a chain that hangs at a mocap body"),
    ):
        if acts:
            yield f"{line}: no scene has these yet"
    for tendon in range(model.ntendon):
        if _pulls(model, tendon):
            yield f"{_named(model, 'TENDON', tendon)} pulls at the chain: no scene has these yet"
    for actuator in range(model.nu):
        if _is_used(model, start, actuator):
            yield f"{_named(model, 'ACTUATOR', actuator)} is in use: it pushes with its control at {_control(start)}"


def left_out(model: mujoco.MjModel, start: Start, heads: Sequence[int]) -> Iterator[str]:
    """What acts on nothing here, a line each."""
    for size, name in _SEEN.items():
        if count := getattr(model, size):
            yield f"{_count(count, name)}: left out, nothing is moved by what is seen or read"
    if idle := [i for i in range(model.nu) if not _is_used(model, start, i)]:
        yield f"{_count(len(idle), 'actuators')}: left out, nothing is pushed while its control is 0"
    if count := sum(not _pulls(model, i) for i in range(model.ntendon)):
        yield f"{_count(count, 'tendons')}: left out, nothing is pulled at"
    if model.neq and not (_is_on(model, "EQUALITY") and np.any(model.eq_active0)):
        yield f"{_count(model.neq, 'equality constraints')}: left out, the file has them off"
    if np.any(model.dof_frictionloss) and not _is_on(model, "FRICTIONLOSS"):
        yield "friction loss: left out, the file has it off"
    moving = model.body_weldid[model.geom_bodyid] > 0
    if count := int(np.sum(moving & (model.geom_contype == 0) & (model.geom_conaffinity == 0))):
        yield f"{_count(count, 'geoms')}: left out but for what they weigh, nothing can touch them"
    fixed = [body for body in range(1, model.nbody) if model.body_weldid[body] == 0]
    if fixed:
        yield f"{_count(len(fixed), 'bodies')} that cannot move: left out"
    if welded := model.nbody - 1 - len(fixed) - len(heads):
        yield f"{_count(welded, 'bodies')} without a joint: merged into the links that they are welded to"
    if others := model.nkey - (start.keyframe is not None):
        yield f"{_count(others, 'other keyframes')}: left out"
    yield from _switched_off(model)


def _switched_off(model: mujoco.MjModel) -> Iterator[str]:
    for flag, values in (
        ("SPRING", model.jnt_stiffness),
        ("DAMPER", model.dof_damping),
        ("GRAVITY", model.opt.gravity),
    ):
        if np.any(values) and not _is_on(model, flag, constraint=False):
            yield f"{flag.lower()}: left out, the file disables it"


def _is_on(model: mujoco.MjModel, flag: str, *, constraint: bool = True) -> bool:
    """Whether the model does not disable a thing; constraints can be disabled all together."""
    flags = int(getattr(_OFF, f"mjDSBL_{flag}")) | (int(_OFF.mjDSBL_CONSTRAINT) if constraint else 0)
    return not model.opt.disableflags & flags


def _pulls(model: mujoco.MjModel, tendon: int) -> bool:
    """Whether a tendon does anything by itself; what pulls through it is an actuator."""
    own = [model.tendon_stiffness, model.tendon_damping, model.tendon_armature, model.tendon_stiffnesspoly]
    own += [model.tendon_dampingpoly, *([model.tendon_frictionloss] if _is_on(model, "FRICTIONLOSS") else [])]
    limited = _is_on(model, "LIMIT") and model.tendon_limited[tendon]
    return bool(limited or any(np.any(values[tendon]) for values in own))


def _is_used(model: mujoco.MjModel, start: Start, actuator: int) -> bool:
    """Whether an actuator pushes, brakes or weighs though nobody controls it."""
    weighs = [model.actuator_armature, model.actuator_damping, model.actuator_dampingpoly]
    if any(np.any(values[actuator]) for values in weighs):
        return True
    if not _is_on(model, "ACTUATION", constraint=False):
        return False
    pushes = model.actuator_biastype[actuator] != mujoco.mjtBias.mjBIAS_NONE and np.any(
        model.actuator_biasprm[actuator]
    )
    user = model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_MUSCLE
    return bool(pushes or user or np.any(_applied(model, start, actuator)) or np.any(start.activations))


def _applied(model: mujoco.MjModel, start: Start, actuator: int) -> FloatArray:
    """The controls of an actuator as its range lets them through."""
    first, count = int(model.actuator_ctrladr[actuator]), int(model.actuator_ctrlnum[actuator])
    controls = start.controls[first : first + count]
    if model.actuator_ctrllimited[first : first + count].any() and _is_on(model, "CLAMPCTRL", constraint=False):
        low, high = model.actuator_ctrlrange[first : first + count].T
        return np.asarray(
            np.where(model.actuator_ctrllimited[first : first + count], controls.clip(low, high), controls)
        )
    return controls


def _control(start: Start) -> str:
    return "what the keyframe says" if start.controls.any() else "0"


def _carries_mocap(model: mujoco.MjModel) -> bool:
    """Whether the chain's pivot is on a body that a program moves."""
    body = int(model.body_parentid[int(model.jnt_bodyid[0])])
    while body and model.body_mocapid[body] < 0:
        body = int(model.body_parentid[body])
    return bool(body)


def _count(count: int, names: str) -> str:
    if count != 1:
        return f"{count} {names}"
    return f"1 {names[:-3]}y" if names.endswith("ies") else f"1 {names.removesuffix('s')}"


def _named(model: mujoco.MjModel, kind: str, number: int) -> str:
    name = mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), number)
    return f"{kind.lower()} {name!r}" if name else f"{kind.lower()} number {number + 1}"
