"""A scene as a MuJoCo model: built through the model-editing API, or written as an MJCF file.

MuJoCo has no point masses on massless rods: the compiler wants a rotational inertia of every body. Each body gets the
smallest one that is accepted, and masses in a unit that makes the smallest m l^2 at least 1, so that this inertia
biases the motion by rounding only. `compile_chain` takes the rest of it out as well; a file cannot.

``python -m pendbench.engines.mjcf`` writes the files of all bundled scenes again, into models/mjcf.
"""

from __future__ import annotations

import math
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Final

import mujoco
import numpy as np

from pendbench.arrays import FloatArray
from pendbench.errors import InputError, printable
from pendbench.scene import Scene

#: The compiler refuses anything smaller (probed with MuJoCo 4.0.0).
INERTIA: Final = float(mujoco.mjMINVAL)
#: The parser refuses bodies nested deeper (probed with MuJoCo 4.0.0). A model built through the API can be deeper.
DEEPEST_FILE: Final = 496

#: Swinging in the plane x-z, counter-clockwise positive for someone who has x to the right and z up.
_AXIS: Final = (0.0, -1.0, 0.0)
_DISABLED: Final = ("constraint", "contact", "spring", "damper", "actuation", "sensor", "autoreset")
_FILE_DT: Final = 1e-3
# What MuJoCo sets aside by itself is too little for its implicit integrators from some 500 links on; 200 n^2 is enough.
_MEMORY: Final = (16_000_000, 256)

_COMMENT: Final = """
  Written by `python -m pendbench.engines.mjcf`; do not edit.
  Masses are in a unit that makes the smallest inertia m l^2 at least 1 (the motion does not depend on it). MuJoCo wants
  an inertia of every body: for point masses, set model.body_inertia[1:] = 0 after loading.
  The start is the keyframe "start". The rods are drawn, and neither weigh nor touch anything.
"""


@contextmanager
def quiet() -> Iterator[None]:
    """Keep MuJoCo from printing a warning and from writing MUJOCO_LOG.TXT into the working folder.

    MuJoCo has one warning callback for the whole process. The user's own is put back afterwards, and misses what
    happens meanwhile: the warnings are counted in the data of the run, where the adapter reads them.
    """
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(_ignore)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def _ignore(text: str) -> None:
    """Take a warning's text and drop it."""


