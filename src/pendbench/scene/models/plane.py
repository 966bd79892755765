"""The planar chain in a compiled model: its links, its joints, and how they lie in the plane that they swing in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.scene.models.chain import PlanarChain
from pendbench.scene.models.custom import TIP, custom_number
from pendbench.scene.models.joint_map import JointMap

#: Axes that are this far from parallel, in rad, are taken for parallel: files write pi/2 with four digits.
PARALLEL: Final = 1e-5
#: A centre this far from the line between the joints, over the link's size, is rounding of what wrote the file.
ON_LINE: Final = 1e-9
#: A vector this small against what it is a part of is rounding.
NOTHING: Final = 1e-12

_OFF: Final = mujoco.mjtDisableBit


@dataclass(frozen=True, eq=False)
class Read:
    """A chain, and how the model's joint coordinates become its absolute angles.

    tilt: rad, how far the axes are from parallel at most; across: m/s^2, gravity along the axes.
    """

    chain: PlanarChain
    joints: JointMap
    tilt: float
    across: float


@dataclass(frozen=True, eq=False)
class _Plane:
    """The plane: right, up and towards who looks at it, unit vectors of the world; gravity in it and across, m/s^2."""

    right: FloatArray
    up: FloatArray
    normal: FloatArray
    gravity: float
    across: float

    def flat(self, vector: FloatArray) -> FloatArray:
        """A vector's parts right and up, (2,)."""
        return np.array([vector @ self.right, vector @ self.up])


@dataclass(frozen=True, eq=False)
class _Link:
    """A link in the reference pose: parts right and up, from its joint. inertia: about the centre of mass."""

    joint: int
    axis: FloatArray
    mass: float
    centre: FloatArray
    inertia: float
    next_joint: FloatArray | None


def read_chain(model: mujoco.MjModel) -> Read:
    """The chain that a compiled model holds.

    Raises `InputError`, a sentence, where its bodies and joints are not a planar chain of hinges.
    """
    heads = chain_bodies(model)
    turned = _orientations(model)
    axes = [turned[head] @ model.jnt_axis[model.body_jntadr[head]] for head in heads]
    tilt = max(math.asin(min(1.0, float(np.linalg.norm(np.cross(axes[0], axis))))) for axis in axes)
    if tilt > PARALLEL:
        worst = max(range(len(axes)), key=lambda i: float(np.linalg.norm(np.cross(axes[0], axes[i]))))
        raise InputError(f"the axis of {joint_name(model, heads[worst])} is not parallel to the first; {_PLANAR}")
    plane = _plane(model, axes[0])
    links = [_link(model, plane, turned, head, after) for head, after in zip(heads, [*heads[1:], None], strict=True)]
    return _assembled(model, plane, links, tilt)


_PLANAR: Final = "allowed: one chain of hinges with parallel axes"


def chain_bodies(model: mujoco.MjModel) -> list[int]:
    """The bodies with a joint, from the pivot outwards; what is welded to one of them belongs to its link."""
    _check_joints(model)
    heads = [int(body) for body in model.jnt_bodyid]
    after: dict[int, list[int]] = {}
    for head in heads:
        after.setdefault(int(model.body_weldid[model.body_parentid[head]]), []).append(head)
    for parent, children in after.items():
        if len(children) > 1:
            names = ", ".join(body_name(model, child) for child in children[:4])
            what = f"{len(children)} chains begin at the world: {names}"
            branches = f"{body_name(model, parent)} branches into {names}"
            raise InputError(f"{branches if parent else what}; {_PLANAR}")
    ordered, here = [], 0
    while here in after:
        here = after[here][0]
        ordered.append(here)
    return ordered


