"""A model file as a scene, with all that it has beyond one."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import mujoco
import numpy as np

from pendbench.base.errors import InputError, printable
from pendbench.base.strict import input_error, shown_path
from pendbench.scene.models.as_scene import Naming, as_scene
from pendbench.scene.models.beyond import left_out, refused
from pendbench.scene.models.check import check_forces
from pendbench.scene.models.compiled import compile_file
from pendbench.scene.models.custom import DURATION, MASS_UNIT, TITLE, custom_number, custom_text, model_name
from pendbench.scene.models.joint_map import JointMap
from pendbench.scene.models.plane import NOTHING, Read, chain_bodies, read_chain
from pendbench.scene.models.start import Start, start_of
from pendbench.scene.models.trial import can_touch, run_as_it_stands
from pendbench.scene.scene import Scene

#: s, for a file that does not say: MJCF and URDF have no end.
SECONDS: Final = 10.0
_LONGEST_TITLE: Final = 200
_ROUNDING: Final = 1e-9  # rad, of axes turned through many frames


@dataclass(frozen=True, eq=False)
class Model:
    """A model file that was understood.

    scene: the chain from the file's start, with what the file has beyond it as its notes; joints: MuJoCo's joint
    coordinates as the scene's angles, and back; integrator, timestep (s) and disabled: the file's own settings, by
    MuJoCo's names; keyframe: the name of the one that it starts at, None for the reference pose.
    """

    path: Path
    scene: Scene
    joints: JointMap
    integrator: str
    timestep: float
    disabled: tuple[str, ...]
    keyframe: str | None

    @property
    def notes(self) -> tuple[str, ...]:
        """What the file has beyond the scene, a line each."""
        return self.scene.notes

    def compile(self) -> mujoco.MjModel:
        """The file as it stands, compiled by MuJoCo again."""
        return compile_file(self.path)

    @property
    def digest(self) -> str:
        """A hash of the compiled model: of the file and of all that it includes."""
        model = self.compile()
        content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
        mujoco.mj_saveModel(model, None, content)
        return hashlib.sha256(content.tobytes()).hexdigest()[:16]


def read_model(path: str | os.PathLike[str], keyframe: str | None = None) -> Model:
    """The chain in an MJCF or URDF file, from its keyframe of that name, else its first one, else its reference pose.

    Raises `InputError`, one line naming the file: it is not such a file, it does not compile, it is no planar chain, or
    something acts in it that no scene has.
    """
    where = Path(os.fsdecode(path))
    model = compile_file(where)
    try:
        with np.errstate(all="ignore"):  # what comes of numbers near the largest there are is refused as what it is
            return _understood(where, model, keyframe)
    except InputError as error:
        raise input_error(shown_path(where), str(error)) from None


def _understood(path: Path, model: mujoco.MjModel, keyframe: str | None) -> Model:
    heads = chain_bodies(model)
    start = start_of(model, keyframe)
    if problems := list(refused(model, start)):
        raise InputError("; ".join(problems))
    read = read_chain(model)
    check_forces(model, start, read)
    notes = (*_of_plane(model, read), *_touched(model, start), *left_out(model, start, heads))
    return Model(
        path=path,
        scene=_scene(path, model, read, start, notes),
        joints=read.joints,
        integrator=mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_").lower(),
        timestep=float(model.opt.timestep),
        disabled=tuple(_disabled(model)),
        keyframe=start.keyframe,
    )


def _scene(path: Path, model: mujoco.MjModel, read: Read, start: Start, notes: tuple[str, ...]) -> Scene:
    name = printable(path.stem)
    title = printable(custom_text(model, TITLE) or model_name(model) or name)[:_LONGEST_TITLE]
    naming = Naming(name, title, custom_number(model, DURATION, SECONDS), notes)
    chain = read.chain.in_unit(custom_number(model, MASS_UNIT, 1.0))
    return as_scene(chain, read.joints.angles(start.coordinates), read.joints.rates(start.rates), naming)


def _of_plane(model: mujoco.MjModel, read: Read) -> Iterator[str]:
    """How the chain lies in space, where that is more than a plane with gravity in it."""
    chain, off = read.chain, read.across
    if abs(off) > NOTHING * max(abs(off), chain.gravity):
        least = "all of gravity" if chain.gravity == 0.0 else f"{abs(off):.6g} m/s^2 of gravity"
        yield f"{least} is along the axes: left out, it does nothing in the plane"
    if read.tilt > _ROUNDING:
        yield f"the axes are parallel to {read.tilt:.1e} rad: taken for parallel"
    if (unit := custom_number(model, MASS_UNIT, 1.0)) != 1.0:
        yield f"masses are in units of 1/{unit:g} kg, as {MASS_UNIT} says"


def _touched(model: mujoco.MjModel, start: Start) -> Iterator[str]:
    """That nothing touches and no limit is reached in a run of the file as it stands. Raises `InputError` otherwise."""
    if not can_touch(model):
        return
    ran = run_as_it_stands(model, start)
    if ran.happened:
        raise InputError(f"{ran.happened} {ran.time:.3g} s after the start, in a run of the file as it stands: "
                         "no scene has these yet")  # fmt: skip
    yield f"contacts and limits: left out, none is reached in {ran.time:.3g} s of a run of the file as it stands"


def _disabled(model: mujoco.MjModel) -> Iterator[str]:
    for flag in mujoco.mjtDisableBit.__members__.values():
        if flag != mujoco.mjtDisableBit.mjNDISABLE and model.opt.disableflags & flag:
            yield flag.name.removeprefix("mjDSBL_").lower()
