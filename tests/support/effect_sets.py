"""Chains with effects, for tests. The sets are few and shared: kernels are compiled for each."""

from __future__ import annotations

import dataclasses
from typing import Any

from pendbench.scene.scene import Effects, Scene

GRAVITY = 9.81

#: What each effect is where a test does not choose it: enough of it to show, on masses near 1 kg and rods near 1 m.
USUAL: dict[str, Any] = {
    "gravity": GRAVITY,
    "joint_damping": 0.05,
    "joint_stiffness": 2.0,
    "joint_rest": 0.7,
    "joint_torque": 0.1,
    "air_drag": {"linear": 0.05, "quadratic": 0.08},
    "rod_mass": 0.3,
    "driven_pivot": {"axis": "y", "amplitude": 0.03, "angular_frequency": 15.0, "phase": 0.8},
    "drive_torque": {"joint": 1, "amplitude": 0.5, "angular_frequency": 3.0, "phase": 0.8},
    "armature": 0.1,
}
EFFECTS = tuple(name for name in USUAL if name != "gravity")
#: Each effect alone with gravity and what it modifies, and all of them that every engine has but heyoka.
SETS = {name: Effects(**USUAL).only("gravity", name).named() for name in EFFECTS} | {
    "all": tuple(name for name in USUAL if name != "armature")
}
#: For which an implicit method is compiled too: that takes longest, and momenta know of an effect as forces do.
IN_GAUSS = ("air_drag", "rod_mass", "armature", "all")
#: Some of them, for what two of them may get wrong together.
MIXED = (
    ("joint_damping", "joint_stiffness"),
    ("gravity", "air_drag", "driven_pivot"),
    ("gravity", "rod_mass", "driven_pivot"),
    ("gravity", "air_drag", "rod_mass", "drive_torque"),
    ("gravity", "joint_damping", "air_drag", "rod_mass", "driven_pivot", "armature"),
)


def given(scene: Scene, **effects: Any) -> Scene:
    """The same chain with these effects and no others."""
    return dataclasses.replace(scene, effects=Effects(**effects))


def under(names: tuple[str, ...], scene: Scene) -> Scene:
    """The same chain with these effects, and what they modify, as usual."""
    return dataclasses.replace(scene, effects=Effects(**USUAL).only(*names))
