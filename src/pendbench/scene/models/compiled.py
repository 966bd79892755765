"""A model file, compiled by MuJoCo, or its reason why not in one line."""

from __future__ import annotations

import warnings
from pathlib import Path

import mujoco

from pendbench.base.strict import input_error, shown_path
from pendbench.scene.models.alone import alone
from pendbench.scene.models.source import check_source


def compile_file(path: Path) -> mujoco.MjModel:
    """The model in an MJCF or URDF file, as it stands.

    Raises `InputError`, one line naming the file, where it may not be compiled or MuJoCo does not compile it.
    """
    real = check_source(path)
    try:
        with alone(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return mujoco.MjModel.from_xml_path(str(real))
    except (ValueError, mujoco.FatalError, mujoco.UnexpectedError, MemoryError) as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise input_error(shown_path(path), f"MuJoCo does not compile it: {said}") from None