def _check_joints(model: mujoco.MjModel) -> None:
    if not model.njnt:
        raise InputError(f"nothing in it moves: it has no joint; {_PLANAR}")
    for joint, kind in enumerate(model.jnt_type):
        if kind != mujoco.mjtJoint.mjJNT_HINGE:
            name = mujoco.mjtJoint(kind).name.removeprefix("mjJNT_").lower()
            raise InputError(f"{_joint(model, joint)} is a {name} joint; {_PLANAR}")
    bodies, counts = np.unique(model.jnt_bodyid, return_counts=True)
    if counts.max() > 1:
        raise InputError(f"{body_name(model, int(bodies[counts.argmax()]))} has {counts.max()} joints; allowed: one")


def _orientations(model: mujoco.MjModel) -> dict[int, FloatArray]:
    """Of each body how it is turned in the world, (3, 3), in the reference pose."""
    turned: dict[int, FloatArray] = {0: np.eye(3)}
    for body in range(1, model.nbody):
        turned[body] = turned[int(model.body_parentid[body])] @ _matrix(model.body_quat[body])
    return turned


def _matrix(quaternion: FloatArray) -> FloatArray:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _plane(model: mujoco.MjModel, normal: FloatArray) -> _Plane:
    """The plane across the first joint's axis, with down where gravity points in it.

    Without gravity there, down is the world's -z where the plane has it, and else its -y.
    """
    pull = _pull(model)
    strength, across = float(np.linalg.norm(pull)), float(pull @ normal)
    flat = pull - across * normal
    gravity = float(np.linalg.norm(flat))
    if gravity <= NOTHING * strength or gravity == 0.0:
        gravity = 0.0
        flat = next(v for v in (_without(z, normal) for z in _DOWN) if np.linalg.norm(v) > 0.1)
    up = -flat / np.linalg.norm(flat)
    return _Plane(np.cross(up, normal), up, normal, gravity, across)


_DOWN: Final = (np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, 0.0]))


def _without(vector: FloatArray, normal: FloatArray) -> FloatArray:
    return np.asarray(vector - (vector @ normal) * normal)


def _pull(model: mujoco.MjModel) -> FloatArray:
    off = model.opt.disableflags & _OFF.mjDSBL_GRAVITY
    return np.zeros(3) if off else np.array(model.opt.gravity)


def _link(model: mujoco.MjModel, plane: _Plane, turned: dict[int, FloatArray], head: int, after: int | None) -> _Link:
    """The link of all bodies that are welded to one with a joint."""
    joint = int(model.body_jntadr[head])
    places = _welded(model, turned, head)
    hinge = turned[head] @ model.jnt_pos[joint]
    masses = np.array([model.body_mass[body] for body in places])
    centres = np.array([plane.flat(at + turned[body] @ model.body_ipos[body] - hinge) for body, at in places.items()])
    mass = float(masses.sum())
    centre = (masses / mass) @ centres
    apart = np.sum((centres - centre) ** 2, axis=1)
    inertia = float(masses @ apart) + sum(_inertia(model, plane, turned, body) for body in places)
    end = None
    if after is not None:
        at = places[int(model.body_parentid[after])] + turned[int(model.body_parentid[after])] @ model.body_pos[after]
        end = plane.flat(at + turned[after] @ model.jnt_pos[model.body_jntadr[after]] - hinge)
    return _Link(joint, turned[head] @ model.jnt_axis[joint], mass, centre, inertia, end)


def _welded(model: mujoco.MjModel, turned: dict[int, FloatArray], head: int) -> dict[int, FloatArray]:
    """The bodies welded to one, itself first, with their places from it along the world's axes, (3,) m."""
    places = {head: np.zeros(3)}
    for body in np.flatnonzero(model.body_weldid == head).tolist()[1:]:
        parent = int(model.body_parentid[body])
        places[body] = places[parent] + turned[parent] @ model.body_pos[body]
    return places


def _inertia(model: mujoco.MjModel, plane: _Plane, turned: dict[int, FloatArray], body: int) -> float:
    """Of one body about its own centre of mass and the plane's normal, kg m^2."""
    own = plane.normal @ turned[body] @ _matrix(model.body_iquat[body])
    return float(own**2 @ model.body_inertia[body])