def chain_spec(scene: Scene) -> mujoco.MjSpec:
    """The chain as a MuJoCo model that can be edited further; `compile_chain` makes point masses of it.

    A body's frame is at its joint, so that joint angles are those between neighbouring rods, 0 for a hanging chain.
    """
    spec = mujoco.MjSpec()
    spec.modelname = printable(scene.name)
    spec.option.gravity = (0.0, 0.0, -(scene.effects.gravity or 0.0))
    spec.memory = _MEMORY[0] + _MEMORY[1] * scene.n**2
    spec.option.disableflags = sum(int(_flag(name)) for name in _disabled(scene))
    body, hangs_at = spec.worldbody, 0.0
    for i, (mass, length) in enumerate(zip(_scaled_masses(scene), scene.lengths, strict=True), start=1):
        body = body.add_body(
            name=f"link{i}",
            pos=(0.0, 0.0, -hangs_at),
            mass=mass,
            ipos=(0.0, 0.0, -length),
            inertia=(INERTIA, INERTIA, INERTIA),
            explicitinertial=True,
        )
        body.add_joint(name=f"joint{i}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=_AXIS)
        hangs_at = length
    return spec


def compile_chain(scene: Scene) -> mujoco.MjModel:
    """The chain as a compiled model of point masses. What MuJoCo warns about here it counts again at the first step."""
    with quiet(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = chain_spec(scene).compile()
    model.body_inertia[1:] = 0.0
    return model


def joint_values(absolute: FloatArray) -> FloatArray:
    """Joint angles or rates (n,) from those of the rods against the vertical (n,)."""
    return np.diff(absolute, prepend=0.0)


def write_mjcf(scene: Scene) -> str:
    """The scene as the text of an MJCF file, with its start as the keyframe "start".

    MuJoCo's own writer keeps six digits, too few for the same motion; here every number reads back as it was.

    Raises `InputError` for chains of more than `DEEPEST_FILE` links.
    """
    if scene.n > DEEPEST_FILE:
        raise InputError(f"scene {scene.name!r} has {scene.n} links; allowed in an MJCF file: at most {DEEPEST_FILE}")
    root = ET.Element("mujoco", model=printable(scene.name))
    root.append(ET.Comment(_COMMENT))
    _add_options(root, scene)
    ET.SubElement(ET.SubElement(root, "custom"), "text", name="title", data=printable(scene.title))
    _add_links(ET.SubElement(root, "worldbody"), scene)
    qpos, qvel = _text(joint_values(scene.angles)), _text(joint_values(scene.rates))
    ET.SubElement(ET.SubElement(root, "keyframe"), "key", name="start", qpos=qpos, qvel=qvel)
    ET.indent(root, space=" ")
    return ET.tostring(root, encoding="unicode") + "\n"


def _add_options(root: ET.Element, scene: Scene) -> None:
    ET.SubElement(root, "compiler", angle="radian")
    gravity = _text((0.0, 0.0, -(scene.effects.gravity or 0.0)))
    option = ET.SubElement(root, "option", timestep=_text([_FILE_DT]), integrator="RK4", gravity=gravity)
    ET.SubElement(option, "flag", dict.fromkeys(_disabled(scene), "disable"))
    rods = ET.SubElement(ET.SubElement(root, "default"), "geom")
    rods.attrib.update(type="capsule", size=_text([scene.total_length / 100]), mass="0", contype="0", conaffinity="0")


def _add_links(parent: ET.Element, scene: Scene) -> None:
    hangs_at = 0.0
    for i, (mass, length) in enumerate(zip(_scaled_masses(scene), scene.lengths, strict=True), start=1):
        parent = ET.SubElement(parent, "body", name=f"link{i}", pos=_text((0.0, 0.0, -hangs_at)))
        inertial = {"pos": _text((0.0, 0.0, -length)), "mass": _text([mass]), "diaginertia": _text([INERTIA] * 3)}
        ET.SubElement(parent, "inertial", inertial)
        ET.SubElement(parent, "joint", name=f"joint{i}", axis=_text(_AXIS))
        ET.SubElement(parent, "geom", fromto=_text((0.0, 0.0, 0.0, 0.0, 0.0, -length)))
        hangs_at = length


def _text(numbers: Iterable[float]) -> str:
    """The shortest digits that read back as the same numbers."""
    return " ".join(repr(float(number) + 0.0) for number in numbers)  # + 0.0: no "-0.0"


def _scaled_masses(scene: Scene) -> FloatArray:
    """Masses (n,) of which the smallest is at least 1, and the smallest m l^2 too. A power of two changes no digit."""
    smallest = min(scene.masses.min(), (scene.masses * scene.lengths**2).min())
    return scene.masses * 2.0 ** math.ceil(-math.log2(smallest))


def _disabled(scene: Scene) -> tuple[str, ...]:
    """What the scene does not call for, by the names that MJCF has for it."""
    return _DISABLED if scene.effects.gravity is not None else (*_DISABLED, "gravity")


def _flag(name: str) -> mujoco.mjtDisableBit:
    return getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}")


def main() -> None:
    """Write models/mjcf/NAME.xml for every bundled scene that a file can hold."""
    from pendbench.bundled import bundled, bundled_names
    from pendbench.scene import load_scene

    folder = bundled("models") / "mjcf"
    folder.mkdir(exist_ok=True)
    for scene in map(load_scene, bundled_names("models")):
        if scene.n <= DEEPEST_FILE:
            (folder / f"{scene.name}.xml").write_text(write_mjcf(scene), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
