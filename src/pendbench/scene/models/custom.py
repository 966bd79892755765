"""What an MJCF file says in <custom>: the numbers and texts that MuJoCo keeps and does nothing with."""

from __future__ import annotations

from typing import Final

import mujoco

#: What pendbench's own files say there: what a scene has and a model has not.
MASS_UNIT: Final = "pendbench_mass_unit"
DURATION: Final = "pendbench_duration"
TIP: Final = "pendbench_tip"  # m, how long the last link is
TITLE: Final = "title"


def custom_number(model: mujoco.MjModel, name: str, default: float) -> float:
    """The first number of a <numeric>."""
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    return default if found < 0 else float(model.numeric_data[model.numeric_adr[found]])


def custom_text(model: mujoco.MjModel, name: str) -> str:
    """A <text>, empty where there is none."""
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, name)
    if found < 0:
        return ""
    first = int(model.text_adr[found])
    return decoded(model.text_data[first : first + int(model.text_size[found]) - 1])


def model_name(model: mujoco.MjModel) -> str:
    """The model's own name, empty where MuJoCo gave it one."""
    name = decoded(model.names.partition(b"\0")[0])
    return "" if name == "MuJoCo Model" else name


def decoded(text: bytes) -> str:
    """The text of bytes in MuJoCo's memory."""
    return bytes(text).decode("utf-8", "replace").strip()
