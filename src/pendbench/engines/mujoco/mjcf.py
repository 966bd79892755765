"""A scene as a MuJoCo model: built through the model-editing API, or written as an MJCF file.

MuJoCo has no point masses on massless rods: the compiler wants a rotational inertia of every body. Each body gets the
smallest one that is accepted, and masses in a unit that makes the smallest m l^2 at least 1, so that this inertia
biases the motion by rounding only. `compile_chain` takes the rest of it out as well; a file cannot.

``python -m pendbench.engines.mujoco.mjcf`` writes the files of all bundled scenes again, into models/mjcf.
"""

from __future__ import annotations

import math
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

import mujoco
import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError, printable
from pendbench.engines.joints import bodies, joint_values
from pendbench.physics import acting
from pendbench.scene.models.alone import alone
from pendbench.scene.models.custom import DURATION, MASS_UNIT, TIP, TITLE
from pendbench.scene.scene import Scene

#: The compiler refuses anything smaller (probed with MuJoCo 4.0.0).
INERTIA: Final = float(mujoco.mjMINVAL)
#: The parser refuses bodies nested deeper (probed with MuJoCo 4.0.0). A model built through the API can be deeper.
DEEPEST_FILE: Final = 496

#: Swinging in the plane x-z, counter-clockwise positive for someone who has x to the right and z up.
_AXIS: Final = (0.0, -1.0, 0.0)
#: Of these a release knows some: before 3.3 "passive" stood for springs and dampers, and nothing for "autoreset".
_DISABLED: Final = tuple(
    name
    for name in ("constraint", "contact", "passive", "spring", "damper", "actuation", "sensor", "autoreset", "gravity")
    if hasattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}")
)
#: Earlier releases have another model-editing API, or none: there a model is read as a file is.
_EDITS: Final = tuple(map(int, mujoco.__version__.split(".")[:2])) >= (3, 7)
#: The effects that a model holds, and what each needs of these. The others want forces computed while it runs.
HELD: Final[Mapping[str, tuple[str, ...]]] = {
    "gravity": (),
    "joint_damping": ("damper",),
    "joint_stiffness": ("spring",),
    "joint_rest": (),
    "rod_mass": (),
    "armature": (),
    "links": (),
}
# Without springs and dampers MuJoCo does not ask for a user's passive forces either.
_ASKS: Final = ("spring", "damper")
_FILE_DT: Final = 1e-3
# What MuJoCo sets aside by itself is too little for its implicit integrators from some 500 links on; 200 n^2 is enough.
_MEMORY: Final = (16_000_000, 256)

_COMMENT: Final = """
  Written by `python -m pendbench.engines.mujoco.mjcf`; do not edit.
  Masses are in a unit that makes the smallest inertia m l^2 at least 1 (the motion does not depend on it). MuJoCo wants
  an inertia of every body: {advice}.
  The start is the keyframe "start". The rods are drawn, and neither weigh nor touch anything.
"""
_LIGHT: Final = "for point masses, set model.body_inertia[1:] = 0 after loading"
_HEAVY: Final = f"that of the rods has {INERTIA:g} too much, which rounding hides"


def chain_spec(scene: Scene) -> mujoco.MjSpec:
    """The chain as a MuJoCo model that can be edited further; `compile_chain` makes point masses of it.

    Effects that a model cannot hold (not in `HELD`) are left to the adapter. A body's frame is at its joint, so that
    joint angles are those between neighbouring rods, 0 for a hanging chain.
    """
    spec = mujoco.MjSpec()
    spec.modelname = printable(scene.name)
    spec.option.gravity = _weight(scene)
    spec.memory = _MEMORY[0] + _MEMORY[1] * scene.n**2
    spec.option.disableflags = sum(int(_flag(name)) for name in _disabled(scene))
    spec.compiler.degree = False
    body, hangs_at = spec.worldbody, 0.0
    for i, link in enumerate(_links(scene), start=1):
        body = body.add_body(
            name=f"link{i}",
            pos=(0.0, 0.0, -hangs_at),
            mass=link.mass,
            ipos=(0.0, 0.0, -link.centre),
            inertia=[link.inertia + INERTIA] * 3,
            explicitinertial=True,
        )
        body.add_joint(
            name=f"joint{i}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=_AXIS,
            damping=[link.damping],
            stiffness=[link.stiffness],
            springref=link.springref,
            armature=link.armature,
        )
        hangs_at = link.length
    return spec