def _assembled(model: mujoco.MjModel, plane: _Plane, links: Sequence[_Link], tilt: float) -> Read:
    lines = [_line(model, link) for link in links]
    directions = np.array([math.atan2(x, -y) for _, (x, y) in lines])
    bends = np.diff(directions, prepend=0.0)
    bends -= 2.0 * math.pi * np.round(bends / (2.0 * math.pi))
    signs = np.array([math.copysign(1.0, float(link.axis @ plane.normal)) for link in links])
    joints = [link.joint for link in links]
    dofs, coordinates = model.jnt_dofadr[joints], model.jnt_qposadr[joints]
    off = model.opt.disableflags
    damped, sprung = (not off & flag for flag in (_OFF.mjDSBL_DAMPER, _OFF.mjDSBL_SPRING))
    chain = PlanarChain(
        lengths=np.array([length for length, _ in lines]),
        masses=np.array([link.mass for link in links]),
        centres=np.array([link.centre @ line for link, (_, line) in zip(links, lines, strict=True)]),
        inertias=np.array([link.inertia for link in links]),
        damping=damped * np.array(model.dof_damping[dofs]),
        stiffness=sprung * np.array(model.jnt_stiffness[joints]),
        rests=bends + signs * (model.qpos_spring[coordinates] - model.qpos0[coordinates]),
        armature=np.array(model.dof_armature[dofs]),
        gravity=plane.gravity,
    )
    joint_map = JointMap(signs, np.array(model.qpos0[coordinates]), np.cumsum(bends))
    return Read(chain, joint_map, tilt, plane.across)


def _line(model: mujoco.MjModel, link: _Link) -> tuple[float, FloatArray]:
    """A link's length, m, and its direction in the plane, a unit vector (2,)."""
    if link.next_joint is None:
        return _last_line(model, link)
    length = float(np.linalg.norm(link.next_joint))
    if length < NOTHING:
        raise InputError(f"{_joint(model, link.joint)} and the next one are at the same place; {_PLANAR}")
    line = link.next_joint / length
    off = float(abs(line[0] * link.centre[1] - line[1] * link.centre[0]))
    if off > ON_LINE * max(length, float(np.linalg.norm(link.centre))):
        raise InputError(
            f"the centre of mass of {body_name(model, int(model.jnt_bodyid[link.joint]))} is {off:.3g} m beside the "
            "line from its joint to the next; allowed: on that line, but for the last link"
        )
    return length, line


def _last_line(model: mujoco.MjModel, link: _Link) -> tuple[float, FloatArray]:
    """The last link's line is drawn through its centre of mass; its tip is where the file says, or where it looks like.

    A point is its own tip, and a uniform rod is twice as long as its centre is away. So is anything else, but for
    flywheels, which end at the radius of gyration: how long the last link is does not change its motion.
    """
    centre = float(np.linalg.norm(link.centre))
    about_centre = link.inertia / link.mass
    gyration = math.sqrt(about_centre)
    told = custom_number(model, TIP, 0.0)
    if centre <= NOTHING * gyration or centre == 0.0:
        return told or gyration, np.array([0.0, -1.0])
    line = link.centre / centre
    length = centre if about_centre <= NOTHING * centre**2 else max(2.0 * centre, gyration)
    return told or length, line


def body_name(model: mujoco.MjModel, body: int) -> str:
    """A body for a message: its name, or its number where it has none."""
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)
    return f"body {name!r}" if name else f"body number {body}"


def joint_name(model: mujoco.MjModel, body: int) -> str:
    """A body's joint for a message."""
    return _joint(model, int(model.body_jntadr[body]))


def _joint(model: mujoco.MjModel, joint: int) -> str:
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, joint)
    return f"joint {name!r}" if name else f"the joint of {body_name(model, int(model.jnt_bodyid[joint]))}"