def compile_chain(scene: Scene) -> mujoco.MjModel:
    """The chain as a compiled model, of point masses but for the rods' own inertia.

    What MuJoCo warns about here it counts again at the first step.
    """
    with alone(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = chain_spec(scene).compile() if _EDITS else mujoco.MjModel.from_xml_string(_document(scene, drawn=False))
    model.body_inertia[1:] = [[link.inertia] * 3 for link in _links(scene)]
    return model


def write_mjcf(scene: Scene) -> str:
    """The scene as the text of an MJCF file, with its start as the keyframe "start".

    MuJoCo's own writer keeps six digits, too few for the same motion; here every number reads back as it was.

    Raises `InputError` for chains of more than `DEEPEST_FILE` links, and for effects that no file can hold.
    """
    if scene.n > DEEPEST_FILE:
        raise InputError(f"scene {scene.name!r} has {scene.n} links; allowed in an MJCF file: at most {DEEPEST_FILE}")
    if forced := [name for name in scene.terms if name not in HELD]:
        raise InputError(f"scene {scene.name!r} calls for {forced[0]}, which an MJCF file cannot hold")
    return _document(scene)


def _document(scene: Scene, *, drawn: bool = True) -> str:
    """The text of a file, of the effects that it can hold."""
    root = ET.Element("mujoco", model=printable(scene.name))
    root.append(ET.Comment(_COMMENT.format(advice=_HEAVY if acting.has_links(scene) else _LIGHT)))
    _add_options(root, scene)
    _add_custom(ET.SubElement(root, "custom"), scene)
    _add_links(ET.SubElement(root, "worldbody"), scene, drawn)
    qpos, qvel = _text(joint_values(scene.angles)), _text(joint_values(scene.rates))
    ET.SubElement(ET.SubElement(root, "keyframe"), "key", name="start", qpos=qpos, qvel=qvel)
    ET.indent(root, space=" ")
    return ET.tostring(root, encoding="unicode") + "\n"


def fits_file(scene: Scene) -> bool:
    """Whether `write_mjcf` can write the scene."""
    return scene.n <= DEEPEST_FILE and scene.terms.keys() <= HELD.keys()


def _weight(scene: Scene) -> tuple[float, float, float]:
    """What a mass weighs at the start in the pivot's frame, over that mass."""
    x, y = acting.pivot_acceleration(scene, 0.0).tolist()
    return 0.0 - x, 0.0, 0.0 - y


def _add_options(root: ET.Element, scene: Scene) -> None:
    ET.SubElement(root, "compiler", angle="radian")
    gravity = _text(_weight(scene))
    option = ET.SubElement(root, "option", timestep=_text([_FILE_DT]), integrator="RK4", gravity=gravity)
    ET.SubElement(option, "flag", dict.fromkeys(_disabled(scene), "disable"))
    rods = ET.SubElement(ET.SubElement(root, "default"), "geom")
    rods.attrib.update(type="capsule", size=_text([scene.total_length / 100]), mass="0", contype="0", conaffinity="0")


def _add_custom(parent: ET.Element, scene: Scene) -> None:
    """What a scene has and a model has not, for whoever reads the file as a scene."""
    ET.SubElement(parent, "text", name=TITLE, data=printable(scene.title))
    ET.SubElement(parent, "numeric", name=DURATION, data=_text([scene.duration]))
    ET.SubElement(parent, "numeric", name=TIP, data=_text([scene.lengths[-1]]))
    ET.SubElement(parent, "numeric", name=MASS_UNIT, data=_text([mass_unit(scene)]))


def _add_links(parent: ET.Element, scene: Scene, drawn: bool) -> None:
    hangs_at = 0.0
    for i, link in enumerate(_links(scene), start=1):
        parent = ET.SubElement(parent, "body", name=f"link{i}", pos=_text((0.0, 0.0, -hangs_at)))
        inertia = _text([link.inertia + INERTIA] * 3)
        inertial = {"pos": _text((0.0, 0.0, -link.centre)), "mass": _text([link.mass]), "diaginertia": inertia}
        ET.SubElement(parent, "inertial", inertial)
        joint = ET.SubElement(parent, "joint", name=f"joint{i}", axis=_text(_AXIS))
        for name in ("damping", "stiffness", "springref", "armature"):
            if value := getattr(link, name):
                joint.set(name, _text([value]))
        if drawn:
            ET.SubElement(parent, "geom", fromto=_text((0.0, 0.0, 0.0, 0.0, 0.0, -link.length)))
        hangs_at = link.length


def _text(numbers: Iterable[float]) -> str:
    """The shortest digits that read back as the same numbers."""
    return " ".join(repr(float(number) + 0.0) for number in numbers)  # + 0.0: no "-0.0"


class _Link(NamedTuple):
    """One body and its joint, in MuJoCo's unit of mass: centre m from the joint, inertia about the centre."""

    length: float
    mass: float
    centre: float
    inertia: float
    damping: float
    stiffness: float
    springref: float
    armature: float


def mass_unit(scene: Scene) -> float:
    """What masses, inertias and torques are multiplied with: a power of two, which changes no digit.

    It makes the smallest mass at least 1, and the smallest inertia about a joint too: m l^2 of a point mass.
    """
    masses = np.where(scene.masses > 0.0, scene.masses, acting.links(scene).mass)
    inertias = masses * scene.lengths**2
    if scene.links is not None:
        inertias = scene.links.inertia + scene.links.mass * scene.links.centre**2
    smallest = min(masses.min(), inertias.min())
    return float(2.0 ** math.ceil(-math.log2(smallest)))


def _links(scene: Scene) -> list[_Link]:
    unit, (masses, centres, inertias) = mass_unit(scene), bodies(scene)
    damping, stiffness, armature = (
        unit * _each(scene, name) for name in ("joint_damping", "joint_stiffness", "armature")
    )
    rest = _each(scene, "joint_rest")
    columns = (scene.lengths, unit * masses, centres, unit * inertias, damping, stiffness, rest, armature)
    return [_Link(*row) for row in np.stack(columns, axis=1).tolist()]


def _each(scene: Scene, effect: str) -> FloatArray:
    """An effect's number for each joint (n,), 0 where the scene does not call for it."""
    value = getattr(scene.effects, effect)
    return np.broadcast_to(np.asarray(0.0 if value is None else value), (scene.n,))


def _disabled(scene: Scene) -> tuple[str, ...]:
    """What the scene does not call for, by the names that MJCF has for it."""
    needs = {flag for name in scene.terms for flag in HELD.get(name, _ASKS)}
    if acting.is_pulled(scene):
        needs.add("gravity")
    if not needs.isdisjoint(_ASKS):
        needs.add("passive")
    return tuple(flag for flag in _DISABLED if flag not in needs)


def _flag(name: str) -> mujoco.mjtDisableBit:
    return getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}")


def main() -> None:
    """Write models/mjcf/NAME.xml for every bundled scene that a file can hold."""
    from pendbench.base.bundled import bundled, bundled_names
    from pendbench.scene.scene import load_scene

    folder = bundled("models") / "mjcf"
    folder.mkdir(exist_ok=True)
    for scene in map(load_scene, bundled_names("models")):
        if fits_file(scene):
            (folder / f"{scene.name}.xml").write_text(write_mjcf(scene), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
